#pragma once

#include <cstdint>
#include <memory>

#include "rhec/core/estimation/place_bank.hpp"
#include "rhec/core/estimation/place_smoother.hpp"
#include "rhec/core/place/slip_ahead.hpp"

namespace rhec {

/// What a bank of filters remembers of places: it writes a map of the parameters with hindsight, uses what earlier
/// visits have left there, and tells a controller what is ahead (docs/method.md, section 9).
class RHEC_EXPORT PlaceMemory final : public SlipAhead {
 public:
  struct Setup {
    std::shared_ptr<SlipMap> map;  ///< written to, and read
    double change = PlaceBank::Setup{}.change;
    double before = PlaceBank::Setup{}.before;
    double ahead = 10.0;  ///< over which the difference from the map is forgotten, for what is ahead [m]
    int lag = PlaceSmoother::Setup{}.lag;
    /// Least standard deviation of the map, by parameter.
    std::vector<double> least;
  };
  /// The filters' set-up is that of the bank. Throws Error if sizes do not match.
  PlaceMemory(const std::shared_ptr<const Model>& model, const PriorBank& bank, const PriorBank::Setup& filters,
              int late_nodes, Setup setup);

  /// How many nodes the bank's history has to keep, with what was filtered.
  static int remembered_nodes(const Setup& setup, int late_nodes) noexcept;

  void reset() noexcept;
  /// A node was added to the history.
  void add_node(BankHistory& history) noexcept;
  /// The nodes from this number on have changed.
  void amend(const BankHistory& history, std::int64_t from) noexcept { places_.follow(history, from); }
  /// The history's newest nodes have been taken back.
  void rewind(const BankHistory& history) noexcept { smoother_.rewind(history.newest()); }
  /// The drive has ended: the map gets what it lacks.
  void finish(BankHistory& history) noexcept;
  void fuse(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept { places_.fuse(mean, covariance); }

  const PlaceBank& places() const noexcept { return places_; }
  const SlipMap& map() const noexcept { return *setup_.map; }
  void change(const double* here, const double* there, double distance, const double* parameters,
              double* change) const noexcept override;

 private:
  Setup setup_;
  int np_;
  PlaceBank places_;
  PlaceSmoother smoother_;
  /// The newest node that the map has advanced to.
  struct Advanced {
    std::int64_t number = -1;
    double duration = 0.0, distance = 0.0;
  } advanced_;
  mutable std::vector<double> here_, there_, variances_;
};

}  // namespace rhec
