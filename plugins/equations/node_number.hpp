#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "rhec/core/term/term.hpp"
#include "statements.hpp"

namespace rhec::equations {

/// What is known of a node of the horizon by these names, in the order in which terms ask for it. The room beside the
/// path may be infinite.
struct PlaceName {
  const char* name;
  double TermPlace::*value;
  bool is_finite;
};
inline constexpr std::array<PlaceName, 8> place_names{{{"path_x", &TermPlace::x, true},
                                                       {"path_y", &TermPlace::y, true},
                                                       {"path_heading", &TermPlace::heading, true},
                                                       {"path_speed", &TermPlace::speed, true},
                                                       {"arc_length", &TermPlace::arc_length, true},
                                                       {"time", &TermPlace::time, true},
                                                       {"room_left", &TermPlace::left, false},
                                                       {"room_right", &TermPlace::right, false}}};

/// A number that nobody differentiates, so that it may have corners and be infinite: a term of options and, unless it
/// is of the options alone, of a node.
class NodeNumber {
 public:
  /// `options`: their values. Throws Error with the place of a name that is not known, and for a term that needs more
  /// than 64 numbers at a time.
  NodeNumber(const std::string& file, const std::vector<Item>& term, const std::map<std::string, double>& options,
             bool may_use_place);
  double at(const TermPlace& place) const noexcept;

 private:
  static constexpr std::size_t most_numbers = 64;
  enum class Code : unsigned char {
    number,
    place,
    negate,
    add,
    subtract,
    multiply,
    divide,
    power,
    function_1,
    function_2,
    function_3
  };
  struct Step {
    Code code;
    double value = 0.0;
    double TermPlace::*of_place = nullptr;
    double (*one)(double) = nullptr;
    double (*two)(double, double) = nullptr;
    double (*three)(double, double, double) = nullptr;
  };
  static Step step_of(const Item& item);

  std::vector<Step> steps_;
};

}  // namespace rhec::equations
