#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Which parameters a model has as factors of its inputs, such as slip of the speed of wheels: nothing tells an input
/// that is not measured from such a parameter. A filter that would estimate both gains, wherever it is linearised anew,
/// knowledge of each that nobody has. Of these, the input is then what is guessed, as it acts with the parameter as it
/// was known: the parameter keeps its mean, and depends on nothing else. Allocates in its constructor only.
class RHEC_EXPORT InputFactors {
 public:
  explicit InputFactors(const Model& model);

  bool is_factor(int parameter, int input) const noexcept {
    return is_factor_[static_cast<std::size_t>(parameter) * inputs_ + static_cast<std::size_t>(input)] != 0;
  }
  /// Of an interval with inputs as measured (n_u, NaN where missing).
  void begin(const double* measured) noexcept;
  bool is_held(int parameter) const noexcept { return is_held_[static_cast<std::size_t>(parameter)] != 0; }

 private:
  std::size_t inputs_;
  std::vector<std::uint8_t> is_factor_;  ///< n_p rows of n_u
  std::vector<std::uint8_t> is_held_;    ///< n_p
};

}  // namespace rhec
