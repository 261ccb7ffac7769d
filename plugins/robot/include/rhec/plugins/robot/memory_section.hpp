#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/place_memory.hpp"
#include "rhec/core/place/slip_map.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// Whose slip a map has, and where its origin is: what must agree for a map to be used.
struct MapIdentity {
  std::string vehicle;                         ///< of which vehicle, or kind of vehicles
  std::string model;                           ///< its model's name
  std::vector<std::string> parameters, units;  ///< of the model
  std::string frame = "local";                 ///< name of the coordinate system
  double origin_x = 0.0, origin_y = 0.0;       ///< the vehicle's x = y = 0 in it [m]
};

enum class MemoryKind { none, place };

/// The keys of `estimator.memory`.
struct RHEC_EXPORT MemoryOptions {
  MemoryKind name = MemoryKind::none;
  std::string file, vehicle, frame = MapIdentity{}.frame;
  std::vector<double> origin = {0.0, 0.0};
  std::optional<double> start;
  double cell = SlipMap::Setup{}.cell, reach = SlipMap::Setup{}.reach, visit = SlipMap::Setup{}.visit;
  double change = PlaceMemory::Setup{}.change, before = PlaceMemory::Setup{}.before;
  double spread = 0.005, least = 0.003, ageing = 0.02;
  int lag = PlaceMemory::Setup{}.lag, cells = 65536;
  static const OptionTable<MemoryOptions>& table();
};

/// `estimator.memory`: what an estimator remembers of places.
class RHEC_EXPORT MemorySection {
 public:
  MemorySection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static std::vector<OptionRow> rows();

  const MemoryOptions& options() const noexcept { return options_; }
  const Settings& section() const noexcept { return section_; }
  bool is_given() const noexcept { return options_.name != MemoryKind::none; }
  MapIdentity identity() const;
  /// An empty map for the model's parameters.
  std::shared_ptr<SlipMap> make_map() const;
  /// What a bank is told, with that map.
  PlaceMemory::Setup setup(std::shared_ptr<SlipMap> map) const;

 private:
  std::vector<double> of_width(double share) const;

  std::shared_ptr<const RobotContext> context_;
  Settings section_;
  MemoryOptions options_;
};

}  // namespace rhec
