#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// What there is of one number in a log.
struct FieldSurvey {
  std::string name;
  std::int64_t count = 0;          ///< values that are not missing
  double least = 0.0, most = 0.0;  ///< of them
  double first = 0.0, last = 0.0;
  bool is_rising = true;  ///< each is larger than the one before
  std::string unit = {};  ///< where the log says it: see Log::unit_of
};

/// What there is of one topic.
struct TopicSurvey {
  Topic topic;
  std::int64_t count = 0;
  Stamp first = no_stamp, last = no_stamp;  ///< when records were measured
  double usual_interval = 0.0;              ///< median of the intervals between them [s]; 0 of fewer than two records
  double longest_gap = 0.0;                 ///< [s]
  double gap_start = 0.0;                   ///< [s] since the first record of the log
  double largest_lateness = 0.0;            ///< between measured and received [s]
  std::int64_t backwards = 0;               ///< records with a stamp before that of the one before them
  std::vector<FieldSurvey> fields;
  std::int64_t broken = 0;   ///< messages that cannot be read
  std::string first_broken;  ///< where the first of them is, and what is wrong with it
  std::string unreadable;    ///< why nothing is known of its fields, or of when they were measured; empty: all is
};

struct Survey {
  std::vector<TopicSurvey> topics;
  Stamp first = no_stamp, last = no_stamp;  ///< when records were received
  std::optional<Damage> damage;
};

/// Reads a whole log once. The fields of a topic are those of its first record.
RHEC_EXPORT Survey survey(const Log& log);

}  // namespace rhec::logs
