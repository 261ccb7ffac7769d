#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/sim/check/term_check.hpp"
#include "sim/support/unicycle.hpp"

// Terms that a test writes, each with a fault of its own.
namespace rhec::sim {

class WrittenTerm final : public Term {
 public:
  using Write = std::function<void(TermWriter& writer)>;
  using WriteData = std::function<void(const TermPlace& place, double* data, double* lower, double* upper)>;
  WrittenTerm(Write write, WriteData write_data) : write_(std::move(write)), write_data_(std::move(write_data)) {}
  void write(TermWriter& writer) const override { write_(writer); }
  void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept override {
    write_data_(place, data, lower, upper);
  }

 private:
  Write write_;
  WriteData write_data_;
};

inline NamedTerm written(WrittenTerm::Write write, WrittenTerm::WriteData write_data) {
  return {"mine", std::make_shared<WrittenTerm>(std::move(write), std::move(write_data)), {}};
}

/// The speed over ground at most 3, and less where the node is late; the distance from the path as a cost.
inline NamedTerm right_term() {
  return written(
      [](TermWriter& writer) {
        const Expression px = writer.data("path_x"), py = writer.data("path_y");
        writer.residual(writer.position_x() - px, {.weight = 2.0, .delta = 0.5}, "aside");
        writer.residual(writer.position_y() - py, {.weight = 2.0}, "along");
        writer.limit(writer.wheel_speed() * cos(writer.heading()), {}, "eastward");
        writer.limit(writer.position_x(), {}, "wall");
      },
      [](const TermPlace& place, double* data, double* lower, double* upper) {
        data[0] = place.x;
        data[1] = place.y;
        lower[0] = -infinity;
        upper[0] = 3.0 - 0.01 * place.time;
        lower[1] = -100.0;
        upper[1] = 100.0;
      });
}

inline TermDescription right_description() {
  return {"mine",
          "keeps it slow",
          {{"most", "number", "3", "", "speed over ground [m/s]"}, {"hard", "flag", "false", "", "never violated"}}};
}

inline TermCheck check(const NamedTerm& term, const TermDescription& about = right_description()) {
  return check_term(term, about, {unicycle()}, true);
}

inline std::vector<Finding> findings_of(const TermCheck& check, const std::string& which) {
  std::vector<Finding> found;
  for (const Finding& finding : check.findings)
    if (finding.check == which) found.push_back(finding);
  return found;
}

}  // namespace rhec::sim
