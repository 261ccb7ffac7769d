#include "rhec/sim/maps/map_keeper.hpp"

#include <system_error>
#include <utility>

namespace rhec::sim {
namespace fs = std::filesystem;

struct MapKeeper::Kept {
  fs::path file;
  MapIdentity identity;
  std::shared_ptr<SlipMap> map;
};

MapKeeper::MapKeeper() : kept_(std::make_unique<Kept>()) {}
MapKeeper::~MapKeeper() = default;

std::shared_ptr<SlipMap> MapKeeper::provide_map(const MemorySection& memory, std::shared_ptr<SlipMap> map) const {
  const MemoryOptions& options = memory.options();
  kept_->file = options.file;
  kept_->identity = memory.identity();
  kept_->map = map;
  double newest = 0.0;
  std::error_code ignored;
  if (!kept_->file.empty()) {
    if (fs::exists(kept_->file, ignored)) {
      const SlipMapContent content = read_slip_map(kept_->file);
      merge_slip_map(content, kept_->file, kept_->identity, *map);
      newest = content.newest();
    }
  }
  map->begin_drive(options.start.value_or(newest));
  return map;
}

void MapKeeper::save() const {
  if (!kept_->map || kept_->file.empty()) return;
  write_slip_map(kept_->file, {kept_->identity, kept_->map->setup().cell, kept_->map->cells()});
}

fs::path MapKeeper::file() const { return kept_->file; }
std::size_t MapKeeper::cells() const noexcept { return kept_->map ? kept_->map->size() : 0; }
std::int64_t MapKeeper::dropped() const noexcept { return kept_->map ? kept_->map->dropped() : 0; }

}  // namespace rhec::sim
