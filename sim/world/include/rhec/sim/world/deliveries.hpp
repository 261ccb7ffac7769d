#pragma once

#include <cstddef>
#include <vector>

namespace rhec::sim {

/// Measurements on their way to the estimator: in the order in which they arrive, and of those that arrive together in
/// the order in which they were sent.
class Deliveries {
 public:
  struct Row {
    double arrival, stamp;
    std::vector<double> outputs;
  };

  void add(double arrival, double stamp, const std::vector<double>& outputs) {
    std::size_t place = rows_.size();
    while (place > 0 && rows_[place - 1].arrival > arrival) --place;
    rows_.insert(rows_.begin() + static_cast<std::ptrdiff_t>(place), {arrival, stamp, outputs});
  }

  /// Hands out what has arrived by `time`: take(stamp, outputs).
  template <class Take>
  void deliver(double time, const Take& take) {
    std::size_t count = 0;
    for (; count < rows_.size() && rows_[count].arrival <= time + tolerance; ++count)
      take(rows_[count].stamp, rows_[count].outputs);
    rows_.erase(rows_.begin(), rows_.begin() + static_cast<std::ptrdiff_t>(count));
  }

  /// Times closer than this are the same [s].
  static constexpr double tolerance = 1e-9;

 private:
  std::vector<Row> rows_;
};

}  // namespace rhec::sim
