#include <fmt/format.h>

#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

constexpr const char* comparison_maker = "rhec compare";

}  // namespace

Json comparison_report(const std::filesystem::path& file) {
  using Kind = Json::Kind;
  const RequiredMembers members(
      file, fmt::format("compare.json as docs/compare.md describes it, which '{}' writes", comparison_maker));
  Json comparison = read_json(file, comparison_maker);
  const Json& solvers = members.get(comparison, "solvers", Kind::array);
  members.get(comparison, "scenario", Kind::text);
  members.get(comparison, "seeds", Kind::array);
  members.get(comparison, "reference", Kind::object);
  members.get(comparison, "every", Kind::integer);
  members.get(comparison, "all_usable", Kind::boolean);
  Json labels = Json::array();
  for (std::size_t i = 0; i < solvers.size(); ++i)
    labels.push_back(members.get(solvers[i], "label", Kind::text, fmt::format("solvers[{}]", i)));
  if (labels.empty()) members.refuse("solvers is empty");
  const Json& same = members.get(comparison, "same_problems", Kind::object);
  for (const auto& [kind, problems] : same.items()) {
    const std::string place = "same_problems." + kind;
    const Json& answers = members.get(problems, "solvers", Kind::array, place);
    if (answers.size() != labels.size())
      members.refuse(fmt::format("{}.solvers has {} entries for {} solvers", place, answers.size(), labels.size()));
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const std::string entry = fmt::format("{}.solvers[{}]", place, i);
      for (const char* spread : {"iterations", "kkt_residual", "defect", "gap", "distance", "time_us"})
        for (const char* number : {"median", "p99", "max"})
          if (!members.get(answers[i], spread, Kind::object, entry).contains(number))
            members.refuse(fmt::format("there is no {}.{}.{}", entry, spread, number));
      members.get(answers[i], "statuses", Kind::object, entry);
    }
  }
  const Json& loops = members.get(comparison, "closed_loop", Kind::array);
  for (std::size_t i = 0; i < loops.size(); ++i) {
    const std::string entry = fmt::format("closed_loop[{}]", i);
    members.get(loops[i], "label", Kind::text, entry);
    members.get(loops[i], "errors", Kind::object, entry);
    members.get(loops[i], "runs", Kind::array, entry);
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
