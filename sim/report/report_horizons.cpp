#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"

namespace rhec::sim {
namespace {

constexpr int version = 1;

[[noreturn]] void refuse(const std::filesystem::path& file, std::int64_t line, const std::string& what,
                         const std::string& maker) {
  throw Error(fmt::format("{}:{}: {}; take a copy that is whole, or make it again with '{}'", file.string(), line, what,
                          maker));
}

bool fell_back(const Json& record) {
  const auto of = [&](const char* key) {
    const Json& part = record.at(key);
    return part.is_object() && part.at("fallback").get<bool>();
  };
  return of("rhe") || of("rhc");
}

/// Entries first .. last of each column; null beyond the ends.
Json cut(const Json& columns, std::int64_t first, std::int64_t last) {
  Json parts = Json::array();
  for (const Json& column : columns) {
    Json part = Json::array();
    for (std::int64_t i = first; i <= last; ++i)
      part.push_back(i >= 0 && i < std::ssize(column) ? column[static_cast<std::size_t>(i)] : Json(nullptr));
    parts.push_back(std::move(part));
  }
  return parts;
}

/// The window, completed by data stored only once in the file: times and measurements of its nodes, and the ground
/// truth.
void complete_window(Json& window, const Json& nodes, const std::vector<std::vector<double>>& truth) {
  const auto first = window.at("first").get<std::int64_t>();
  const std::int64_t last = first + window.at("intervals").get<std::int64_t>();
  window.erase("intervals");
  Json times = Json::array();
  times.push_back(nodes.at("node_time"));
  window["time"] = cut(times, first, last)[0];
  window["measured"] = cut(nodes.at("output"), first, last);
  window["measured_input"] = cut(nodes.at("input"), first, last - 1);
  if (truth.empty()) return;
  Json& list = window["true"] = Json::array();
  for (const std::vector<double>& column : truth) {
    Json values = Json::array();
    for (std::int64_t i = first; i <= last; ++i)
      values.push_back(i < std::ssize(column) ? seen(column[static_cast<std::size_t>(i)], 5) : Json(nullptr));
    list.push_back(std::move(values));
  }
}

}  // namespace

HorizonFile read_horizons(const std::filesystem::path& file, const std::string& maker, const char* kind) {
  const std::string text = read_text(file);
  if (text.empty()) refuse(file, 1, "the file is empty", maker);
  std::string_view rest = text;
  std::int64_t number = 0;
  const auto next = [&]() -> Json {
    ++number;
    const std::size_t end = rest.find('\n');
    if (end == std::string_view::npos)
      refuse(file, number,
             rest.empty() ? "the file ends before this line, which should be there" : "the file ends within this line",
             maker);
    Json json = parse_json_line(rest.substr(0, end), file, number, maker);
    rest.remove_prefix(end + 1);
    return json;
  };
  HorizonFile horizons;
  horizons.head = next();
  if (horizons.head.value("form", "") != "rhec horizons") refuse(file, 1, "is not of the form 'rhec horizons'", maker);
  if (const Json found = horizons.head.value("version", Json()); found != version)
    refuse(file, 1, fmt::format("has version {}, and this program reads version {}", found.dump(), version), maker);
  if (const std::string found = horizons.head.value("kind", ""); found != kind)
    refuse(file, 1, fmt::format("is of a {}, and the other files of the folder are of a {}", found, kind), maker);
  for (std::size_t v = 0; v < member(horizons.head, "variants", file, maker).size(); ++v) {
    HorizonFile::Variant variant;
    variant.nodes = next();
    const std::int64_t count = variant.nodes.value("records", std::int64_t{-1});
    if (count < 0 || !variant.nodes.contains("node_time"))
      refuse(file, number, "expected the line of a variant's nodes", maker);
    for (std::int64_t i = 0; i < count; ++i) {
      const std::size_t before = rest.size();
      Json record = next();
      if (!record.contains("sample") || !record.contains("rhe") || !record.contains("rhc"))
        refuse(file, number, "expected a window, with the keys sample, rhe and rhc", maker);
      variant.bytes += before - rest.size();
      variant.records.push_back(std::move(record));
    }
    horizons.variants.push_back(std::move(variant));
  }
  if (!rest.empty()) refuse(file, number + 1, "there are more lines than the file should have", maker);
  return horizons;
}

Json horizons_of(const HorizonFile::Variant& variant, std::size_t samples, std::size_t most_bytes,
                 const std::vector<std::vector<double>>& truth, Json& notes) {
  if (variant.records.empty()) return nullptr;
  const std::size_t stride = std::max<std::size_t>(1, (variant.bytes + most_bytes - 1) / most_bytes);
  const auto in_file = static_cast<std::size_t>(variant.nodes.value("every", std::int64_t{1}));
  // If nearly all fell back, not all of these can be kept either.
  const auto failures = static_cast<std::size_t>(
      std::count_if(variant.records.begin(), variant.records.end(), [](const Json& r) { return fell_back(r); }));
  const bool all_failures_fit = failures * variant.bytes <= most_bytes * variant.records.size();
  Json list = Json::array();
  std::size_t estimation_horizon = 0, control_horizon = 0;
  for (std::size_t i = 0; i < variant.records.size(); ++i) {
    const bool of_every = stride == 1 || variant.records[i].at("sample").get<std::size_t>() % (stride * in_file) == 0;
    const bool is_last = i + 1 == variant.records.size();
    if (!of_every && !is_last && !(all_failures_fit && fell_back(variant.records[i]))) continue;
    Json record = variant.records[i];
    if (Json& window = record["rhe"]; window.is_object()) {
      estimation_horizon = std::max(estimation_horizon, window.at("intervals").get<std::size_t>());
      complete_window(window, variant.nodes, truth);
    }
    if (const Json& plan = record["rhc"]; plan.is_object())
      control_horizon = std::max(control_horizon, plan.at("reference").at("x").size() - 1);
    list.push_back(std::move(record));
  }
  const std::size_t every = in_file * stride;
  std::string how = every == 1 ? "every sample"
                               : fmt::format("every {} of {} samples",
                                             every == 2   ? std::string("2nd")
                                             : every == 3 ? std::string("3rd")
                                                          : fmt::format("{}th", every),
                                             counted(static_cast<std::int64_t>(samples)));
  if (every > 1)
    how += all_failures_fit ? ", and each whose solver's result could not be used"
                            : "; of those whose solver's result could not be used not all, since there are too many";
  if (every > 1) add_note(notes, "horizons", fmt::format("Horizons are shown for {}.", how));
  return {{"total", samples},
          {"kept", list.size()},
          {"how", how},
          {"estimation_horizon", estimation_horizon},
          {"control_horizon", control_horizon},
          {"list", std::move(list)}};
}

std::string thinning_words(const Thinned& thinned, std::size_t total, const char* what) {
  return fmt::format(
      "{}: {} of {} samples are drawn, of each stretch of {} those in which one of the curves is least or largest, so "
      "that extremes stay.",
      what, counted(std::ssize(thinned.rows)), counted(static_cast<std::int64_t>(total)),
      counted(static_cast<std::int64_t>(thinned.stretch)));
}

}  // namespace rhec::sim
