#pragma once

#include <map>
#include <string>
#include <string_view>

// The texts of a generated plugin; @WORD@ is replaced (@INCLUDE@ by #include: no line here is one). All that a model's
// class needs of the framework stands here.
namespace rhec::equations {

inline constexpr std::string_view header_template = R"(#pragma once

@INCLUDE@ <cmath>
@INCLUDES@
@INCLUDE@ "rhec/core/config/option_values.hpp"
@INCLUDE@ "rhec/core/formula/smooth.hpp"

/// @NAME@, made of @FILE@ by `rhec model --cpp`:
///
@EQUATIONS@@SOURCE_LINES@template <class Scalar>
struct @CLASS@ {
  static constexpr int @COUNTS@;
@MEMBERS@
  template <class Visitor>
@OPTIONS@
@DYNAMICS@
@OUTPUTS@@STRAIGHT_MOTION@};
)";

inline constexpr std::string_view source_template =
    R"(// @NAME@ as a plugin: names, units and bounds of the variables in @PLUGIN@.hpp.
@INCLUDE@ "@PLUGIN@.hpp"

@INCLUDES@@INCLUDE@ "rhec/core/base/error.hpp"
@INCLUDE@ "rhec/core/model/formula_model.hpp"
@INCLUDE@ "rhec/plugins/kit/sdk.hpp"

namespace rhec {
const StraightCode& @PLUGIN@_kernels();  // defined by rhec_add_model
}

namespace {

rhec::ModelDescription describe(@DESCRIBE_ARGUMENT@) {
@USING@  rhec::ModelDescription model;
  model.name = @MODEL_NAME@;
  model.source =
@MODEL_SOURCE@;
@VARIABLES@@ROLES@  return model;
}

class @CLASS@Model : public rhec::FormulaModel<@CLASS@> {
 public:
  explicit @CLASS@Model(const Options& options)
      : FormulaModel(options, @DESCRIBE_CALL@, rhec::@PLUGIN@_kernels()) {@REQUIRED@
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::model, @CLASS@Model,
            {.name = "@PLUGIN@",
             .version = "1.0.0",
             .licence = "",
@PLUGIN_SOURCE@,
             .capabilities = "first and second derivatives"});
)";

inline constexpr std::string_view cmake_template = R"(cmake_minimum_required(VERSION 3.25)
project(@PLUGIN@ LANGUAGES CXX)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
find_package(rhec REQUIRED)

rhec_add_model(@PLUGIN@ SOURCES @PLUGIN@.cpp FORMULA_HEADER @PLUGIN@.hpp FORMULA @CLASS@)
install(TARGETS @PLUGIN@ LIBRARY DESTINATION "${rhec_PLUGIN_DIRECTORY}")
)";

inline constexpr std::string_view readme_template = R"(# @PLUGIN@

The vehicle of `@FILE@` as a plugin of rhec, made by `rhec model --cpp`. It is the same formula: change it here from now on,
or change the file and make the folder again.

    cmake -S . -B build
    cmake --build build
    rhec check @PLUGIN@ --plugin-path build

With `-DRHEC_MODEL_INSTRUCTION_SETS=native` the first line has it compiled for this computer alone, which is quicker.

| file | what it is |
|---|---|
| `@PLUGIN@.hpp` | the formula, for any number type |
| `@PLUGIN@.cpp` | names, units and bounds of its variables, and the line that makes it a plugin |

A configuration names it in the section `model`: `{name: @PLUGIN@}`, with its options beside the name.
)";

/// The template with each @WORD@ replaced.
inline std::string filled(std::string_view text, const std::map<std::string, std::string>& words) {
  std::string all;
  while (true) {
    const std::size_t begin = text.find('@');
    all += text.substr(0, begin);
    if (begin == std::string_view::npos) return all;
    text.remove_prefix(begin + 1);
    const std::size_t end = text.find('@');
    all += words.at(std::string(text.substr(0, end)));
    text.remove_prefix(end + 1);
  }
}

}  // namespace rhec::equations
