// The formats that are files or folders: written to memory, and read from there.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "fuzz/targets.hpp"
#include "plugins/host/elf_file.hpp"
#include "rhec/core/control/path.hpp"
#include "rhec/logs/files/open_log.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/logs/mapping/proposal.hpp"
#include "rhec/logs/mcap/mcap_log.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/signals/survey.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/kit/manifest.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/report/report.hpp"
#include "rhec/sim/store/slip_map_file.hpp"
#include "rhec/sim/store/sweep_runs.hpp"
#include "rhec/sim/world/paths.hpp"

namespace rhec::fuzz {
namespace {

namespace fs = std::filesystem;

/// A folder in memory, of this process, that is empty at first.
class Folder {
 public:
  explicit Folder(const std::string& name)
      : path_(fs::path(fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) /
              ("rhec_fuzz_" + std::to_string(getpid()) + "_" + name)) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path write(const std::string& name, std::string_view content) const {
    std::ofstream(path_ / name, std::ios::binary) << content;
    return path_ / name;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// All of a log, then a part of its topics, and none: what is not asked for is passed over.
void read_log(const logs::Log& log) {
  static_cast<void>(logs::survey(log));
  std::vector<bool> wanted(log.topics().size());
  for (std::size_t i = 1; i < wanted.size(); i += 2) wanted[i] = true;
  for (const bool more : {true, false}) {
    if (!more) wanted.assign(wanted.size(), false);
    answered([&] { static_cast<void>(log.read(wanted, [](const logs::Record&) { return true; })); });
  }
}

}  // namespace

void log(std::string_view input) {
  static const sim::LogScenario scenario(Host(), load_yaml(RHEC_SOURCE "/tests/fuzz/log.yaml"));
  static const Folder folder("log");
  const std::vector<Part> parts = parts_of(input);
  if (parts.size() != 2) return;
  answered([&] {
    static_cast<void>(sim::read_recorded_log(folder.write("dead_reckoning.csv", parts[0].content),
                                             folder.write("gps.csv", parts[1].content), scenario));
  });
}

void results(std::string_view input) {
  const Folder folder("results");
  constexpr std::array names{"steps.csv",      "times.csv",     "summary.json",
                             "horizons.jsonl", "estimates.csv", "comparison.json"};
  const std::vector<Part> parts = parts_of(input);
  for (const Part& part : parts)
    if (std::find(names.begin(), names.end(), part.name) != names.end()) folder.write(part.name, part.content);
  answered([&] { sim::report_document(folder.path(), "fuzz"); });
}

void sweep_store(std::string_view input) {
  const Folder folder("sweep_store");
  const fs::path file = folder.write("sweep.sqlite", input);
  answered([&] { static_cast<void>(sim::read_sweep_runs(file)); });
  answered([&] { sim::report_document(file, "fuzz"); });
}

void slip_map(std::string_view input) {
  const Folder folder("slip_map");
  const fs::path file = folder.write("map.sqlite", input);
  answered([&] { static_cast<void>(sim::read_slip_map(file)); });
}

void mcap(std::string_view input) {
  static const Folder folder("mcap");
  const fs::path file = folder.write("x.mcap", input);
  answered([&] { read_log(*logs::open_mcap(file)); });
}

void db3(std::string_view input) {
  static const Folder folder("db3");
  const fs::path file = folder.write("x.db3", input);
  answered([&] { read_log(*logs::open_db3(file)); });
}

void bag(std::string_view input) {
  const Folder folder("bag");
  const std::vector<Part> parts = parts_of(input);
  constexpr std::array names{"metadata.yaml", "0.db3", "1.mcap", "0.db3.zstd", "1.mcap.zstd"};
  for (const Part& part : parts)
    if (std::find(names.begin(), names.end(), part.name) != names.end()) folder.write(part.name, part.content);
  answered([&] { read_log(*logs::open_log(folder.path())); });
  for (const char* compressed : {"0.db3.zstd", "1.mcap.zstd"})
    answered([&] { read_log(*logs::open_log(folder.path() / compressed)); });
}

void waypoints(std::string_view input) {
  static const Folder folder("waypoints");
  const fs::path file = folder.write("path.csv", input);
  answered([&] {
    const Path path(sim::load_waypoints(file), {.acceleration = 1.0, .lateral_acceleration = 2.0});
    for (const double part : {-1.0, 0.0, 0.3, 1.0, 2.0}) {
      const PathPoint point = path.point_at(part * path.length());
      static_cast<void>(path.closest(point.x, point.y + 1.0, 0.0, path.length()));
    }
  });
}

void library(std::string_view input) {
  static const Folder folder("library");
  static_cast<void>(why_not_loadable(folder.write("x.so", input), kManifestSymbol, sizeof(ManifestHead)));
}

void signals(std::string_view input) {
  static const Folder folder("signals");
  const std::vector<Part> parts = parts_of(input);
  if (parts.size() != 2) return;
  ModelDescription about;
  about.outputs = {{"x_gps", "m", ""}, {"y_gps", "m", ""}, {"heading", "rad", ""}};
  about.inputs = {{"v", "m/s", ""}, {"omega", "rad/s", ""}};
  const fs::path file = folder.write("x.csv", parts[0].content);
  answered([&] {
    const auto log = logs::open_log(file);
    answered([&] { static_cast<void>(logs::propose_signals(logs::survey(*log), about)); });
    const logs::SignalMap map(parse_yaml(std::string(parts[1].content), "fuzz.yaml"), about);
    static_cast<void>(logs::read_drive(*log, map));
  });
}

}  // namespace rhec::fuzz
