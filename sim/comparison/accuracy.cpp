// Backends at equal accuracy.
#include "accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "assessment.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec::sim {
namespace {

// Tolerances tried: 10^-2 ... 10^-12.
constexpr int loosest_exponent = -2, tightest_exponent = -12;

bool has_option(const Host& host, const std::string& solver, std::string_view name) {
  const std::vector<OptionRow> rows = host.options(PluginKind::solver, solver);
  return std::any_of(rows.begin(), rows.end(), [&](const OptionRow& row) { return row.name == name; });
}

/// The 99th percentile of the KKT residual over all accepted problems.
double p99_of(const Host& host, const Backend& backend, const Settings& options, const std::vector<Recorded>& records) {
  Bench bench(host, backend, options);
  Assessor assessor;
  Iterate point;
  std::vector<double> residuals;
  for (const Recorded& record : records) {
    if (!bench.why_not(record).empty()) continue;
    Answer answer = bench.solve(record, point);
    assessor.begin(*record.problem);
    const double kkt = assessor.kkt_of(point, answer);
    residuals.push_back(std::isfinite(kkt) ? kkt : infinity);
  }
  return residuals.empty() ? 0.0 : spread_of(std::move(residuals)).p99;
}

}  // namespace

Settings tighten(const Host& host, const Backend& backend, double accuracy, const std::vector<Recorded>& records,
                 BackendAnswers& result) {
  Settings options = backend.options.is_null() ? Settings::map() : backend.options;
  if (has_option(host, backend.solver, "mode")) {
    Settings converging = options;
    converging.set("mode", Settings::scalar("converge"));
    try {
      host.make_solver(backend.solver, converging);
      options = converging;
    } catch (const Error&) {
      // This solver's `mode` has another meaning.
    }
  }
  double least = infinity;
  Settings best = options;
  if (!has_option(host, backend.solver, "tolerance")) {
    least = p99_of(host, backend, options, records);
    result.accuracy_reached = least <= accuracy;
    result.tuning =
        fmt::format("has no option 'tolerance'; KKT residual at the 99th percentile as it is: {:.1e}", least);
    return options;
  }
  for (int exponent = loosest_exponent; exponent >= tightest_exponent && !(least <= accuracy); --exponent) {
    Settings tightened = options;
    tightened.set("tolerance", Settings::scalar(fmt::format("1e{}", exponent)));
    try {
      host.make_solver(backend.solver, tightened);
    } catch (const Error&) {
      continue;  // this plugin does not allow the value; all other options were valid
    }
    const double residual = p99_of(host, backend, tightened, records);
    if (!result.tolerance || residual < least) {
      least = residual;
      best = tightened;
      result.tolerance = tightened.find("tolerance")->as_number();
    }
  }
  result.accuracy_reached = least <= accuracy;
  const Settings* mode = best.find("mode");
  const std::string setting = fmt::format("{}tolerance {:.0e}", mode ? fmt::format("mode {}, ", mode->text()) : "",
                                          result.tolerance.value_or(0.0));
  if (!result.tolerance) {
    result.tuning = "no value of its option 'tolerance' from 1e-2 to 1e-12 is allowed";
  } else if (result.accuracy_reached) {
    result.tuning = fmt::format("{}: KKT residual {:.1e} at the 99th percentile", setting, least);
  } else {
    result.tuning =
        fmt::format("never reached down to tolerance 1e{}; least with {}: KKT residual {:.1e} at the 99th percentile",
                    tightest_exponent, setting, least);
  }
  return best;
}

}  // namespace rhec::sim
