#include "log_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

// A longer time without fixes is a gap [s].
constexpr double least_gap = 2.0;

}  // namespace

LogPage::LogPage(const fs::path& folder, const Json& summary)
    : folder_(folder), summary_(summary), table_(folder / "estimates.csv", log_maker) {
  if (fs::exists(folder / "horizons.jsonl")) horizons_ = read_horizons(folder / "horizons.jsonl", log_maker, "log");
  if (fs::exists(folder / "times.csv")) times_.emplace(folder / "times.csv", log_maker);
  notes_ = Json::array();
}

Json LogPage::document() {
  describe();
  fixes();
  inputs();
  document_["variants"] = Json::array();
  for (std::size_t v = 0; v < variants_.size(); ++v) document_["variants"].push_back(variant(v));
  add_note(notes_, "truth",
           "Nobody knows what the vehicle and the ground really did, so there are no errors of states and slip; what "
           "was withheld is what predictions can be held against.");
  add_note(notes_, "inputs", "Nothing was controlled: inputs are those that were measured, and there are no plans.");
  if (!words_.empty()) add_note(notes_, "samples", words_);
  document_["notes"] = std::move(notes_);
  return std::move(document_);
}

void LogPage::require_same_log(const std::vector<std::size_t>& nodes) const {
  if (!horizons_) return;
  bool same = horizons_->variants.size() == variants_.size();
  for (std::size_t v = 0; same && v < variants_.size(); ++v) {
    const std::size_t there = horizons_->variants[v].nodes.at("node_time").size();
    const Json &one = horizons_->head.at("hold_out"), &other = summary_.at("hold_out");
    same = horizons_->head.at("variants").at(v).value("name", "") == variants_[v].first &&
           (nodes.empty() || there == 0 || there == nodes[v]) && one.at("every") == other.at("every") &&
           one.at("phase") == other.at("phase");
  }
  if (!same)
    throw Error(
        fmt::format("{}: is of another estimation than estimates.csv; make it again with '{}', or take the "
                    "file away (the report then does without horizons)",
                    (folder_ / "horizons.jsonl").string(), log_maker));
}

void LogPage::require_all_rows(std::int64_t row) const {
  if (row < table_.rows())
    throw Error(fmt::format(
        "{}:{}: variant '{}' is not in summary.json; the two files are of different estimations: "
        "make them again with '{}'",
        table_.file().string(), table_.line_of(row), table_.text(row, table_.column("variant")), log_maker));
  if (variants_.empty())
    throw Error(fmt::format("{}: variants: there is none; expected one at least; make it again with '{}'",
                            (folder_ / "summary.json").string(), log_maker));
}

void LogPage::describe() {
  const std::size_t curves = variants_.size() * (names_.size() + 2);
  most_ = std::clamp(most_values / curves, std::size_t{600}, most_rows);
  document_["times"] = Json::object();
  document_["kind"] = "log";
  document_["title"] = summary_.value("name", folder_.filename().string());
  std::string list;
  for (const auto& [name, range] : variants_) list += (list.empty() ? "" : ", ") + name;
  document_["subtitle"] = list;
  if (horizons_) {
    document_["model"] = horizons_->head.at("model");
  } else {
    document_["model"] = nullptr;
    add_note(notes_, "horizons",
             "There is no horizons.jsonl, since an older program made this: windows, statuses, units and the names of "
             "what is slip are left out. Estimate again with this program to have them.");
  }
  document_["settings"] = {{"hold_out", summary_.value("hold_out", Json())}};
  document_["summary"] = summary_;
}

void LogPage::inputs() {
  Json& list = document_["inputs"] = Json::array();
  if (!horizons_) return;
  const auto kept = std::find_if(horizons_->variants.begin(), horizons_->variants.end(),
                                 [](const auto& variant) { return !variant.nodes.at("node_time").empty(); });
  if (kept == horizons_->variants.end()) return;
  const Json& variables = horizons_->head.at("model").at("inputs");
  for (std::size_t j = 0; j < variables.size(); ++j) {
    std::vector<double> values;
    for (const Json& value : kept->nodes.at("input").at(j))
      values.push_back(value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN());
    std::vector<double> times = kept->nodes.at("node_time").get<std::vector<double>>();
    times.resize(values.size());
    const std::string name = variables.at(j).at("name").get<std::string>();
    const Thinned thinned = thin({&values}, values.size(), most_);
    list.push_back({{"name", name},
                    {"time", time_key("input " + name, times, thinned)},
                    {"values", column_of(values, thinned.rows)},
                    {"lower", nullptr},
                    {"upper", nullptr}});
  }
}

void LogPage::gaps_between(const std::vector<double>& times) {
  Json& gaps = document_["gaps"] = Json::array();
  for (std::size_t i = 1; i < times.size(); ++i)
    if (times[i] - times[i - 1] > least_gap) gaps.push_back({{"from", seen(times[i - 1])}, {"to", seen(times[i])}});
}

std::vector<double> LogPage::column(std::string_view name, const std::vector<std::int64_t>& rows) const {
  const std::size_t index = table_.column(name);
  std::vector<double> values;
  values.reserve(rows.size());
  for (const std::int64_t row : rows) values.push_back(table_.number(row, index));
  return values;
}

Json LogPage::flags(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
  Json list = Json::array();
  for (const std::size_t row : rows) list.push_back(values[row] != 0.0 ? 1 : 0);
  return list;
}

Json LogPage::time_key(const std::string& name, const std::vector<double>& times, const Thinned& thinned) {
  document_["times"][name] = column_of(times, thinned.rows);
  if (thinned.stretch > 1) words_ = thinning_words(thinned, times.size(), "Curves of the log");
  return name;
}

Json LogPage::series(const std::string& variant, const std::string& name, const std::vector<std::int64_t>& rows,
                     const std::vector<double>& times) {
  const std::vector<double> estimate = column(name, rows), sigma = column("sigma_" + name, rows);
  const Thinned thinned = thin({&estimate, &sigma}, rows.size(), most_);
  return {{"name", name},
          {"time", time_key(variant + " " + name, times, thinned)},
          {"estimate", column_of(estimate, thinned.rows)},
          {"sigma", column_of(sigma, thinned.rows)}};
}

void LogPage::track(Json& about, const std::string& name, const std::vector<std::int64_t>& rows,
                    const std::vector<double>& times) {
  about["track"] = nullptr;
  if (!horizons_) return;
  const Json& roles = horizons_->head.at("model").at("roles");
  const int at_x = roles.value("position_x", -1), at_y = roles.value("position_y", -1);
  if (at_x < 0 || at_y < 0) return;
  const std::vector<double> x = column(names_[at_x], rows), y = column(names_[at_y], rows);
  const Thinned thinned = thin({&x, &y}, rows.size(), most_track_points / variants_.size());
  about["track"] = {{"x", column_of(x, thinned.rows)},
                    {"y", column_of(y, thinned.rows)},
                    {"time", time_key(name + " track", times, thinned)}};
}

Json LogPage::begin_variant(std::size_t index, const std::vector<std::int64_t>& rows,
                            const std::vector<double>& times) {
  const std::string& name = variants_[index].first;
  Json about = {{"name", name}};
  about["settings"] = horizons_ ? horizons_->head.at("variants").at(index).at("settings") : Json();
  about["samples"] = {{"total", rows.size()}, {"kept", std::min(rows.size(), most_)}};
  about["states"] = Json::array();
  about["parameters"] = Json::array();
  for (std::size_t j = 0; j < names_.size(); ++j)
    about[j < states_ ? "states" : "parameters"].push_back(series(name, names_[j], rows, times));
  track(about, name, rows, times);
  return about;
}

void LogPage::fallbacks(Json& about, const std::vector<std::int64_t>& rows, const std::vector<double>& times) {
  const std::vector<double> fallback = column("fallback", rows);
  Json list = Json::array();
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (fallback[i] != 0.0) list.push_back({i, seen(times[i])});
  about["fallbacks"] = {{"rhe", std::move(list)}};
}

void LogPage::statuses(Json& about, std::size_t index, const std::vector<double>& times) {
  about["statuses"] = {{"rhe", nullptr}};
  const HorizonFile::Variant* kept = horizons_ ? &horizons_->variants[index] : nullptr;
  if (!kept || kept->nodes.at("node_time").empty()) return;
  const Json& all = kept->nodes.at("statuses");
  // A change is at the time of a sample, as it is written.
  constexpr double rounding = 1e-6;
  const auto sample_at = [&](std::size_t change) {
    if (change == all.size()) return std::ssize(times);
    const auto at = std::ranges::lower_bound(times, all[change].at(1).get<double>() - rounding);
    return static_cast<std::ptrdiff_t>(at - times.begin());
  };
  Json counts = Json::object();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto status = all[i].at(2).get<std::string>();
    counts[status] = counts.value(status, std::int64_t{0}) + sample_at(i + 1) - sample_at(i);
  }
  Json changes = all;
  if (all.size() > most_status_changes) {
    changes = nullptr;
    add_note(notes_, "statuses",
             fmt::format("The status of variant {} changes {} times, so that only how often there was which is "
                         "shown.",
                         variants_[index].first, counted(std::ssize(all))));
  }
  about["statuses"]["rhe"] = {{"counts", std::move(counts)}, {"changes", std::move(changes)}};
}

void LogPage::windows(Json& about, std::size_t index, std::size_t samples) {
  about["horizons"] = nullptr;
  if (!horizons_) return;
  const std::string& name = variants_[index].first;
  Json notes = Json::array();
  const auto with_windows = static_cast<std::size_t>(std::count_if(
      horizons_->variants.begin(), horizons_->variants.end(), [](const auto& v) { return !v.records.empty(); }));
  about["horizons"] = horizons_of(horizons_->variants[index], samples,
                                  most_horizon_bytes / std::max<std::size_t>(1, with_windows), {}, notes);
  if (about["horizons"].is_null())
    add_note(notes_, "horizons",
             fmt::format("Variant {} is a filter or a smoother, which has no windows to show.", name));
  for (const Json& note : notes)
    add_note(notes_, "horizons", fmt::format("Variant {}: {}", name, note.at("text").get<std::string>()));
}

Json LogPage::histogram(const std::string& name) {
  if (!times_) {
    if (name == variants_.front().first)
      add_note(notes_, "times",
               "There is no times.csv, since an older program made this: how solve times are "
               "distributed is left out.");
    return nullptr;
  }
  const std::size_t variant = times_->column("variant"), us = times_->column("rhe_us");
  std::vector<double> times;
  for (std::int64_t row = 0; row < times_->rows(); ++row)
    if (times_->text(row, variant) == name) times.push_back(times_->number(row, us));
  const Json& numbers = summary_.at("variants").at(name);
  // A smoother solves once for all nodes.
  const std::int64_t count = std::ssize(times);
  if (count != numbers.at("nodes").get<std::int64_t>() && count != numbers.at("solves").get<std::int64_t>())
    throw Error(fmt::format(
        "{}:{}: has {} rows of variant '{}', expected {} as summary.json says; take a copy that is "
        "whole, or make it again with '{}'",
        times_->file().string(), times_->rows() + 1, times.size(), name, numbers.at("nodes").dump(), log_maker));
  Json histogram = times_histogram(times);
  if (!histogram.is_null()) histogram.update(numbers.at("solve_time_us"));
  return histogram;
}

}  // namespace rhec::sim
