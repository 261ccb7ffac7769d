#include "node_log.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "rhec/core/estimation/measurement.hpp"

namespace rhec {

void fill_gaps(std::vector<double>& rows, int width) {
  const std::ptrdiff_t count = width > 0 ? static_cast<std::ptrdiff_t>(rows.size()) / width : 0;
  const auto is_known = [&](std::ptrdiff_t i) {
    return std::all_of(rows.begin() + i * width, rows.begin() + (i + 1) * width,
                       [](double v) { return std::isfinite(v); });
  };
  for (std::ptrdiff_t i = 1; i < count; ++i)
    if (!is_known(i) && is_known(i - 1)) std::copy_n(rows.begin() + (i - 1) * width, width, rows.begin() + i * width);
  for (std::ptrdiff_t i = count - 2; i >= 0; --i)
    if (!is_known(i)) std::copy_n(rows.begin() + (i + 1) * width, width, rows.begin() + i * width);
}

void fill_columns(std::vector<double>& rows, int width) {
  for (int c = 0; c < width; ++c) {
    std::vector<double> column;
    for (std::size_t e = static_cast<std::size_t>(c); e < rows.size(); e += static_cast<std::size_t>(width))
      column.push_back(rows[e]);
    fill_gaps(column, 1);
    for (std::size_t i = 0; i < column.size(); ++i)
      rows[i * static_cast<std::size_t>(width) + static_cast<std::size_t>(c)] =
          std::isfinite(column[i]) ? column[i] : 0.0;
  }
}

void clean(NodeLog& log) {
  for (auto* rows : {&log.outputs, &log.inputs}) std::ranges::transform(*rows, rows->begin(), cleaned);
  for (BetweenNodes& each : log.between)
    for (int i = 0; i < each.count(); ++i)
      std::transform(each.outputs(i), each.outputs(i) + each.width(), each.outputs(i), cleaned);
}

void fill_data(const NodeLog& log, int inputs, RheProblem& problem) {
  const int nu = problem.model().input_count(), ny = problem.model().output_count(), N = log.intervals();
  for (std::ptrdiff_t i = 0; i <= N; ++i) {
    const int node = static_cast<int>(i);
    problem.set_output(node, log.measured(node, ny));
    if (i == N) break;
    std::copy_n(log.inputs.data() + i * inputs, inputs, problem.measured_input(node));
    std::fill(problem.measured_input(node) + inputs, problem.measured_input(node) + nu, 0.0);
    problem.set_duration(node, log.durations[i]);
    problem.between(node).assign(log.interval(node, inputs));
  }
}

}  // namespace rhec
