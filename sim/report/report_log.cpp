#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

// A longer time without fixes is a gap [s].
constexpr double least_gap = 2.0;

/// The rows of one variant in estimates.csv.
struct Range {
  std::int64_t first = 0, end = 0;
};

class LogReport {
 public:
  LogReport(const fs::path& folder, const Json& summary)
      : folder_(folder), summary_(summary), table_(folder / "estimates.csv", log_maker), time_(table_.numbers("time")) {
    if (summary.is_object() && summary.contains("log") && summary.contains("signals"))
      throw Error(
          fmt::format("{}: is the estimation of a log with the vehicle's own sensors, of which there is no page yet; "
                      "expected one by --dead-reckoning and --gps; {} is its picture",
                      folder.string(), (folder / "run.svg").string()));
    find_variants();
    if (fs::exists(folder / "horizons.jsonl")) {
      horizons_ = read_horizons(folder / "horizons.jsonl", log_maker, "log");
      require_same_log();
    }
    if (fs::exists(folder / "times.csv")) times_.emplace(folder / "times.csv", log_maker);
    read_names();
  }

  Json document() {
    notes_ = Json::array();
    describe();
    const std::size_t curves = variants_.size() * (names_.size() + 2);
    most_ = std::clamp(most_values / curves, std::size_t{600}, most_rows);
    document_["times"] = Json::object();
    fixes();
    inputs();
    document_["variants"] = Json::array();
    for (std::size_t v = 0; v < variants_.size(); ++v) document_["variants"].push_back(variant(v));
    add_note(notes_, "truth",
             "Nobody knows what the vehicle and the ground really did, so there are no errors of states and "
             "slip; withheld fixes are what predictions can be held against.");
    add_note(notes_, "inputs", "Nothing was controlled: inputs are those that were measured, and there are no plans.");
    if (!words_.empty()) add_note(notes_, "samples", words_);
    document_["notes"] = std::move(notes_);
    return std::move(document_);
  }

 private:
  void find_variants() {
    const Json& variants = member(summary_, "variants", folder_ / "summary.json", log_maker);
    const std::size_t name = table_.column("variant"), held_out = table_.column("held_out");
    std::int64_t row = 0;
    for (const auto& [variant, numbers] : variants.items()) {
      Range range{row, row};
      std::int64_t nodes = 0;
      for (; row < table_.rows() && table_.text(row, name) == variant; ++row)
        nodes += table_.text(row, held_out) == "0";
      range.end = row;
      const auto expected = member(numbers, "nodes", folder_ / "summary.json", log_maker).get<std::int64_t>();
      if (nodes != expected)
        throw Error(
            fmt::format("{}:{}: the rows of variant '{}' end after {} nodes, expected {} as summary.json says; take a "
                        "copy that is whole, or make it again with '{}'",
                        table_.file().string(), table_.line_of(row) - 1, variant, nodes, expected, log_maker));
      variants_.emplace_back(variant, range);
    }
    if (row < table_.rows())
      throw Error(
          fmt::format("{}:{}: variant '{}' is not in summary.json; the two files are of different estimations: "
                      "make them again with '{}'",
                      table_.file().string(), table_.line_of(row), table_.text(row, name), log_maker));
    if (variants_.empty())
      throw Error(fmt::format("{}: variants: there is none; expected one at least; make it again with '{}'",
                              (folder_ / "summary.json").string(), log_maker));
  }

  void require_same_log() const {
    bool same = horizons_->variants.size() == variants_.size();
    for (std::size_t v = 0; same && v < variants_.size(); ++v) {
      const std::size_t nodes = horizons_->variants[v].nodes.at("node_time").size();
      const auto expected = summary_.at("variants").at(variants_[v].first).at("nodes").get<std::size_t>();
      same = horizons_->head.at("variants").at(v).value("name", "") == variants_[v].first &&
             (nodes == 0 || nodes == expected) && hold_out_is_same();
    }
    if (!same)
      throw Error(
          fmt::format("{}: is of another estimation than estimates.csv; make it again with '{}', or take the "
                      "file away (the report then does without horizons)",
                      (folder_ / "horizons.jsonl").string(), log_maker));
  }

  bool hold_out_is_same() const {
    const Json &one = horizons_->head.at("hold_out"), &other = summary_.at("hold_out");
    return one.at("every") == other.at("every") && one.at("phase") == other.at("phase");
  }

  void read_names() {
    const std::size_t first = table_.column("kind") + 1;
    for (std::size_t i = first; i < table_.header().size() && !table_.header()[i].starts_with("sigma_"); ++i)
      names_.push_back(table_.header()[i]);
    states_ = names_.size();
    if (horizons_) states_ = horizons_->head.at("model").at("states").size();
  }

  void describe() {
    document_["kind"] = "log";
    document_["title"] = summary_.value("name", folder_.filename().string());
    std::string list;
    for (const auto& [name, range] : variants_) list += (list.empty() ? "" : ", ") + name;
    document_["subtitle"] = list;
    if (horizons_) {
      document_["model"] = horizons_->head.at("model");
    } else {
      document_["model"] = nullptr;
      add_note(
          notes_, "horizons",
          "There is no horizons.jsonl, since an older program made this: windows, statuses, units and the names of "
          "what is slip are left out. Estimate again with this program to have them.");
    }
    document_["settings"] = {{"hold_out", summary_.value("hold_out", Json())}};
    document_["summary"] = summary_;
  }

  /// Their measured values on each interval, at its start; the same for all variants with recorded windows.
  void inputs() {
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

  /// A variant's rows with estimates at nodes, or those with fixes.
  template <class Function>
  std::vector<std::int64_t> rows_of(const Range& range, const Function& is_wanted) const {
    std::vector<std::int64_t> rows;
    for (std::int64_t row = range.first; row < range.end; ++row)
      if (is_wanted(row)) rows.push_back(row);
    return rows;
  }

  std::vector<double> column(std::string_view name, const std::vector<std::int64_t>& rows) const {
    const std::size_t index = table_.column(name);
    std::vector<double> values;
    values.reserve(rows.size());
    for (const std::int64_t row : rows) values.push_back(table_.number(row, index));
    return values;
  }

  std::vector<std::int64_t> fixes_of(const Range& range) const {
    const std::size_t kind = table_.column("kind");
    return rows_of(range, [&](std::int64_t row) { return table_.text(row, kind) == "fix"; });
  }

  static Json flags(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
    Json list = Json::array();
    for (const std::size_t row : rows) list.push_back(values[row] != 0.0 ? 1 : 0);
    return list;
  }

  Json time_key(const std::string& name, const std::vector<double>& times, const Thinned& thinned) {
    document_["times"][name] = column_of(times, thinned.rows);
    if (thinned.stretch > 1) words_ = thinning_words(thinned, times.size(), "Curves of the log");
    return name;
  }

  void fixes() {
    const std::vector<std::int64_t> rows = fixes_of(variants_.front().second);
    const std::vector<double> times = column("time", rows), x = column("fix_x", rows), y = column("fix_y", rows),
                              held_out = column("held_out", rows);
    const Thinned thinned = thin({&x, &y}, rows.size(), 2 * most_rows);
    Json fixes = {{"total", summary_.at("fixes").at("rows")}, {"kept", thinned.rows.size()}};
    fixes["time"] = column_of(times, thinned.rows);
    fixes["x"] = column_of(x, thinned.rows);
    fixes["y"] = column_of(y, thinned.rows);
    fixes["held_out"] = flags(held_out, thinned.rows);
    document_["fixes"] = std::move(fixes);
    if (thinned.stretch > 1) add_note(notes_, "fixes", thinning_words(thinned, rows.size(), "Fixes"));
    if (const auto unseen = summary_.at("fixes").at("rows").get<std::int64_t>() - std::ssize(rows); unseen > 0)
      add_note(notes_, "fixes",
               fmt::format("{} of {} fixes came before anything could be estimated, and are not shown.",
                           counted(unseen), counted(unseen + std::ssize(rows))));
    Json& gaps = document_["gaps"] = Json::array();
    for (std::size_t i = 1; i < times.size(); ++i)
      if (times[i] - times[i - 1] > least_gap) gaps.push_back({{"from", seen(times[i - 1])}, {"to", seen(times[i])}});
  }

  Json series(const std::string& variant, const std::string& name, const std::vector<std::int64_t>& rows,
              const std::vector<double>& times) {
    const std::vector<double> estimate = column(name, rows), sigma = column("sigma_" + name, rows);
    const Thinned thinned = thin({&estimate, &sigma}, rows.size(), most_);
    return {{"name", name},
            {"time", time_key(variant + " " + name, times, thinned)},
            {"estimate", column_of(estimate, thinned.rows)},
            {"sigma", column_of(sigma, thinned.rows)}};
  }

  Json variant(std::size_t index) {
    const auto& [name, range] = variants_[index];
    const std::size_t held_out = table_.column("held_out");
    const std::vector<std::int64_t> rows =
        rows_of(range, [&](std::int64_t row) { return table_.text(row, held_out) == "0"; });
    const std::vector<double> times = column("time", rows);
    const HorizonFile::Variant* kept = horizons_ ? &horizons_->variants[index] : nullptr;
    Json about = {{"name", name}};
    about["settings"] = horizons_ ? horizons_->head.at("variants").at(index).at("settings") : Json();
    about["samples"] = {{"total", rows.size()}, {"kept", std::min(rows.size(), most_)}};
    about["states"] = Json::array();
    about["parameters"] = Json::array();
    for (std::size_t j = 0; j < names_.size(); ++j)
      about[j < states_ ? "states" : "parameters"].push_back(series(name, names_[j], rows, times));
    track(about, name, rows, times);
    residuals(about, name, range);
    statuses(about, kept, rows, times);
    about["solve_times"] = {{"rhe", histogram(name)}};
    about["horizons"] = nullptr;
    if (kept) {
      Json notes = Json::array();
      const auto with_windows = static_cast<std::size_t>(std::count_if(
          horizons_->variants.begin(), horizons_->variants.end(), [](const auto& v) { return !v.records.empty(); }));
      about["horizons"] =
          horizons_of(*kept, rows.size(), most_horizon_bytes / std::max<std::size_t>(1, with_windows), {}, notes);
      if (about["horizons"].is_null())
        add_note(notes_, "horizons",
                 fmt::format("Variant {} is a filter or a smoother, which has no windows to show.", name));
      for (const Json& note : notes)
        add_note(notes_, "horizons", fmt::format("Variant {}: {}", name, note.at("text").get<std::string>()));
    }
    return about;
  }

  void track(Json& about, const std::string& name, const std::vector<std::int64_t>& rows,
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

  void residuals(Json& about, const std::string& name, const Range& range) {
    const std::vector<std::int64_t> rows = fixes_of(range);
    const std::vector<double> times = column("time", rows), values = column("residual", rows),
                              held_out = column("held_out", rows);
    const Thinned thinned = thin({&values}, rows.size(), most_rows);
    about["residuals"] = {{"time", time_key(name + " residuals", times, thinned)},
                          {"values", column_of(values, thinned.rows)},
                          {"held_out", flags(held_out, thinned.rows)}};
  }

  void statuses(Json& about, const HorizonFile::Variant* kept, const std::vector<std::int64_t>& rows,
                const std::vector<double>& times) {
    about["statuses"] = {{"rhe", nullptr}};
    if (kept && !kept->nodes.at("node_time").empty()) {
      const Json& all = kept->nodes.at("statuses");
      Json counts = Json::object();
      for (std::size_t i = 0; i < all.size(); ++i) {
        const auto from = all[i].at(0).get<std::int64_t>(),
                   to = i + 1 < all.size() ? all[i + 1].at(0).get<std::int64_t>() : std::ssize(rows);
        const auto status = all[i].at(2).get<std::string>();
        counts[status] = counts.value(status, std::int64_t{0}) + to - from;
      }
      Json changes = all;
      if (all.size() > most_status_changes) {
        changes = nullptr;
        add_note(notes_, "statuses",
                 fmt::format("The status of variant {} changes {} times, so that only how often there was which is "
                             "shown.",
                             about.at("name").get<std::string>(), counted(std::ssize(all))));
      }
      about["statuses"]["rhe"] = {{"counts", std::move(counts)}, {"changes", std::move(changes)}};
    }
    const std::vector<double> fallback = column("fallback", rows);
    Json list = Json::array();
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (fallback[i] != 0.0) list.push_back({i, seen(times[i])});
    about["fallbacks"] = {{"rhe", std::move(list)}};
  }

  Json histogram(const std::string& name) {
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

  fs::path folder_;
  const Json& summary_;
  ResultTable table_;
  std::vector<double> time_;
  std::vector<std::pair<std::string, Range>> variants_;
  std::optional<HorizonFile> horizons_;
  std::optional<ResultTable> times_;
  std::vector<std::string> names_;  ///< of states and parameters
  std::size_t states_ = 0;          ///< number of states among them
  std::size_t most_ = most_rows;
  Json document_, notes_;
  std::string words_;
};

}  // namespace

Json log_report(const fs::path& folder, const Json& summary) { return LogReport(folder, summary).document(); }

}  // namespace rhec::sim
