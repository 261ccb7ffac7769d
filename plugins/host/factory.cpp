#include "factory.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/model/chosen_outputs.hpp"

namespace rhec {
namespace {

/// Buffer for the message of a plugin's function that fails.
using ErrorText = std::array<char, 4096>;

std::string said(const ErrorText& text) {
  return text[0] != '\0' ? std::string(text.data()) : "it gave no reason; tell its author";
}

/// True if an option has no default, and `error` names it as a key.
bool is_told_as_missing(const OptionRow& option, std::string_view error) {
  if (!option.default_value.empty() && option.default_value != "[]") return false;
  const std::string key = option.name + ": ";
  const std::size_t place = error.find(key);
  return place == 0 || (place != std::string_view::npos && error[place - 1] == ' ');
}

std::string numbers_of_variables(const Model& model) {
  return fmt::format("{} states, {} inputs, {} parameters, {} outputs", model.state_count(), model.input_count(),
                     model.parameter_count(), model.output_count());
}

}  // namespace

Error plugin_error(const Settings& settings, const std::string& text) {
  const Settings* name = settings.find("name");
  return name != nullptr ? name->error(text) : Error(text);
}

std::shared_ptr<void> make_object(const Library& library, const Settings& settings) {
  ErrorText error{};
  void* object = library.manifest->create(&settings, error.data(), error.size());
  if (object == nullptr && error[0] != '\0') throw Error(error.data());  // already says which plugin it is about
  if (object == nullptr) {
    throw plugin_error(settings, fmt::format("{} '{}' could not be made: {}", word_of(library.record.kind),
                                             library.record.name, said(error)));
  }
  return {object, [destroy = library.manifest->destroy, pinned = library.pinned](void* made) { destroy(made); }};
}

std::vector<OptionRow> options_of(const Library& library) {
  std::vector<OptionRow> rows;
  ErrorText error{};
  if (!library.manifest->schema(&rows, error.data(), error.size())) {
    throw Error(fmt::format("the options of {} '{}' cannot be told: {}", word_of(library.record.kind),
                            library.record.name, said(error)));
  }
  if (library.record.kind == PluginKind::model) rows.push_back(outputs_row());
  return rows;
}

/// A sensor of the list `outputs`: its name, and the output that it measures. An output, or {NAME: OUTPUT}.
std::pair<std::string, Settings> sensor_in(const Settings& item) {
  if (item.kind() != Settings::Kind::map) return {item.as_text(), item};
  if (item.members().size() != 1) throw item.mismatch("an output, or one more sensor of it, as in {x_gps_2: x_gps}");
  const auto& [name, of] = item.members().front();
  constexpr const char* letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";
  if (name.find_first_not_of(letters) != std::string::npos || (name[0] >= '0' && name[0] <= '9'))
    throw item.error(fmt::format("found the name '{}', expected letters, digits and underscores", name));
  return {name, of};
}

std::shared_ptr<Model> choose_outputs(std::shared_ptr<Model> model, const Settings& section) {
  const ModelDescription& about = model->description();
  const Settings* wanted = section.find("outputs");
  if (!wanted) {
    const std::vector<int> usual = usual_outputs(about);
    return with_outputs(std::move(model), usual);
  }
  if (wanted->kind() == Settings::Kind::scalar && wanted->text() == "all") return model;
  const std::vector<std::string> known = names_of(about.outputs);
  if (wanted->kind() != Settings::Kind::list || wanted->items().empty())
    throw wanted->mismatch(fmt::format("'all' or a list of outputs: {}", fmt::join(known, ", ")));
  std::vector<int> chosen;
  std::vector<std::string> names;
  for (const Settings& item : wanted->items()) {
    const auto [name, of] = sensor_in(item);
    const auto found = std::find(known.begin(), known.end(), of.as_text());
    if (found == known.end())
      throw of.mismatch(fmt::format("an output of the model '{}': {}", about.name, fmt::join(known, ", ")));
    if (std::find(names.begin(), names.end(), name) != names.end())
      throw item.error(
          fmt::format("'{}' is named twice; another sensor that measures the same needs a name of its own, "
                      "as in {{{}_2: {}}}",
                      name, of.text(), of.text()));
    if (name != of.text() && std::find(known.begin(), known.end(), name) != known.end())
      throw item.error(fmt::format("'{}' is another output of the model; expected a name of its own", name));
    chosen.push_back(static_cast<int>(found - known.begin()));
    names.push_back(name);
  }
  return with_outputs(std::move(model), chosen, names);
}

PluginTrial try_library(const Library& library, const Stage& stage) {
  std::vector<OptionRow> rows;
  try {
    stage("options");
    rows = options_of(library);
    stage("make");
    const std::shared_ptr<void> object = make_object(library, {});
    std::string text;
    if (library.record.kind == PluginKind::model)
      text = numbers_of_variables(*choose_outputs(std::static_pointer_cast<Model>(object), {}));
    stage("destroy");
    return {PluginTrial::Outcome::made, std::move(text)};
  } catch (const Error& error) {
    const bool needs = std::any_of(rows.begin(), rows.end(),
                                   [&](const OptionRow& row) { return is_told_as_missing(row, error.what()); });
    return {needs ? PluginTrial::Outcome::needs_options : PluginTrial::Outcome::failed, error.what()};
  }
}

}  // namespace rhec
