#include "rhec/plugins/robot/memory_need.hpp"

#include <sys/resource.h>
#ifdef RHEC_HAS_MALLINFO2
#include <malloc.h>
#endif

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <new>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

constexpr double kibibyte = 1024.0;
/// Two measurements of the same agree but for small pieces that the allocator keeps.
constexpr double agreement = 0.01;
constexpr int agreeing = 3, most_attempts = 20;
/// An interval takes about as much as so many rooms for measurements.
constexpr double own_rooms = 64.0;
/// Rooms of all intervals together that take some ten megabytes with any vehicle: nothing to ask about.
constexpr double surely_little = 100 * (own_rooms + 64);
/// Of the intervals with which it is measured.
constexpr double few_rooms = 32 * (own_rooms + 64);
constexpr int most_few = 32, least_few = 2;

/// What the process holds of the heap [bytes]; 0 where the allocator does not tell (as a sanitizer's).
double allocated() {
#ifdef RHEC_HAS_MALLINFO2
  const struct mallinfo2 now = mallinfo2();
  return static_cast<double>(now.uordblks) + static_cast<double>(now.hblkhd);
#else
  return 0.0;
#endif
}

/// What stands behind `name` in a file of lines such as "MemFree:   123 kB" [bytes].
std::optional<double> kibibytes_of(const char* file, std::string_view name) {
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(name) || line.size() <= name.size() || line[name.size()] != ':') continue;
    const std::size_t first = line.find_first_of("0123456789");
    if (first == std::string::npos) return {};
    double number = 0.0;
    if (std::from_chars(line.data() + first, line.data() + line.size(), number).ec != std::errc()) return {};
    return kibibyte * number;
  }
  return {};
}

/// The only number in a file; none where there is no such file, or a word in it ("max": no limit).
std::optional<double> number_in(const std::filesystem::path& file) {
  std::ifstream text(file);
  double number = 0.0;
  if (!(text >> number)) return {};
  return number;
}

/// Of the control group of this process and those around it (cgroup v2).
double left_by_groups() {
  double left = infinity;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with("0::/")) continue;
    const std::filesystem::path root = "/sys/fs/cgroup";
    for (std::filesystem::path group = line.substr(4);; group = group.parent_path()) {
      const std::optional<double> most = number_in(root / group / "memory.max"),
                                  used = number_in(root / group / "memory.current");
      if (most && used) left = std::min(left, std::max(0.0, *most - *used));
      if (group.empty()) break;
    }
  }
  return left;
}

/// Of a limit of the process, of which it uses what /proc/self/status says.
template <class Resource>
double left_of(Resource resource, const char* used_name) {
  struct rlimit limit {};
  if (getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return infinity;
  const double used = kibibytes_of("/proc/self/status", used_name).value_or(0.0);
  return std::max(0.0, static_cast<double>(limit.rlim_cur) - used);
}

/// One measurement: of `few` intervals and of twice as many.
MemoryNeed measure_once(const std::function<std::shared_ptr<const void>(int)>& make, int few) {
  const auto taken = [&](int intervals) {
    const double before = allocated();
    const std::shared_ptr<const void> made = make(intervals);
    return allocated() - before;
  };
  const double once = taken(few), twice = taken(2 * few);
  const double by_interval = (twice - once) / few;
  return {by_interval, once - by_interval * few};
}

}  // namespace

std::optional<MemoryNeed> measure_memory_need(const std::function<std::shared_ptr<const void>(int intervals)>& make,
                                              int few) {
  if (!(allocated() > 0.0)) return {};
  MemoryNeed last = measure_once(make, few);
  for (int attempt = 1, alike = 1; attempt < most_attempts; ++attempt) {
    const MemoryNeed now = measure_once(make, few);
    const double difference = std::abs(now.by_interval - last.by_interval);
    last = now;
    alike = now.by_interval > 0.0 && difference <= agreement * now.by_interval ? alike + 1 : 1;
    if (alike == agreeing) return now;
  }
  return {};
}

double free_memory() {
  double left = left_by_groups();
  if (const std::optional<double> available = kibibytes_of("/proc/meminfo", "MemAvailable"))
    left = std::min(left, *available + kibibytes_of("/proc/meminfo", "SwapFree").value_or(0.0));
  left = std::min(left, left_of(RLIMIT_AS, "VmSize"));
  return std::min(left, left_of(RLIMIT_DATA, "VmData"));
}

void require_memory(const Settings& place, const MemoryQuestion& question,
                    const std::function<std::shared_ptr<const void>(int intervals)>& make) {
  const double rooms = own_rooms + question.rooms;
  if (question.intervals * rooms <= surely_little) return;
  const std::string each = question.rooms_key.empty() ? std::string()
                                                      : fmt::format(", with room for {} measurements in each ({})",
                                                                    question.rooms, question.rooms_key);
  const char* const or_less = question.rooms_key.empty() ? "" : ", or less room";
  std::optional<MemoryNeed> need;
  for (int few = std::clamp(static_cast<int>(few_rooms / rooms), least_few, most_few); !need; few *= 2) {
    if (2 * few >= question.intervals) return;
    try {
      need = measure_memory_need(make, few);
      if (!need) return;
    } catch (const Error&) {  // of a horizon that is too short for what is asked beside it
    } catch (const std::bad_alloc&) {
      throw place.error(
          fmt::format("{} intervals{} take more memory than the {:.3g} GB that are free, and so do {}; expected fewer "
                      "intervals{}",
                      question.intervals, each, free_memory() / 1e9, 2 * few, or_less));
    }
  }
  const double all = need->of(question.intervals), left = free_memory();
  if (all <= left) return;
  throw place.error(fmt::format(
      "{} intervals of {:.3g} kB{} take {:.3g} GB of memory, and {:.3g} GB are free; expected at most {:.0f} intervals"
      "{}",
      question.intervals, need->by_interval / 1e3, each, all / 1e9, left / 1e9,
      std::max(0.0, std::floor((left - need->beside) / need->by_interval)), or_less));
}

}  // namespace rhec
