#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/error.hpp"

// What the fuzzers feed with bytes: one function for each format that rhec reads. A function returns for whatever it is
// given; rhec::Error is an answer, any other exception is a fault.
namespace rhec::fuzz {

/// A configuration in YAML: every section of a scenario and of a log by its option table.
void configuration(std::string_view input);
/// A scenario in YAML, with all that it makes.
void scenario(std::string_view input);
/// A vehicle's equations in YAML.
void vehicle(std::string_view input);
/// A term's equations in YAML, with its options.
void term(std::string_view input);
/// A sweep in YAML, and its first and last runs.
void sweep(std::string_view input);
/// Problems as lines of JSON, and the problems that they describe.
void problems(std::string_view input);
/// A table of numbers.
void csv(std::string_view input);
/// A table of waypoints, and the path through them.
void waypoints(std::string_view input);
/// A recorded drive: dead reckoning and fixes, two tables.
void log(std::string_view input);
/// The folder of a run, an estimation or a comparison: steps.csv, summary.json, horizons.jsonl and others.
void results(std::string_view input);
/// A sweep's database.
void sweep_store(std::string_view input);
/// A map of slip.
void slip_map(std::string_view input);
/// A file that may be a plugin: what is looked at before it is loaded.
void library(std::string_view input);
/// What is kept of the examination of a plugin.
void verdict(std::string_view input);

/// A log in MCAP: its records, and the fields of its messages.
void mcap(std::string_view input);
/// A bag of rosbag2 in SQLite.
void db3(std::string_view input);
/// A bag of rosbag2 in a folder: parts that are metadata.yaml and its files, some of which are compressed.
void bag(std::string_view input);
/// A log in a table, and a section `signals`, two parts: what they are to a vehicle.
void signals(std::string_view input);
/// Definitions of messages, in both languages.
void message_definitions(std::string_view input);

/// A message in CDR, and the definition of its type, two parts.
void cdr(std::string_view input);
/// What a live node hears: a letter that says which of its readers, and a message.
void ros_messages(std::string_view input);
/// Measurements that a live node hears: parts that are topics, /fix, /imu, /odom or /joint_states.
void ros_intake(std::string_view input);

/// Calls it, and takes an Error for an answer.
template <class Call>
void answered(const Call& call) {
  try {
    call();
  } catch (const Error&) {
    return;
  }
}

struct Target {
  const char* name;
  void (*run)(std::string_view input);
};
inline const std::vector<Target>& targets() {
  static const std::vector<Target> all{{"configuration", configuration},
                                       {"scenario", scenario},
                                       {"vehicle", vehicle},
                                       {"term", term},
                                       {"sweep", sweep},
                                       {"problems", problems},
                                       {"csv", csv},
                                       {"waypoints", waypoints},
                                       {"log", log},
                                       {"results", results},
                                       {"sweep_store", sweep_store},
                                       {"slip_map", slip_map},
                                       {"library", library},
                                       {"verdict", verdict},
                                       {"mcap", mcap},
                                       {"db3", db3},
                                       {"bag", bag},
                                       {"signals", signals},
                                       {"message_definitions", message_definitions},
                                       {"cdr", cdr},
                                       {"ros_messages", ros_messages},
                                       {"ros_intake", ros_intake}};
  return all;
}

/// An input that stands for several files: each begins with a line "=== NAME".
struct Part {
  std::string name;
  std::string_view content;
};
inline std::vector<Part> parts_of(std::string_view input) {
  std::vector<Part> parts;
  constexpr std::string_view mark = "=== ";
  while (input.starts_with(mark)) {
    const std::size_t line = input.find('\n');
    if (line == std::string_view::npos) break;
    const std::string name(input.substr(mark.size(), line - mark.size()));
    input.remove_prefix(line + 1);
    std::size_t end = input.starts_with(mark) ? 0 : input.find("\n=== ");
    if (end == std::string_view::npos)
      end = input.size();
    else if (end > 0)
      ++end;
    parts.push_back({name, input.substr(0, end)});
    input.remove_prefix(end);
  }
  return parts;
}

}  // namespace rhec::fuzz
