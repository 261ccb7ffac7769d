#pragma once

#include <cmath>

#include "rhec/sim/check/finding.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/numbers/spread.hpp"

// What checks have in common as JSON; numbers that are not finite become null.
namespace rhec::sim {

inline Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

struct ModelCheck;
Json json_of(const ModelCheck& check);

inline Json json_of(const Finding& finding) {
  Json json;
  json["check"] = finding.check;
  json["verdict"] = word_of(finding.verdict);
  json["where"] = finding.where;
  json["found"] = finding.found;
  json["advice"] = finding.advice;
  json["numbers"] = Json::object();
  for (const auto& [name, value] : finding.numbers) json["numbers"][name] = number_or_null(value);
  return json;
}

inline Json json_of(const Spread& spread) {
  return {{"median", number_or_null(spread.median)},
          {"p99", number_or_null(spread.p99)},
          {"max", number_or_null(spread.max)}};
}

}  // namespace rhec::sim
