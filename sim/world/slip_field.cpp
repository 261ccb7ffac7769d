#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/world/slip_field.hpp"

namespace rhec::sim {
namespace {

class Constant final : public SlipField {
 public:
  explicit Constant(std::vector<double> values) : values_(std::move(values)) {}
  int channels() const noexcept override { return static_cast<int>(values_.size()); }
  bool is_smooth() const noexcept override { return true; }
  void look_up(double, double, double* values) const noexcept override {
    std::copy(values_.begin(), values_.end(), values);
  }

 private:
  std::vector<double> values_;
};

struct Grid {
  double origin_x, origin_y, cell_size;
  std::int64_t columns, rows;
  std::vector<double> values;  // row by row

  double at(std::int64_t row, std::int64_t column) const {
    return values[static_cast<std::size_t>(row * columns + column)];
  }

  double bilinear(double x, double y) const noexcept {
    const auto [column, right] = place((x - origin_x) / cell_size, columns);
    const auto [row, up] = place((y - origin_y) / cell_size, rows);
    const std::int64_t next_column = std::min(column + 1, columns - 1), next_row = std::min(row + 1, rows - 1);
    return (1.0 - up) * ((1.0 - right) * at(row, column) + right * at(row, next_column)) +
           up * ((1.0 - right) * at(next_row, column) + right * at(next_row, next_column));
  }

  double nearest(double x, double y) const noexcept {
    return at(place((y - origin_y) / cell_size + 0.5, rows).index,
              place((x - origin_x) / cell_size + 0.5, columns).index);
  }

 private:
  struct Place {
    std::int64_t index;
    double fraction;
  };
  static Place place(double coordinate, std::int64_t count) noexcept {
    const double inside = std::clamp(coordinate, 0.0, static_cast<double>(count - 1));
    const double whole = std::floor(inside);
    return {static_cast<std::int64_t>(whole), inside - whole};
  }
};

Grid load_grid(const std::filesystem::path& file) {
  // The header and the values have different numbers of columns, so they are parsed as two tables.
  const std::string text = read_text(file);
  const std::string name = file.string();
  std::size_t head_end = text.find('\n');
  head_end = head_end == std::string::npos ? head_end : text.find('\n', head_end + 1);
  if (head_end == std::string::npos) {
    throw Error(
        fmt::format("{}: no values; expected a line 'origin_x,origin_y,cell_size', a line with these three numbers, "
                    "and then the rows of the grid",
                    name));
  }
  const CsvTable head =
      parse_csv(std::string_view(text).substr(0, head_end), name, {.header = CsvHeader::required, .columns = 3});
  if (head.header != std::vector<std::string>{"origin_x", "origin_y", "cell_size"}) {
    throw Error(fmt::format("{}:1: the names are '{}'; expected 'origin_x,origin_y,cell_size'", name,
                            fmt::join(head.header, ",")));
  }
  if (head.rows() != 1 || std::isnan(head.at(0, 0)) || std::isnan(head.at(0, 1)) || !(head.at(0, 2) > 0.0)) {
    throw Error(
        fmt::format("{}:2: expected the numbers origin_x,origin_y,cell_size, with a cell size greater than 0", name));
  }
  const CsvTable body = parse_csv(std::string_view(text).substr(head_end + 1), name, {.first_line = 3});
  for (std::int64_t row = 0; row < body.rows(); ++row) {
    for (int column = 0; column < body.columns(); ++column) {
      if (std::isnan(body.at(row, column))) {
        throw Error(fmt::format("{}:{}: field {} is missing; a slip grid needs every value", name, body.line_of(row),
                                column + 1));
      }
    }
  }
  return {head.at(0, 0), head.at(0, 1), head.at(0, 2), body.columns(), body.rows(), body.values};
}

class Raster final : public SlipField {
 public:
  Raster(std::vector<Grid> grids, RasterField::Interpolation interpolation)
      : grids_(std::move(grids)), bilinear_(interpolation == RasterField::Interpolation::bilinear) {}
  int channels() const noexcept override { return static_cast<int>(grids_.size()); }
  void look_up(double x, double y, double* values) const noexcept override {
    for (const Grid& grid : grids_) *values++ = bilinear_ ? grid.bilinear(x, y) : grid.nearest(x, y);
  }

 private:
  std::vector<Grid> grids_;
  bool bilinear_;
};

class Split final : public SlipField {
 public:
  explicit Split(SplitField options) : sides_(std::move(options)) {}
  int channels() const noexcept override { return sides_.below->channels(); }
  void look_up(double x, double y, double* values) const noexcept override {
    const bool is_below = (sides_.across == SplitField::Across::x ? x : y) < sides_.border;
    (is_below ? sides_.below : sides_.above)->sample(x, y, values);
  }

 private:
  SplitField sides_;
};

}  // namespace

void SlipField::sample(double x, double y, double* values) const noexcept {
  constexpr double farthest = 1e9;
  if (std::abs(x) < farthest && std::abs(y) < farthest) {
    look_up(x, y, values);
  } else {
    std::fill_n(values, channels(), std::numeric_limits<double>::quiet_NaN());
  }
}

std::unique_ptr<const SlipField> constant_field(std::vector<double> values) {
  if (values.empty() || !std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); })) {
    throw Error("constant slip field: expected one finite value per parameter of the model");
  }
  return std::make_unique<Constant>(std::move(values));
}

std::unique_ptr<const SlipField> raster_field(const RasterField& options) {
  if (options.files.empty()) throw Error("raster slip field: no files; give one CSV file per parameter of the model");
  std::vector<Grid> grids;
  for (const std::filesystem::path& file : options.files) grids.push_back(load_grid(file));
  return std::make_unique<Raster>(std::move(grids), options.interpolation);
}

std::unique_ptr<const SlipField> split_field(SplitField options) {
  if (!options.below || !options.above) throw Error("split slip field: expected a field on each side of the border");
  if (options.below->channels() != options.above->channels()) {
    throw Error(fmt::format("split slip field: {} channel(s) below the border and {} above; expected as many",
                            options.below->channels(), options.above->channels()));
  }
  if (!std::isfinite(options.border)) {
    throw Error(fmt::format("split slip field: border is {}; expected a finite coordinate [m]", options.border));
  }
  return std::make_unique<Split>(std::move(options));
}

}  // namespace rhec::sim
