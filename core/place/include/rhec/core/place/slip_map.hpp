#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// A map of parameters over the ground: means and variances in the cells of a square lattice (docs/method.md, section
/// 9). It is written while a vehicle drives, and says what was found at a place on an earlier visit.
///
/// A visit's values of a cell are kept apart until the vehicle has gone on: until then they are the present estimate,
/// and not known from elsewhere. Visits are independent of each other, so their values are fused by their variances,
/// after those that were there have grown with their age. A value that contradicts what was there takes its place: the
/// ground has changed.
///
/// Allocates in its constructor only; no call throws or blocks. A cell beyond the capacity is dropped and counted.
class RHEC_EXPORT SlipMap {
 public:
  struct Setup {
    int parameters = 1;
    double cell = 0.5;               ///< side of a cell [m]
    std::size_t capacity = 1 << 16;  ///< cells
    double reach = 1.5;              ///< a cell says nothing of places farther away than this [m]
    /// By parameter: how its difference over the ground grows, a standard deviation per square root of a metre; it is
    /// what a value means beside the place where it was found.
    std::vector<double> spread;
    /// By parameter: how a value is forgotten, a standard deviation per square root of a second.
    std::vector<double> ageing;
    double visit = 20.0;         ///< way after which a cell is another visit's [m]
    double contradiction = 9.0;  ///< squared difference, in variances, from which on a value replaces what was there
  };
  /// Throws Error for numbers that are out of range or of a wrong count.
  explicit SlipMap(Setup setup);

  const Setup& setup() const noexcept { return setup_; }

  /// The drive goes on by this time [s] and way [m].
  void advance(double seconds, double metres) noexcept;
  /// The time of the present [s], on the clock of the cells' stamps.
  double time() const noexcept { return time_; }
  /// Starts another drive at this time: what the last one has written becomes an earlier visit's.
  void begin_drive(double time) noexcept;

  /// Mean and variance of every parameter at a place, from earlier visits; returns whether anything is known there.
  /// Neighbouring cells share their errors, so that several are no better than one of them.
  bool look_up(double x, double y, double* means, double* variances) const noexcept;

  /// A value of every parameter that was found at a place, on the present visit. Values that are not finite, and
  /// variances that are not positive, are left out.
  void add(double x, double y, const double* means, const double* variances) noexcept;

  /// One cell, with all its visits fused.
  struct Cell {
    double x = 0.0, y = 0.0;  ///< where the values were found, within the cell [m]
    double time = 0.0;        ///< of the last visit [s]
    std::int64_t visits = 0, values = 0;
    std::vector<double> means, variances;  ///< by parameter; at that time
  };
  /// In the order of rows and columns of the lattice.
  std::vector<Cell> cells() const;
  /// Fuses a cell of another map, or of a file, with what is here. Returns false if it is dropped.
  bool merge(const Cell& cell) noexcept;

  std::size_t size() const noexcept { return size_; }
  std::int64_t dropped() const noexcept { return dropped_; }

 private:
  struct Head {
    std::int32_t column = 0, row = 0;
    bool is_used = false;
    std::int64_t visits = 0, values = 0;                                     ///< earlier visits; all values
    double time = 0.0;                                                       ///< of earlier visits' last one
    double x = 0.0, y = 0.0;                                                 ///< mean place of earlier visits
    std::int64_t fresh = 0;                                                  ///< values of the present visit
    double fresh_way = 0.0, fresh_time = 0.0, fresh_x = 0.0, fresh_y = 0.0;  ///< its last; x and y are sums
  };
  /// A mean and variance of one cell.
  struct Value {
    double mean, variance;
  };
  std::size_t find(std::int32_t column, std::int32_t row) const noexcept;
  std::size_t find_or_insert(double x, double y) noexcept;
  bool is_over(const Head& head) const noexcept;
  Value earlier(std::size_t place, int parameter) const noexcept;
  Value fresh(std::size_t place, int parameter) const noexcept;
  Value fused(std::size_t place, int parameter, bool with_fresh) const noexcept;
  Value fuse(int parameter, const Value& old, double age, const Value& other) const noexcept;
  void settle(std::size_t place) noexcept;

  Setup setup_;
  std::vector<Head> heads_;     ///< a hash table with linear probing
  std::vector<double> values_;  ///< by cell and parameter: mean and variance of earlier visits; sums of weights and
                                ///< weighted values of the present one
  std::size_t size_ = 0, mask_ = 0;
  std::int64_t dropped_ = 0;
  double time_ = 0.0, way_ = 0.0;
};

}  // namespace rhec
