#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "log_page.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

/// Of dead reckoning and fixes.
class LogReport final : public LogPage {
 public:
  LogReport(const fs::path& folder, const Json& summary) : LogPage(folder, summary) {
    find_variants();
    std::vector<std::size_t> nodes;
    for (const auto& [name, range] : variants_)
      nodes.push_back(summary_.at("variants").at(name).at("nodes").get<std::size_t>());
    require_same_log(nodes);
    read_names();
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
    require_all_rows(row);
  }

  void read_names() {
    const std::size_t first = table_.column("kind") + 1;
    for (std::size_t i = first; i < table_.header().size() && !table_.header()[i].starts_with("sigma_"); ++i)
      names_.push_back(table_.header()[i]);
    states_ = names_.size();
    if (horizons_) states_ = horizons_->head.at("model").at("states").size();
  }

  /// A variant's rows with estimates at nodes, or those with fixes.
  template <class Function>
  std::vector<std::int64_t> rows_of(const Range& range, const Function& is_wanted) const {
    std::vector<std::int64_t> rows;
    for (std::int64_t row = range.first; row < range.end; ++row)
      if (is_wanted(row)) rows.push_back(row);
    return rows;
  }

  std::vector<std::int64_t> fixes_of(const Range& range) const {
    const std::size_t kind = table_.column("kind");
    return rows_of(range, [&](std::int64_t row) { return table_.text(row, kind) == "fix"; });
  }

  void fixes() override {
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
    gaps_between(times);
  }

  Json variant(std::size_t index) override {
    const auto& [name, range] = variants_[index];
    const std::size_t held_out = table_.column("held_out");
    const std::vector<std::int64_t> rows =
        rows_of(range, [&](std::int64_t row) { return table_.text(row, held_out) == "0"; });
    const std::vector<double> times = column("time", rows);
    Json about = begin_variant(index, rows, times);
    residuals(about, name, range);
    statuses(about, index, times);
    fallbacks(about, rows, times);
    about["solve_times"] = {{"rhe", histogram(name)}};
    windows(about, index, rows.size());
    return about;
  }

  void residuals(Json& about, const std::string& name, const Range& range) {
    const std::vector<std::int64_t> rows = fixes_of(range);
    const std::vector<double> times = column("time", rows), values = column("residual", rows),
                              held_out = column("held_out", rows);
    const Thinned thinned = thin({&values}, rows.size(), most_rows);
    about["residuals"] = {{"title", "Distance of the antenna from each fix"},
                          {"caption", "By the estimate; of a fix that was withheld, by the prediction of it."},
                          {"time", time_key(name + " residuals", times, thinned)},
                          {"values", column_of(values, thinned.rows)},
                          {"held_out", flags(held_out, thinned.rows)}};
  }
};

}  // namespace

Json log_report(const fs::path& folder, const Json& summary) { return LogReport(folder, summary).document(); }

}  // namespace rhec::sim
