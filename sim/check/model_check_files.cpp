#include "rhec/sim/check/model_check.hpp"

#include "findings_json.hpp"

namespace rhec::sim {
namespace {

Json json_of(const DriveInformation& drive, const ModelCheck& check) {
  Json json;
  json["name"] = drive.name;
  json["meaning"] = drive.meaning;
  json["unusable"] = drive.unusable;
  json["unknowns"] = drive.unknowns;
  json["rank"] = drive.rank;
  json["condition"] = number_or_null(drive.condition);
  json["parameter_sigma"] = Json::object();
  for (std::size_t j = 0; j < check.parameters.size(); ++j)
    json["parameter_sigma"][check.parameters[j]] = number_or_null(drive.parameter_sigma[j]);
  json["state_determined"] = Json::object();
  for (std::size_t j = 0; j < check.states.size(); ++j)
    json["state_determined"][check.states[j]] = static_cast<bool>(drive.state_determined[j]);
  json["undetermined"] = drive.undetermined;
  json["weakest"] = drive.weakest;
  return json;
}

}  // namespace

Json json_of(const ModelCheck& check) {
  Json json;
  json["model"] = check.model;
  json["seed"] = check.seed;
  json["verdict"] = word_of(check.verdict());
  json["findings"] = Json::array();
  for (const Finding& finding : check.findings) json["findings"].push_back(json_of(finding));
  json["rank_threshold"] = rank_threshold;
  json["drives"] = Json::array();
  for (const DriveInformation& drive : check.drives) json["drives"].push_back(json_of(drive, check));
  json["time_ns"] = Json::array();
  for (const EvaluationTimes& times : check.times)
    json["time_ns"].push_back({{"instruction_set", times.instruction_set},
                               {"values", json_of(times.values)},
                               {"jacobians", json_of(times.jacobians)},
                               {"hessians", json_of(times.hessians)},
                               {"outputs", json_of(times.outputs)}});
  return json;
}

std::string check_json(const ModelCheck& check) { return json_of(check).dump(2); }

}  // namespace rhec::sim
