#include "vehicle_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::equations {
namespace {

std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  while (true) {
    const std::size_t end = text.find('\n');
    lines.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return lines;
    text.remove_prefix(end + 1);
  }
}

/// A role that a variable of a section may have, and where it is kept.
struct Role {
  const char *section, *name;
  int Roles::*index;
};
constexpr Role roles[] = {
    {"states", "position_x", &Roles::position_x}, {"states", "position_y", &Roles::position_y},
    {"states", "heading", &Roles::heading},       {"states", "speed", &Roles::speed_state},
    {"inputs", "speed", &Roles::speed},           {"parameters", "speed_factor", &Roles::speed_factor},
};
constexpr const char* other_heading = "other_heading";

double number_of(const Settings& from, std::string_view meaning) {
  return NumberValue{}.read(from, OptionContext{"vehicle", meaning});
}

/// In YAML a comma ends a value between braces, also one between parentheses.
void check_commas(const Settings& about) {
  for (const auto& [key, value] : about.members())
    if (key.ends_with(')'))
      throw value.error(fmt::format("found '{}' after a comma; write a term that has a comma in quotes", key));
}

}  // namespace

std::string Option::described() const {
  if (unit.empty()) return meaning;
  return meaning.empty() ? fmt::format("[{}]", unit) : fmt::format("{} [{}]", meaning, unit);
}

VehicleFile::VehicleFile(const std::filesystem::path& file) : file_(file.string()), settings_(load_yaml(file)) {
  description_.name = file.stem().string();
  read();
}

VehicleFile::VehicleFile(const Settings& section) : file_(section.origin().file), settings_(section) {
  description_.name = "vehicle";
  read();
}

void VehicleFile::read() {
  // Columns are looked up where the text was written; elsewhere (--set) there are none.
  if (is_equations_file(file_)) {
    std::ifstream stream(file_, std::ios::binary);
    text_.assign(std::istreambuf_iterator<char>(stream), {});
  }
  lines_ = lines_of(text_);
  if (settings_.kind() != Settings::Kind::map)
    throw settings_.mismatch("a vehicle: a map with the keys states, inputs, parameters, outputs and equations");
  check_keys(settings_,
             {"name", "source", "options", "states", "inputs", "parameters", "outputs", "equations", "straight_motion"},
             "a vehicle's file");
  const Settings *name = settings_.find("name"), *source = settings_.find("source");
  if (name) description_.name = name->as_text();
  if (source) description_.source = source->as_text();
  read_options();
  read_variables("states", description_.states);
  read_variables("inputs", description_.inputs);
  read_variables("parameters", description_.parameters);
  read_variables("outputs", description_.outputs);
  if (description_.states.empty())
    throw settings_.error("it has no states; expected the key 'states' with one or more");
  if (description_.outputs.empty())
    throw settings_.error("it has no outputs; expected the key 'outputs' with what the sensors measure");
  if (!settings_.find("equations")) throw settings_.error("it has no equations; expected the key 'equations'");
  equations_ = statements_of("equations");
  straight_motion_ = statements_of("straight_motion");
}

void VehicleFile::check_name(const Settings& at, const std::string& name) {
  if (!is_name(name))
    throw at.error(fmt::format("'{}' is no name; expected letters, digits and underscores, and no digit first", name));
  if (is_reserved(name)) throw at.error(fmt::format("'{}' is a function or a constant; choose another name", name));
  if (std::find(names_.begin(), names_.end(), name) != names_.end())
    throw at.error(fmt::format("'{}' is a variable or an option already; choose another name", name));
  names_.push_back(name);
}

void VehicleFile::read_options() {
  const Settings* section = settings_.find("options");
  if (!section || section->is_null()) return;
  if (section->kind() != Settings::Kind::map) throw section->mismatch("a map of options, each with its default");
  for (const auto& [name, about] : section->members()) {
    check_name(about, name);
    if (name == "name" || name == "outputs" || name == "equations")
      throw about.error(fmt::format("'{}' is a key of the section 'model'; choose another name", name));
    Option option{name, {}, {}, {}, {}};
    if (about.kind() == Settings::Kind::scalar) {
      option.otherwise = term_of(about);
    } else {
      check_commas(about);
      check_keys(about, {"default", "unit", "meaning", "above", "at_least", "at_most"},
                 fmt::format("option '{}'", name));
      const Settings *above = about.find("above"), *at_least = about.find("at_least"), *at_most = about.find("at_most");
      if (above && at_least) throw above->error("found 'above' and 'at_least'; expected one of them");
      if (const Settings* given = about.find("default")) option.otherwise = term_of(*given);
      if (above) option.range.lower = number_of(*above, "least value");
      option.range.lower_is_open = above != nullptr;
      if (at_least) option.range.lower = number_of(*at_least, "least value");
      if (at_most) option.range.upper = number_of(*at_most, "largest value");
      if (const Settings* unit = about.find("unit")) option.unit = unit->as_text();
      if (const Settings* meaning = about.find("meaning")) option.meaning = meaning->as_text();
    }
    options_.push_back(std::move(option));
  }
}

void VehicleFile::read_variables(const char* section, std::vector<Variable>& variables) {
  const Settings* given = settings_.find(section);
  if (!given || given->is_null()) return;
  if (given->kind() != Settings::Kind::map)
    throw given->mismatch(fmt::format("a map of {} with what is known of each, e.g. v: {{unit: m/s}}", section));
  const bool is_output = std::string_view(section) == "outputs";
  for (const auto& member : given->members()) {
    const auto& [name, about] = member;
    // A measured state has the state's name.
    const auto is_state = [&](const Variable& state) { return state.name == member.first; };
    if (!is_output || std::none_of(description_.states.begin(), description_.states.end(), is_state))
      check_name(about, name);
    Variable variable{.name = name, .unit = "1", .meaning = {}};
    read_variable(section, variable, about, static_cast<int>(variables.size()));
    variables.push_back(std::move(variable));
  }
}

void VehicleFile::read_variable(std::string_view section, Variable& variable, const Settings& about, int index) {
  std::vector<std::string> keys{"unit", "meaning", "typical", "angle"};
  if (section == "outputs") keys.emplace_back("usual");
  if (section == "parameters") keys.emplace_back("nominal");
  if (section != "outputs") keys.insert(keys.end(), {"bounds", "role"});
  check_keys(about, keys, fmt::format("'{}' of {}", variable.name, section));
  if (const Settings* unit = about.find("unit")) variable.unit = unit->as_text();
  if (const Settings* meaning = about.find("meaning")) variable.meaning = meaning->as_text();
  if (const Settings* angle = about.find("angle")) variable.is_angle = angle->as_flag();
  if (const Settings* usual = about.find("usual")) variable.usual = usual->as_flag();
  if (const Settings* nominal = about.find("nominal")) variable.nominal = number_of(*nominal, "value without slip");
  if (const Settings* typical = about.find("typical")) {
    variable.scale = number_of(*typical, "typical magnitude");
    if (!(variable.scale > 0.0) || !std::isfinite(variable.scale))
      throw typical->mismatch("a typical magnitude, greater than 0");
  }
  if (const Settings* role = about.find("role")) read_role(section, *role, index);
  if (section == "outputs") return;
  Bounds bounds;
  if (const Settings* given = about.find("bounds")) {
    if (given->kind() != Settings::Kind::list || given->items().size() != 2)
      throw given->mismatch("a list [lower, upper]; null for no bound, and a term with a comma in quotes");
    if (!given->items()[0].is_null()) bounds.lower = term_of(given->items()[0]);
    if (!given->items()[1].is_null()) bounds.upper = term_of(given->items()[1]);
  }
  bounds_.push_back(std::move(bounds));
}

void VehicleFile::read_role(std::string_view section, const Settings& role, int index) {
  std::vector<std::string> known;
  for (const Role& each : roles)
    if (section == each.section) known.emplace_back(each.name);
  if (section == "states") known.emplace_back(other_heading);
  const std::size_t chosen = read_choice(role, known, OptionContext{"vehicle", "what a controller has to know"});
  if (known[chosen] == other_heading) {
    description_.roles.other_headings.push_back(index);
    return;
  }
  for (const Role& each : roles) {
    if (section != each.section || known[chosen] != each.name) continue;
    int& kept = description_.roles.*each.index;
    if (kept >= 0) throw role.error(fmt::format("two of the {} have the role '{}'; expected one", section, each.name));
    kept = index;
  }
}

Place VehicleFile::place(std::string_view section, const std::string& variable) const {
  const Settings* in = settings_.find(section);
  const Settings* of = in ? in->find(variable) : nullptr;
  return {.line = of ? of->origin().line : in ? in->origin().line : 1};
}

/// Where the lines of a scalar are in the file. A literal block begins below its key; anything else is looked for in
/// the key's own line, and has no columns if it is not written there as it is read.
SourceText VehicleFile::text_of(const Settings& scalar) const {
  const bool is_elsewhere = scalar.origin().file != file_;  // --set replaced a part of it
  SourceText source{scalar.origin().file, {}, fmt::format("{}: {}", scalar.where(), scalar.path())};
  const std::vector<std::string_view> lines = lines_of(scalar.as_text());
  const int key = scalar.origin().line;
  const auto column_in = [&](int number, std::string_view text) {
    if (is_elsewhere || number < 1 || number > static_cast<int>(lines_.size())) return 0;
    const std::size_t at = lines_[static_cast<std::size_t>(number) - 1].rfind(text);
    return at == std::string_view::npos ? 0 : static_cast<int>(at) + 1;
  };
  const bool is_block = lines.size() > 1 || column_in(key, lines[0]) == 0;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const int number = is_block ? key + 1 + static_cast<int>(k) : key;
    const int column = column_in(number, lines[k]);
    source.lines.push_back({lines[k], column > 0 ? number : key, column});
  }
  return source;
}

std::vector<Item> VehicleFile::term_of(const Settings& scalar) const {
  if (scalar.kind() != Settings::Kind::scalar) throw scalar.mismatch("a number, or a term such as 35 * pi / 180");
  for (const char* not_finite : {".inf", "inf", "-.inf", "-inf", ".nan", "nan", ".NaN", "NaN"})
    if (scalar.text() == not_finite) throw scalar.mismatch("a finite number; a bound that there is not is null");
  return parse_term(text_of(scalar));
}

std::vector<Statement> VehicleFile::statements_of(const char* section) const {
  const Settings* given = settings_.find(section);
  if (!given) return {};
  if (given->kind() != Settings::Kind::scalar)
    throw given->mismatch(fmt::format("equations as text, one a line, below '{}: |'", section));
  const SourceText source = text_of(*given);
  const auto is_joined = [](const SourceText::Line& line) { return !line.text.empty() && line.column == 0; };
  try {
    return parse_statements(source);
  } catch (const Error& mistake) {
    if (lines_.size() < 2 || std::none_of(source.lines.begin(), source.lines.end(), is_joined)) throw;
    const std::string text = mistake.what();
    const std::size_t line_end = std::min(text.find('\n'), text.size());  // below it the line is shown
    throw Error(
        fmt::format("{}. YAML has joined lines of '{}': write '{}: |', with one equation on each line below it{}",
                    text.substr(0, line_end), section, section, text.substr(line_end)));
  }
}

}  // namespace rhec::equations
