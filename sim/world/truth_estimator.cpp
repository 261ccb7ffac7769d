#include "rhec/sim/world/truth_estimator.hpp"

#include <memory>
#include <utility>

namespace rhec::sim {
namespace {

/// Reads the vehicle's true state and no measurements. There is no covariance.
class TruthEstimation final : public EstimationMethod {
 public:
  TruthEstimation(std::shared_ptr<const Model> model, int substeps, const TruthVehicle& vehicle)
      : model_(std::move(model)), substeps_(substeps), vehicle_(vehicle) {}
  const Model& model() const noexcept override { return *model_; }
  int substeps() const noexcept override { return substeps_; }
  void start(Measured) noexcept override {}
  void add(const MeasuredInterval&, Measured) noexcept override {}
  void estimate(Estimate& result, Clock::time_point) noexcept override {
    result.state = vehicle_.state();
    result.parameters = vehicle_.parameters();
    result.covariance.resize(0, 0);
    result.report = {};
    result.report.status = Status::solved;
    result.fallback = false;
  }
  void reset() noexcept override {}

 private:
  std::shared_ptr<const Model> model_;
  int substeps_;
  const TruthVehicle& vehicle_;
};

}  // namespace

EstimatorMakers scenario_estimators(const TruthVehicle* vehicle) {
  EstimatorMakers makers;
  makers.add({.name = "truth",
              .meaning = "what the simulation knows",
              .make = [vehicle](const EstimatorParts& parts) -> std::unique_ptr<EstimationMethod> {
                if (!vehicle)
                  throw parts.section.error("name: 'truth' is known to a simulation only; choose rhe or ekf");
                return std::make_unique<TruthEstimation>(parts.context->model, parts.substeps, *vehicle);
              },
              .is_watched = false});
  return makers;
}

}  // namespace rhec::sim
