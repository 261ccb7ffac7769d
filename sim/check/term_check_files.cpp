#include "findings_json.hpp"
#include "rhec/sim/check/term_check.hpp"

namespace rhec::sim {

namespace {

Json json_of(const TermCheck& check) {
  Json json;
  json["term"] = check.term;
  json["seed"] = check.seed;
  json["verdict"] = word_of(check.verdict());
  json["findings"] = Json::array();
  for (const Finding& finding : check.findings) json["findings"].push_back(json_of(finding));
  json["vehicles"] = Json::array();
  for (const TermOnVehicle& each : check.vehicles)
    json["vehicles"].push_back({{"vehicle", each.vehicle},
                                {"limits", each.limits},
                                {"costs", each.costs},
                                {"data", each.data},
                                {"time_ns",
                                 {{"values", json_of(each.values)},
                                  {"jacobians", json_of(each.jacobians)},
                                  {"hessians", json_of(each.hessians)}}}});
  return json;
}

}  // namespace

std::string check_json(const TermCheck& check) { return json_of(check).dump(2); }

std::string check_json(const ModelCheck& model, const std::vector<TermCheck>& terms) {
  Json json = json_of(model);
  json["terms"] = Json::array();
  for (const TermCheck& term : terms) json["terms"].push_back(json_of(term));
  return json.dump(2);
}

}  // namespace rhec::sim
