#include "rhec/core/place/slip_map.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

constexpr int numbers_of_value = 4;
constexpr double farthest = 1e9;  ///< from the origin, in cells
constexpr int most_parameters = 32;
/// Where cells side by side differ, at the edge of a patch, a value means little: so much of the variance between them
/// is added.
constexpr double roughness = 2.0;
constexpr std::size_t nowhere = std::numeric_limits<std::size_t>::max();

std::size_t hash_of(std::int32_t column, std::int32_t row) noexcept {
  // The finaliser of splitmix64 spreads neighbours over the table.
  std::uint64_t bits = static_cast<std::uint64_t>(static_cast<std::uint32_t>(column)) << 32U |
                       static_cast<std::uint64_t>(static_cast<std::uint32_t>(row));
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9U;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebU;
  return bits ^ (bits >> 31U);
}

}  // namespace

SlipMap::SlipMap(Setup setup) : setup_(std::move(setup)) {
  const auto require = [](bool holds, const char* name, double value, const char* expected) {
    if (!holds) throw Error(fmt::format("map of slip: {} is {}; expected {}", name, value, expected));
  };
  require(setup_.parameters >= 1 && setup_.parameters <= most_parameters, "the number of parameters", setup_.parameters,
          "1 to 32");
  require(setup_.cell > 0.0 && std::isfinite(setup_.cell), "cell", setup_.cell, "a positive length");
  require(setup_.capacity >= 1, "capacity", static_cast<double>(setup_.capacity), "1 cell or more");
  require(setup_.reach > 0.0 && setup_.reach <= 100.0 * setup_.cell, "reach", setup_.reach,
          "a positive length of at most 100 cells");
  require(setup_.visit >= 0.0, "visit", setup_.visit, "a length that is not negative");
  require(setup_.contradiction > 0.0, "contradiction", setup_.contradiction, "a positive number");
  const auto count = static_cast<std::size_t>(setup_.parameters);
  for (std::vector<double>* rates : {&setup_.spread, &setup_.ageing}) {
    if (rates->empty()) rates->assign(count, 0.0);
    if (rates->size() != count)
      throw Error(fmt::format("map of slip: {} rates given; expected {}, one a parameter", rates->size(), count));
    for (const double rate : *rates) require(rate >= 0.0, "a rate", rate, "0 or more");
  }
  // A hash table that is at most two thirds full.
  heads_.resize(std::bit_ceil(setup_.capacity + setup_.capacity / 2 + 1));
  mask_ = heads_.size() - 1;
  values_.assign(heads_.size() * count * numbers_of_value, 0.0);
}

void SlipMap::advance(double seconds, double metres) noexcept {
  if (std::isfinite(seconds) && seconds > 0.0) time_ += seconds;
  if (std::isfinite(metres)) way_ += std::abs(metres);
}

void SlipMap::begin_drive(double time) noexcept {
  way_ += 2.0 * setup_.visit + 1.0;
  for (std::size_t place = 0; place < heads_.size(); ++place)
    if (heads_[place].is_used) settle(place);
  if (std::isfinite(time)) time_ = time;
}

std::size_t SlipMap::find(std::int32_t column, std::int32_t row) const noexcept {
  std::size_t place = hash_of(column, row) & mask_;
  for (; heads_[place].is_used; place = (place + 1) & mask_)
    if (heads_[place].column == column && heads_[place].row == row) return place;
  return nowhere;
}

std::size_t SlipMap::find_or_insert(double x, double y) noexcept {
  const double column = std::floor(x / setup_.cell), row = std::floor(y / setup_.cell);
  if (!(std::abs(column) < farthest && std::abs(row) < farthest)) return nowhere;
  const auto c = static_cast<std::int32_t>(column), r = static_cast<std::int32_t>(row);
  if (const std::size_t known = find(c, r); known != nowhere) return known;
  if (size_ == setup_.capacity) return nowhere;
  std::size_t place = hash_of(c, r) & mask_;
  while (heads_[place].is_used) place = (place + 1) & mask_;
  heads_[place] = {};
  heads_[place].column = c;
  heads_[place].row = r;
  heads_[place].is_used = true;
  ++size_;
  return place;
}

/// Whether the visit that wrote the fresh values is over.
bool SlipMap::is_over(const Head& head) const noexcept { return way_ - head.fresh_way > setup_.visit; }

SlipMap::Value SlipMap::earlier(std::size_t place, int parameter) const noexcept {
  const double* v = values_.data() + (place * setup_.parameters + parameter) * numbers_of_value;
  return {v[0], v[1]};
}

/// The values of one visit to a cell have nearly the same errors: their weighted mean has the variance of one of them.
SlipMap::Value SlipMap::fresh(std::size_t place, int parameter) const noexcept {
  const double* v = values_.data() + (place * setup_.parameters + parameter) * numbers_of_value;
  return {v[3] / v[2], static_cast<double>(heads_[place].fresh) / v[2]};
}

SlipMap::Value SlipMap::fuse(int parameter, const Value& old, double age, const Value& other) const noexcept {
  const double rate = setup_.ageing[parameter], variance = old.variance + rate * rate * std::max(age, 0.0);
  const double difference = other.mean - old.mean, spread = setup_.spread[parameter];
  const double expected = variance + other.variance + spread * spread * setup_.cell;
  if (difference * difference > setup_.contradiction * expected) return other;
  const double share = variance / (variance + other.variance);
  return {old.mean + share * difference, share * other.variance};
}

SlipMap::Value SlipMap::fused(std::size_t place, int parameter, bool with_fresh) const noexcept {
  const Head& head = heads_[place];
  if (!with_fresh) return earlier(place, parameter);
  if (head.visits == 0) return fresh(place, parameter);
  return fuse(parameter, earlier(place, parameter), head.fresh_time - head.time, fresh(place, parameter));
}

/// Makes the present visit an earlier one.
void SlipMap::settle(std::size_t place) noexcept {
  Head& head = heads_[place];
  if (head.fresh == 0) return;
  for (int j = 0; j < setup_.parameters; ++j) {
    const Value value = fused(place, j, true);
    double* v = values_.data() + (place * setup_.parameters + j) * numbers_of_value;
    v[0] = value.mean;
    v[1] = value.variance;
    v[2] = v[3] = 0.0;
  }
  const double n = static_cast<double>(head.visits), count = static_cast<double>(head.fresh);
  head.x = (n * head.x + head.fresh_x / count) / (n + 1.0);
  head.y = (n * head.y + head.fresh_y / count) / (n + 1.0);
  head.time = std::max(head.time, head.fresh_time);
  ++head.visits;
  head.fresh = 0;
  head.fresh_x = head.fresh_y = 0.0;
}

bool SlipMap::look_up(double x, double y, double* means, double* variances) const noexcept {
  const int count = setup_.parameters;
  std::fill_n(means, count, 0.0);
  std::fill_n(variances, count, std::numeric_limits<double>::infinity());
  const double column = std::floor(x / setup_.cell), row = std::floor(y / setup_.cell);
  if (size_ == 0 || !(std::abs(column) < farthest && std::abs(row) < farthest)) return false;
  const auto cells = static_cast<std::int32_t>(std::ceil(setup_.reach / setup_.cell));
  const auto c = static_cast<std::int32_t>(column), r = static_cast<std::int32_t>(row);
  double total = 0.0;
  std::array<double, most_parameters> sums{}, squares{};
  // Until the end, the variances hold sums of weights.
  std::fill_n(variances, count, 0.0);
  for (std::int32_t i = r - cells; i <= r + cells; ++i) {
    for (std::int32_t k = c - cells; k <= c + cells; ++k) {
      const std::size_t place = find(k, i);
      if (place == nowhere) continue;
      const Head& head = heads_[place];
      const bool with_fresh = head.fresh > 0 && is_over(head);
      if (head.visits == 0 && !with_fresh) continue;
      const double n = static_cast<double>(head.visits), fresh_count = static_cast<double>(head.fresh);
      const double at_x = with_fresh ? (n * head.x + head.fresh_x / fresh_count) / (n + 1.0) : head.x;
      const double at_y = with_fresh ? (n * head.y + head.fresh_y / fresh_count) / (n + 1.0) : head.y;
      const double distance = std::hypot(at_x - x, at_y - y), share = distance / setup_.reach;
      if (!(share < 1.0)) continue;
      const double near = (1.0 - share * share) * (1.0 - share * share);
      const double age = time_ - (with_fresh ? std::max(head.time, head.fresh_time) : head.time);
      total += near;
      for (int j = 0; j < count; ++j) {
        const Value value = fused(place, j, with_fresh);
        const double rate = setup_.ageing[j], spread = setup_.spread[j];
        const double variance = value.variance + rate * rate * std::max(age, 0.0) + spread * spread * distance;
        const double weight = near / variance;
        means[j] += weight * value.mean;
        sums[j] += near * value.mean;
        squares[j] += near * value.mean * value.mean;
        variances[j] += weight;
      }
    }
  }
  for (int j = 0; j < count; ++j) {
    if (total > 0.0) {
      const double middle = sums[j] / total, between = std::max(0.0, squares[j] / total - middle * middle);
      means[j] /= variances[j];
      variances[j] = total / variances[j] + roughness * between;
    } else {
      variances[j] = std::numeric_limits<double>::infinity();
    }
  }
  return total > 0.0;
}

void SlipMap::add(double x, double y, const double* means, const double* variances) noexcept {
  for (int j = 0; j < setup_.parameters; ++j)
    if (!std::isfinite(means[j]) || !(variances[j] > 0.0) || !std::isfinite(variances[j])) return;
  const std::size_t place = find_or_insert(x, y);
  if (place == nowhere) {
    ++dropped_;
    return;
  }
  Head& head = heads_[place];
  if (is_over(head)) settle(place);
  for (int j = 0; j < setup_.parameters; ++j) {
    double* v = values_.data() + (place * setup_.parameters + j) * numbers_of_value;
    v[2] += 1.0 / variances[j];
    v[3] += means[j] / variances[j];
  }
  ++head.fresh;
  ++head.values;
  head.fresh_x += x;
  head.fresh_y += y;
  head.fresh_way = way_;
  head.fresh_time = time_;
}

std::vector<SlipMap::Cell> SlipMap::cells() const {
  std::vector<std::size_t> places;
  for (std::size_t place = 0; place < heads_.size(); ++place)
    if (heads_[place].is_used) places.push_back(place);
  std::sort(places.begin(), places.end(), [this](std::size_t a, std::size_t b) {
    return std::tie(heads_[a].row, heads_[a].column) < std::tie(heads_[b].row, heads_[b].column);
  });
  std::vector<Cell> all;
  all.reserve(places.size());
  for (const std::size_t place : places) {
    const Head& head = heads_[place];
    const bool with_fresh = head.fresh > 0;
    const double n = static_cast<double>(head.visits), count = static_cast<double>(head.fresh);
    Cell& cell = all.emplace_back();
    cell.x = with_fresh ? (n * head.x + head.fresh_x / count) / (n + 1.0) : head.x;
    cell.y = with_fresh ? (n * head.y + head.fresh_y / count) / (n + 1.0) : head.y;
    cell.time = with_fresh ? std::max(head.time, head.fresh_time) : head.time;
    cell.visits = head.visits + (with_fresh ? 1 : 0);
    cell.values = head.values;
    for (int j = 0; j < setup_.parameters; ++j) {
      const Value value = fused(place, j, with_fresh);
      cell.means.push_back(value.mean);
      cell.variances.push_back(value.variance);
    }
  }
  return all;
}

bool SlipMap::merge(const Cell& cell) noexcept {
  const std::size_t place = find_or_insert(cell.x, cell.y);
  if (place == nowhere) {
    ++dropped_;
    return false;
  }
  settle(place);
  Head& head = heads_[place];
  // The older of the two is what there was.
  const bool is_later = cell.time >= head.time;
  for (int j = 0; j < setup_.parameters; ++j) {
    double* v = values_.data() + (place * setup_.parameters + j) * numbers_of_value;
    const Value here{v[0], v[1]}, other{cell.means[j], cell.variances[j]};
    const Value value = head.visits == 0 ? other
                        : is_later       ? fuse(j, here, cell.time - head.time, other)
                                         : fuse(j, other, head.time - cell.time, here);
    v[0] = value.mean;
    v[1] = value.variance;
  }
  const double n = static_cast<double>(head.visits), m = static_cast<double>(std::max<std::int64_t>(cell.visits, 1));
  head.x = (n * head.x + m * cell.x) / (n + m);
  head.y = (n * head.y + m * cell.y) / (n + m);
  head.time = head.visits == 0 ? cell.time : std::max(head.time, cell.time);
  head.visits += std::max<std::int64_t>(cell.visits, 1);
  head.values += cell.values;
  return true;
}

}  // namespace rhec
