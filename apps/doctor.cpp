#include "doctor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::apps {
namespace {

struct Finding {
  PluginRecord plugin;
  PluginTrial trial;  ///< if the plugin is accepted

  bool shadowed() const { return !plugin.used_instead.empty(); }
  bool failed() const { return plugin.accepted() && trial.outcome == PluginTrial::Outcome::failed; }
};

struct PlaceFindings {
  PluginPlace place;
  std::vector<Finding> findings;
};

struct Counts {
  int accepted = 0, not_used = 0, refused = 0, failed = 0;
};

bool is_called(const PluginRecord& plugin, const std::string& name) {
  return plugin.name == name || plugin.path.filename() == name || plugin.path.stem() == name;
}

std::vector<PlaceFindings> examine(const Host& host, const std::string& name) {
  std::vector<PlaceFindings> all;
  for (const PluginPlace& place : host.places()) {
    all.push_back({place, {}});
    for (PluginRecord& plugin : host.found_in(place)) {
      if (!name.empty() && !is_called(plugin, name)) continue;
      const PluginTrial trial = plugin.accepted() ? host.try_out(plugin) : PluginTrial();
      all.back().findings.push_back({std::move(plugin), trial});
    }
  }
  return all;
}

Counts count(const std::vector<PlaceFindings>& places) {
  Counts counts;
  for (const PlaceFindings& place : places) {
    for (const Finding& finding : place.findings) {
      ++(finding.plugin.accepted() ? counts.accepted : finding.shadowed() ? counts.not_used : counts.refused);
      if (finding.failed()) ++counts.failed;
    }
  }
  return counts;
}

[[noreturn]] void nothing_called(const std::string& name, const Host& host) {
  std::vector<std::string> known;
  for (const PluginRecord& plugin : host.discover()) {
    known.push_back(plugin.path.stem().string());
    if (!plugin.name.empty()) known.push_back(plugin.name);
  }
  throw unknown_plugin("no plugin and no file is called", name, known, host);
}

std::string origin_of(const PluginPlace& place) {
  if (place.origin == "given") return "--plugin-path";
  return place.origin == "installed" ? "beside the library" : place.origin;
}

std::string verdict_of(const Finding& finding) {
  return finding.plugin.accepted() ? "accepted" : finding.shadowed() ? "not used" : "refused";
}

std::string_view word_of(PluginTrial::Outcome outcome) {
  switch (outcome) {
    case PluginTrial::Outcome::made:
      return "made";
    case PluginTrial::Outcome::needs_options:
      return "needs options";
    case PluginTrial::Outcome::failed:
      return "failed";
  }
  return "";
}

/// Kind, name, version, licence and backend, as far as they are known.
std::string title_of(const PluginRecord& plugin) {
  std::string text = plugin.title();
  if (!plugin.licence.empty()) text += ", " + plugin.licence;
  if (!plugin.backend.empty()) text += ", by " + plugin.backend;
  if (!plugin.backend_version.empty()) text += " " + plugin.backend_version;
  return text;
}

/// Prints indented text below the line of a file; line breaks in it keep the indent.
void print_below(const std::string& text) {
  constexpr std::string_view margin = "            ";
  std::string line(margin);
  for (const char c : text) line += c == '\n' ? fmt::format("\n{}", margin) : std::string(1, c);
  fmt::print("{}\n", line);
}

void print(const Finding& finding) {
  const PluginRecord& plugin = finding.plugin;
  fmt::print("  {:<8}  {}{}\n", verdict_of(finding), plugin.path.filename().string(),
             plugin.name.empty() ? "" : ": " + title_of(plugin));
  if (!plugin.accepted()) {
    print_below(plugin.refusal);
    print_below("what to do: " + plugin.remedy);
  } else if (finding.trial.outcome == PluginTrial::Outcome::needs_options) {
    print_below("needs an option that has no default: " + finding.trial.text);
  } else if (finding.failed()) {
    print_below("but it fails: " + finding.trial.text);
  } else if (!finding.trial.text.empty()) {
    print_below(finding.trial.text);
  }
}

void print_places(const std::vector<PlaceFindings>& places, const std::string& name) {
  for (const PlaceFindings& each : places) {
    fmt::print("{} ({}){}\n", each.place.directory.empty() ? "''" : each.place.directory.string(),
               origin_of(each.place), each.place.skipped.empty() ? "" : ": not searched: " + each.place.skipped);
    if (!each.place.warning.empty()) fmt::print("  warning: {}\n", each.place.warning);
    for (const Finding& finding : each.findings) print(finding);
    if (each.findings.empty() && each.place.skipped.empty())
      fmt::print("  no file {}\n", name.empty() ? "that ends in .so" : fmt::format("or plugin called '{}'", name));
  }
  const Counts counts = count(places);
  std::string summary =
      fmt::format("{} accepted, {} not used, {} refused", counts.accepted, counts.not_used, counts.refused);
  if (counts.failed == 1) summary += "; 1 accepted plugin fails";
  if (counts.failed > 1) summary += fmt::format("; {} accepted plugins fail", counts.failed);
  fmt::print("\n{}\n", summary);
}

sim::Json as_json(const Finding& finding) {
  const PluginRecord& plugin = finding.plugin;
  sim::Json json{{"file", plugin.path.filename().string()}, {"verdict", verdict_of(finding)}};
  if (!plugin.name.empty()) {
    json["kind"] = std::string(word_of(plugin.kind));
    json["name"] = plugin.name;
    json["version"] = plugin.version;
    json["licence"] = plugin.licence;
    json["backend"] = plugin.backend;
    json["backend_version"] = plugin.backend_version;
  }
  if (plugin.accepted()) {
    json["trial"] = {{"outcome", std::string(word_of(finding.trial.outcome))}, {"text", finding.trial.text}};
  } else {
    json["reason"] = plugin.refusal;
    json["remedy"] = plugin.remedy;
  }
  if (finding.shadowed()) json["used_instead"] = plugin.used_instead.string();
  return json;
}

void print_places_json(const std::vector<PlaceFindings>& places) {
  sim::Json json{{"places", sim::Json::array()}};
  for (const PlaceFindings& each : places) {
    auto candidates = sim::Json::array();
    for (const Finding& finding : each.findings) candidates.push_back(as_json(finding));
    json["places"].push_back({{"directory", each.place.directory.string()},
                              {"origin", origin_of(each.place)},
                              {"searched", each.place.skipped.empty()},
                              {"why_not_searched", each.place.skipped},
                              {"warning", each.place.warning},
                              {"candidates", candidates}});
  }
  const Counts counts = count(places);
  json["accepted"] = counts.accepted;
  json["not_used"] = counts.not_used;
  json["refused"] = counts.refused;
  json["failed"] = counts.failed;
  fmt::print("{}\n", json.dump(2));
}

}  // namespace

Error unknown_plugin(const std::string& what, const std::string& name, const std::vector<std::string>& known,
                     const Host& host) {
  const std::string near = nearest(name, known);
  std::string diagnosis = host.diagnosis();
  diagnosis.erase(diagnosis.find_last_not_of('\n') + 1);
  return Error(fmt::format("{} '{}'{}\n{}", what, name,
                           near.empty() ? std::string() : fmt::format("; did you mean '{}'?", near), diagnosis));
}

int examine_plugins(const Host& host, const std::string& name, bool json) {
  const std::vector<PlaceFindings> places = examine(host, name);
  const bool found = std::any_of(places.begin(), places.end(), [](const auto& each) { return !each.findings.empty(); });
  if (!name.empty() && !found) nothing_called(name, host);
  if (json) {
    print_places_json(places);
  } else {
    print_places(places, name);
  }
  const Counts counts = count(places);
  return counts.not_used + counts.refused + counts.failed > 0 ? exit_not_solved : exit_fine;
}

}  // namespace rhec::apps
