#include "native_options.hpp"

#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include <IpOptionsList.hpp>
#include <IpRegOptions.hpp>

#include "rhec/core/config/option_values.hpp"

namespace rhec::ipopt {
namespace {

using std::literals::string_view_literals::operator""sv;

/// Options of Ipopt that are not passed through, and the advice given instead.
constexpr auto ours = std::to_array<std::pair<std::string_view, std::string_view>>(
    {{"tol"sv, "set the solver's option 'tolerance'"sv},
     {"max_iter"sv, "set the solver's option 'max_iterations'"sv},
     {"hessian_approximation"sv, "set the solver's option 'hessian'"sv},
     {"warm_start_init_point"sv, "set the solver's option 'warm_start'"sv},
     {"warm_start_entire_iterate"sv, "set the solver's option 'warm_start'"sv},
     {"warm_start_same_structure"sv, "structures change from sample to sample"sv},
     {"skip_finalize_solution_call"sv, "the solution would be lost"sv},
     {"replace_bounds"sv, "iterates could not be compared"sv},
     {"option_file_name"sv, "write what is in that file here instead"sv},
     {"output_file"sv, "a solver writes no file"sv},
     {"file_print_level"sv, "a solver writes no file"sv},
     {"suppress_all_output"sv, "a solver prints nothing anyway"sv},
     {"sb"sv, "a solver prints nothing anyway"sv}});

std::string number_text(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// "a number above 0, below 1"
std::string expectation(const Ipopt::RegisteredOption& option) {
  if (option.Type() == Ipopt::OT_String) {
    std::string all;
    for (const auto& entry : option.GetValidStrings()) all += (all.empty() ? "" : " | ") + entry.value_;
    return all;
  }
  const bool integer = option.Type() == Ipopt::OT_Integer;
  std::string text = integer ? "an integer" : "a number";
  if (option.HasLower())
    text += integer ? ", at least " + std::to_string(option.LowerInteger())
                    : (option.LowerStrict() ? ", above " : ", at least ") + number_text(option.LowerNumber());
  if (option.HasUpper())
    text += integer ? ", at most " + std::to_string(option.UpperInteger())
                    : (option.UpperStrict() ? ", below " : ", at most ") + number_text(option.UpperNumber());
  return text;
}

void set_option(const std::string& name, const Settings& value, Ipopt::IpoptApplication& application) {
  const Ipopt::SmartPtr<Ipopt::RegisteredOptions> registered = application.RegOptions();
  const Ipopt::SmartPtr<const Ipopt::RegisteredOption> option = registered->GetOption(name);
  if (!Ipopt::IsValid(option)) {
    std::vector<std::string> known;
    for (const auto& known_option : registered->RegisteredOptionsList()) known.push_back(known_option.first);
    const std::string meant = nearest(name, known);
    throw value.error("solver 'ipopt': Ipopt has no option '" + name + "'" +
                      (meant.empty() ? "; its manual lists them" : "; did you mean '" + meant + "'?"));
  }
  const auto refused = [&] {
    return value.error("solver 'ipopt': found " + value.found() + ", expected " + expectation(*option) +
                       " (Ipopt: " + option->ShortDescription() + ")");
  };
  const Ipopt::SmartPtr<Ipopt::OptionsList> options = application.Options();
  bool accepted = false;
  if (option->Type() == Ipopt::OT_Number) {
    const auto number = value.number();
    accepted = number && option->IsValidNumberSetting(*number) && options->SetNumericValue(name, *number);
  } else if (option->Type() == Ipopt::OT_Integer) {
    const auto integer = value.integer();
    accepted = integer && option->IsValidIntegerSetting(*integer) && options->SetIntegerValue(name, *integer);
  } else {
    // YAML's true and false are what Ipopt calls yes and no.
    const auto flag = value.flag();
    const std::string text =
        flag && !option->IsValidStringSetting(value.text()) ? (*flag ? "yes" : "no") : value.text();
    accepted = value.kind() == Settings::Kind::scalar && option->IsValidStringSetting(text) &&
               options->SetStringValue(name, text);
  }
  if (!accepted) throw refused();
}

}  // namespace

std::set<std::string> set_native_options(const Settings& native, Ipopt::IpoptApplication& application) {
  if (native.is_null()) return {};
  if (native.kind() != Settings::Kind::map) throw native.mismatch("a map of options of Ipopt");
  std::set<std::string> names;
  for (const auto& [name, value] : native.members()) {
    for (const auto& [other, instead] : ours)
      if (name == other)
        throw value.error("solver 'ipopt': Ipopt's option '" + name + "' cannot be set here: " + std::string(instead));
    if (name.starts_with("print_") || name.starts_with("derivative_test"))
      throw value.error("solver 'ipopt': Ipopt's option '" + name + "' cannot be set here: a solver prints nothing");
    set_option(name, value, application);
    names.insert(name);
  }
  return names;
}

}  // namespace rhec::ipopt
