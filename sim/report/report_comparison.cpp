#include <fmt/format.h>

#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

constexpr const char* comparison_maker = "rhec compare";

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}; expected compare.json as docs/compare.md describes it, which '{}' writes",
                          file.string(), what, comparison_maker));
}

/// A member of this kind; otherwise throws an Error with its location.
const Json& required(const Json& json, const std::string& key, Json::Kind kind, const std::filesystem::path& file,
                     const std::string& place) {
  const std::string path = place.empty() ? key : place + "." + key;
  if (!json.is_object()) refuse(file, fmt::format("{} is no map", place.empty() ? "the whole" : place));
  const Json* found = json.find(key);
  if (!found) refuse(file, fmt::format("there is no {}", path));
  if (found->kind() != kind) refuse(file, fmt::format("{} is {}", path, found->kind_name()));
  return *found;
}

}  // namespace

Json comparison_report(const std::filesystem::path& file) {
  using Kind = Json::Kind;
  Json comparison = read_json(file, comparison_maker);
  const Json& solvers = required(comparison, "solvers", Kind::array, file, "");
  required(comparison, "scenario", Kind::text, file, "");
  required(comparison, "seeds", Kind::array, file, "");
  required(comparison, "reference", Kind::object, file, "");
  required(comparison, "every", Kind::integer, file, "");
  required(comparison, "all_usable", Kind::boolean, file, "");
  Json labels = Json::array();
  for (std::size_t i = 0; i < solvers.size(); ++i)
    labels.push_back(required(solvers[i], "label", Kind::text, file, fmt::format("solvers[{}]", i)));
  if (labels.empty()) refuse(file, "solvers is empty");
  const Json& same = required(comparison, "same_problems", Kind::object, file, "");
  for (const auto& [kind, problems] : same.items()) {
    const std::string place = "same_problems." + kind;
    const Json& answers = required(problems, "solvers", Kind::array, file, place);
    if (answers.size() != labels.size())
      refuse(file, fmt::format("{}.solvers has {} entries for {} solvers", place, answers.size(), labels.size()));
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const std::string entry = fmt::format("{}.solvers[{}]", place, i);
      for (const char* spread : {"iterations", "kkt_residual", "defect", "gap", "distance", "time_us"})
        for (const char* number : {"median", "p99", "max"})
          if (!required(answers[i], spread, Kind::object, file, entry).contains(number))
            refuse(file, fmt::format("there is no {}.{}.{}", entry, spread, number));
      required(answers[i], "statuses", Kind::object, file, entry);
    }
  }
  const Json& loops = required(comparison, "closed_loop", Kind::array, file, "");
  for (std::size_t i = 0; i < loops.size(); ++i) {
    const std::string entry = fmt::format("closed_loop[{}]", i);
    required(loops[i], "label", Kind::text, file, entry);
    required(loops[i], "errors", Kind::object, file, entry);
    required(loops[i], "runs", Kind::array, file, entry);
  }
  Json document;
  document["kind"] = "comparison";
  document["title"] = fmt::format("Solvers on {}", comparison.at("scenario").get<std::string>());
  std::string list;
  for (const Json& label : labels) list += (list.empty() ? "" : ", ") + label.get<std::string>();
  document["subtitle"] = list;
  Json notes = Json::array();
  add_note(notes, "times", "Times are of the machine that made the comparison, and of what else it did: trust ratios.");
  if (const auto every = comparison.at("every").get<std::int64_t>(); every > 1)
    add_note(notes, "samples", fmt::format("The same problems are those of every {}th step.", every));
  if (loops.empty()) add_note(notes, "runs", "The closed loop was not asked for.");
  document["labels"] = std::move(labels);
  document["comparison"] = std::move(comparison);
  document["notes"] = std::move(notes);
  return document;
}

}  // namespace rhec::sim
