#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/sim/store/slip_map_file.hpp"

namespace rhec::sim {

/// Hooks that keep an estimator's map in the file that its configuration names (`estimator.memory.file`): it is read
/// when the estimator is made, and written by `save`.
class RHEC_EXPORT MapKeeper final : public RobotHooks {
 public:
  MapKeeper();
  ~MapKeeper() override;
  /// Throws Error if the file cannot be used for this vehicle; a file that does not exist is an empty map.
  std::shared_ptr<SlipMap> provide_map(const MemorySection& memory, std::shared_ptr<SlipMap> map) const override;

  /// Writes the map, once the drive has ended. Does nothing where no estimator was made that remembers places, or where
  /// it has no file.
  void save() const;
  /// The file; empty if there is none.
  std::filesystem::path file() const;
  /// Cells on the map now, and values that found no room.
  std::size_t cells() const noexcept;
  std::int64_t dropped() const noexcept;

 private:
  struct Kept;
  std::unique_ptr<Kept> kept_;
};

}  // namespace rhec::sim
