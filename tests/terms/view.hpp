#pragma once

// Terms, through their plugins.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::testing {

using ::testing::HasSubstr;

inline const Host& host() {
  static const Host instance;
  return instance;
}

inline std::shared_ptr<Term> make(const std::string& name, const std::string& options = "{}") {
  return host().make_term(name, parse_yaml(options, "test"));
}

/// A term on a vehicle at one place: the values and bounds of its limits, in the order in which it wrote them.
struct At {
  At(const std::shared_ptr<const Model>& model, const std::shared_ptr<Term>& term, const TermPlace& place,
     const std::vector<double>& x, const std::vector<double>& u = {}, std::vector<double> p = {})
      : functions(*model, {{"it", term}}) {
    if (p.empty()) p = nominal_values(model->description().parameters);
    std::vector<double> arguments = x;
    arguments.insert(arguments.end(), p.begin(), p.end());
    std::vector<double> inputs = u;
    inputs.resize(static_cast<std::size_t>(model->input_count()), 0.0);
    arguments.insert(arguments.end(), inputs.begin(), inputs.end());
    arguments.push_back(0.2);
    const std::size_t first_data = arguments.size();
    arguments.resize(static_cast<std::size_t>(functions.argument_row()), 0.0);
    const auto limits = static_cast<std::size_t>(functions.limit_count());
    lower.resize(limits);
    upper.resize(limits);
    term->write_data(place, arguments.data() + first_data, lower.data(), upper.data());
    const TermFunctions::Rows& rows = functions.rows(TermFunctions::Stage::middle);
    std::vector<double> all(static_cast<std::size_t>(rows.count())), scratch(functions.scratch_size());
    std::vector<double> all_slopes(rows.slopes.size());
    functions.evaluate(TermFunctions::Stage::middle, 1, arguments.data(), all.data(), all_slopes.data(),
                       scratch.data());
    for (std::size_t k = 0; k < limits; ++k)
      values.push_back(all[static_cast<std::size_t>(functions.place_of(0, static_cast<int>(k)))]);
    residuals.assign(all.begin() + rows.limits, all.end());
    slopes = all_slopes;
  }
  /// How far inside of its bounds a limit is.
  double inside(std::size_t k) const { return std::min(values[k] - lower[k], upper[k] - values[k]); }

  TermFunctions functions;
  std::vector<double> values, lower, upper, residuals, slopes;
};

inline std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

}  // namespace rhec::testing
