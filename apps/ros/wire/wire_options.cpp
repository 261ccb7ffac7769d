#include "wire_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"

namespace rhec::apps::ros {
namespace {

/// How many bytes a distribution has for the id of an endpoint.
constexpr std::array<std::pair<const char*, std::size_t>, 7> distributions{
    {{"foxy", 24}, {"galactic", 24}, {"humble", 24}, {"iron", 16}, {"jazzy", 16}, {"kilted", 16}, {"rolling", 16}}};

}  // namespace

WireOptions wire_options(const RosOptions& options, const LiveArguments& arguments) {
  WireOptions wire;
  wire.domain = arguments.domain >= 0 ? static_cast<std::uint32_t>(arguments.domain) : domain_of_environment();
  wire.interface = arguments.interface.empty() ? options.interface : arguments.interface;
  wire.node = options.node;
  const char* const environment = std::getenv("ROS_DISTRO");
  const std::string distro = !arguments.distro.empty() ? arguments.distro : environment ? environment : "";
  if (distro.empty()) return wire;
  const auto found = std::ranges::find_if(distributions, [&](const auto& each) { return distro == each.first; });
  if (found == distributions.end()) {
    std::vector<std::string> names;
    names.reserve(distributions.size());
    for (const auto& [name, bytes] : distributions) names.emplace_back(name);
    throw Error(fmt::format("{}: found '{}', expected {}", arguments.distro.empty() ? "ROS_DISTRO" : "--ros-distro",
                            distro, one_of(names)));
  }
  wire.id_bytes = found->second;
  return wire;
}

}  // namespace rhec::apps::ros
