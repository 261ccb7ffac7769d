#pragma once

#include <string>
#include <vector>

#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// A section of a configuration file with its keys, for the documentation. A name in capitals stands for each variable
/// of its kind.
struct OptionSection {
  std::string name;
  std::string meaning;
  std::vector<OptionRow> rows;
};

}  // namespace rhec
