#pragma once

#include <string>
#include <vector>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// What a log says of some fields of a topic.
struct Rows {
  std::vector<Stamp> stamps, received;
  std::vector<std::vector<double>> values;
  std::optional<Damage> damage;
};

inline Rows rows_of(const Log& log, const std::string& topic, const FieldRequest& request) {
  const int index = log.topic(topic);
  const auto reader = log.reader(index, request);
  std::vector<bool> wanted(log.topics().size());
  wanted[static_cast<std::size_t>(index)] = true;
  Rows rows;
  std::vector<double> values(request.fields.size());
  std::optional<Damage> undecoded;
  rows.damage = log.read(wanted, [&](const Record& record) {
    try {
      rows.stamps.push_back(reader->read(record, values.data()));
      rows.received.push_back(record.received);
      rows.values.push_back(values);
    } catch (const RecordError& error) {
      undecoded = log.damage_at(record, error);
      return false;
    }
    return true;
  });
  if (undecoded) rows.damage = undecoded;
  return rows;
}

}  // namespace rhec::logs
