#include <fmt/format.h>

#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

constexpr const char* campaign_maker = "scripts/fault-campaign";
constexpr std::int64_t campaign_version = 2;

/// What an estimator made of a kind of fault.
void check_measures(const Json& measures, const RequiredMembers& members, const std::string& place) {
  using Kind = Json::Kind;
  for (const char* key : {"rides", "never", "unsaid", "followed", "longest_dishonest"})
    members.get(measures, key, Kind::integer, place);
  for (const char* key : {"honest", "honest_heading"}) members.get(measures, key, Kind::number, place);
  for (const char* key : {"recovered", "ok_again"})
    for (const char* part : {"median", "p99"})  // null: never
      if (!members.get(measures, key, Kind::object, place).contains(part))
        members.refuse(fmt::format("there is no {}.{}.{}", place, key, part));
  const Json& curve = members.get(measures, "curve", Kind::array, place);
  if (curve.empty()) members.refuse(fmt::format("{}.curve is empty", place));
  for (std::size_t i = 0; i < curve.size(); ++i)
    if (curve[i].kind() != Kind::array || curve[i].size() != 3)
      members.refuse(fmt::format("{}.curve[{}] is not [samples, median, 99th percentile]", place, i));
}

}  // namespace

Json faults_report(const std::filesystem::path& file) {
  using Kind = Json::Kind;
  const RequiredMembers members(file, fmt::format("faults.json of version {} as '{}' writes it into its folder",
                                                  campaign_version, campaign_maker));
  Json campaign = read_json(file, campaign_maker);
  if (const auto version = members.get(campaign, "version", Kind::integer).get<std::int64_t>();
      version != campaign_version)
    members.refuse(fmt::format("version is {}", version));
  for (const char* key : {"steps", "drives", "window", "figures"}) members.get(campaign, key, Kind::integer);
  for (const char* key : {"vehicles", "samples"}) members.get(campaign, key, Kind::array);
  members.get(members.get(campaign, "wanted", Kind::object), "honest", Kind::number, "wanted");
  const Json& estimators = members.get(campaign, "estimators", Kind::array);
  const Json& kinds = members.get(campaign, "kinds", Kind::array);
  if (kinds.empty() || estimators.empty()) members.refuse("kinds or estimators are empty");
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const std::string place = fmt::format("kinds[{}]", k);
    for (const char* key : {"name", "group"}) members.get(kinds[k], key, Kind::text, place);
    const Json& measures = members.get(kinds[k], "estimators", Kind::object, place);
    for (const Json& estimator : estimators) {
      const auto name = estimator.get<std::string>();
      check_measures(members.get(measures, name, Kind::object, place + ".estimators"), members,
                     fmt::format("{}.estimators.{}", place, name));
    }
  }
  Json document;
  document["kind"] = "faults";
  document["title"] = "Faults of sensors, clocks and wheels";
  document["subtitle"] = fmt::format("{} kinds of faults on {} drives; what the columns mean is told in docs/faults.md",
                                     kinds.size(), counted(campaign.at("drives").get<std::int64_t>()));
  Json notes = Json::array();
  for (const Json& missed : members.get(campaign, "missed", Kind::array))
    add_note(notes, "not reached", missed.get<std::string>());
  document["campaign"] = std::move(campaign);
  document["notes"] = std::move(notes);
  return document;
}

}  // namespace rhec::sim
