#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "log_page.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

/// Of a log with the vehicle's own sensors.
class DriveReport final : public LogPage {
 public:
  DriveReport(const fs::path& folder, const Json& summary)
      : LogPage(folder, summary),
        measured_(folder / "measurements.csv", log_maker),
        innovations_(folder / "innovations.csv", log_maker),
        predictions_(folder / "predictions.csv", log_maker) {
    find_variants();
    require_same_log({});
    const std::size_t first = table_.column("time") + 1;
    for (std::size_t i = first; i < table_.header().size() && !table_.header()[i].starts_with("sigma_"); ++i)
      names_.push_back(table_.header()[i]);
    states_ = horizons_ ? horizons_->head.at("model").at("states").size() : names_.size();
  }

 private:
  void find_variants() {
    const Json& variants = member(summary_, "variants", folder_ / "summary.json", log_maker);
    const std::size_t name = table_.column("variant");
    std::int64_t row = 0;
    for (const auto& [variant, numbers] : variants.items()) {
      Range range{row, row};
      while (row < table_.rows() && table_.text(row, name) == variant) ++row;
      range.end = row;
      std::int64_t expected = 0;
      for (const auto& [level, count] : member(numbers, "health", folder_ / "summary.json", log_maker).items())
        expected += count.get<std::int64_t>();
      if (row - range.first != expected)
        throw Error(fmt::format(
            "{}:{}: the rows of variant '{}' end after {} estimates, expected {} as summary.json "
            "says; take a copy that is whole, or make it again with '{}'",
            table_.file().string(), table_.line_of(row) - 1, variant, row - range.first, expected, log_maker));
      variants_.emplace_back(variant, range);
    }
    require_all_rows(row);
  }

  /// Positions as they were measured; null where nothing measures them.
  void fixes() override {
    document_["fixes"] = nullptr;
    document_["gaps"] = Json::array();
    const Json positions = horizons_ ? horizons_->head.at("model").at("position_outputs") : Json();
    if (positions.is_null()) return;
    const Json& outputs = horizons_->head.at("model").at("outputs");
    const auto name_of = [&](std::size_t i) {
      return outputs.at(positions.at(i).get<std::size_t>()).at("name").get<std::string>();
    };
    const std::vector<double> all_x = measured_.numbers(name_of(0)), all_y = measured_.numbers(name_of(1)),
                              all_times = measured_.numbers("time"), all_held = measured_.numbers("held_out");
    std::vector<double> times, x, y, held_out;
    for (std::size_t i = 0; i < all_x.size(); ++i) {
      if (std::isnan(all_x[i]) || std::isnan(all_y[i])) continue;
      times.push_back(all_times[i]);
      x.push_back(all_x[i]);
      y.push_back(all_y[i]);
      held_out.push_back(all_held[i]);
    }
    const Thinned thinned = thin({&x, &y}, times.size(), 2 * most_rows);
    document_["fixes"] = {{"total", times.size()},
                          {"kept", thinned.rows.size()},
                          {"time", column_of(times, thinned.rows)},
                          {"x", column_of(x, thinned.rows)},
                          {"y", column_of(y, thinned.rows)},
                          {"held_out", flags(held_out, thinned.rows)}};
    if (thinned.stretch > 1) add_note(notes_, "fixes", thinning_words(thinned, times.size(), "Fixes"));
    std::ranges::sort(times);  // they may have come late
    gaps_between(times);
  }

  Json variant(std::size_t index) override {
    const auto& [name, range] = variants_[index];
    std::vector<std::int64_t> rows;
    for (std::int64_t row = range.first; row < range.end; ++row) rows.push_back(row);
    const std::vector<double> times = column("time", rows);
    Json about = begin_variant(index, rows, times);
    findings(about, rows, times);
    innovations(about, name);
    predictions(about, name);
    statuses(about, index, times);
    fallbacks(about, rows, times);
    about["solve_times"] = {{"rhe", histogram(name)}};
    windows(about, index, rows.size());
    return about;
  }

  /// Spans in which the estimate was not ok.
  void findings(Json& about, const std::vector<std::int64_t>& rows, const std::vector<double>& times) const {
    const std::size_t health = table_.column("health");
    Json& list = about["findings"] = Json::array();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (table_.text(rows[i], health) == "ok") continue;
      std::size_t end = i;
      while (end + 1 < rows.size() && table_.text(rows[end + 1], health) != "ok") ++end;
      list.push_back({{"from", seen(times[i])}, {"to", seen(times[std::min(end + 1, rows.size() - 1)])}});
      i = end;
    }
  }

  /// The rows of a variant in another table.
  static std::vector<std::int64_t> rows_in(const ResultTable& table, const std::string& variant) {
    const std::size_t name = table.column("variant");
    std::vector<std::int64_t> rows;
    for (std::int64_t row = 0; row < table.rows(); ++row)
      if (table.text(row, name) == variant) rows.push_back(row);
    return rows;
  }

  /// Of each sensor the normalised innovations squared, and which were rejected.
  void innovations(Json& about, const std::string& name) {
    struct OfSensor {
      std::vector<double> times, nis, rejected;
    };
    const std::size_t time = innovations_.column("time"), sensor = innovations_.column("sensor"),
                      accepted = innovations_.column("accepted"), nis = innovations_.column("nis");
    std::map<std::string, OfSensor, std::less<>> by_sensor;
    for (const std::int64_t row : rows_in(innovations_, name)) {
      OfSensor& of = by_sensor[std::string(innovations_.text(row, sensor))];
      of.times.push_back(innovations_.number(row, time));
      of.nis.push_back(innovations_.number(row, nis));
      of.rejected.push_back(innovations_.text(row, accepted) == "0" ? 1.0 : 0.0);
    }
    Json& list = about["innovations"] = Json::array();
    const Json& numbers = summary_.at("variants").at(name).at("innovations");
    for (const auto& [of_name, of] : by_sensor) {
      const Thinned thinned = thin({&of.nis, &of.rejected}, of.times.size(), most_);
      const Json& told = member(numbers, of_name.c_str(), folder_ / "summary.json", log_maker);
      list.push_back({{"sensor", of_name},
                      {"used", told.at("used")},
                      {"rejected", told.at("rejected")},
                      {"mean", told.at("nis")},
                      {"expected", told.at("nis_expected")},
                      {"outputs", told.at("outputs")},
                      {"time", time_key(fmt::format("{} innovations of {}", name, of_name), of.times, thinned)},
                      {"values", column_of(of.nis, thinned.rows)},
                      {"is_rejected", flags(of.rejected, thinned.rows)}});
    }
    if (by_sensor.empty())
      add_note(notes_, "innovations",
               fmt::format("Nobody judged the measurements of variant {} (estimator.health.watch), so that there are "
                           "no innovations.",
                           name));
  }

  void predictions(Json& about, const std::string& name) {
    about["residuals"] = nullptr;
    std::vector<double> times, values;
    const std::size_t time = predictions_.column("time"), distance = predictions_.column("distance");
    for (const std::int64_t row : rows_in(predictions_, name)) {
      times.push_back(predictions_.number(row, time));
      values.push_back(predictions_.number(row, distance));
    }
    if (times.empty()) return;
    const Json& told = summary_.at("variants").at(name).at("held_out");
    const Thinned thinned = thin({&values}, times.size(), most_rows);
    about["residuals"] = {{"title", fmt::format("Withheld measurements of {}: distance from what was predicted",
                                                told.at("sensor").get<std::string>())},
                          {"caption", "In a replay of its own, which never saw them."},
                          {"time", time_key(name + " predictions", times, thinned)},
                          {"values", column_of(values, thinned.rows)},
                          {"held_out", flags(std::vector<double>(values.size(), 1.0), thinned.rows)}};
  }

  ResultTable measured_, innovations_, predictions_;
};

}  // namespace

Json drive_report(const fs::path& folder, const Json& summary) { return DriveReport(folder, summary).document(); }

}  // namespace rhec::sim
