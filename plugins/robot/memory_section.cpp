#include "rhec/plugins/robot/memory_section.hpp"

#include <cmath>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/prior/prior_options.hpp"
#include "rhec/plugins/robot/memory_need.hpp"

namespace rhec {
namespace {

constexpr double seconds_a_day = 86400.0;

/// A name alone stands for a map with that name.
Settings as_map(const Settings& section) {
  if (section.kind() != Settings::Kind::scalar) return section;
  Settings map = Settings::map();
  map.add("name", section);
  return map;
}

}  // namespace

const OptionTable<MemoryOptions>& MemoryOptions::table() {
  using M = MemoryOptions;
  static const auto rows =
      OptionTable<M>()
          .choice(
              "name", &M::name, {{"none", MemoryKind::none}, {"place", MemoryKind::place}},
              "of bank, and of rhe with priors: place writes a map of the parameters while it drives, and uses what "
              "earlier visits have left there; the name may stand alone")
          .text(
              "file", &M::file,
              "the map's file: read where it exists, and written at the end of the drive; none: the map lasts as long "
              "as the drive")
          .text("vehicle", &M::vehicle, "whose slip it is: a map of another one is refused; empty: the model's name")
          .text("frame", &M::frame, "name of the coordinate system, e.g. EPSG:25833")
          .numbers("origin", &M::origin, "x, y of the estimator's origin in that system [m]")
          .optional_number("start", &M::start,
                           "time of the start of the drive, for the age of what is known [s since 1970]; none: right "
                           "after the map's last entry")
          .number("cell", &M::cell, "side of the map's cells [m]", greater_than(0.0))
          .number("reach", &M::reach, "farthest that a cell says something of a place [m]", greater_than(0.0))
          .number("visit", &M::visit, "a place that was left by this way counts as another visit's [m]", at_least(0.0))
          .number("change", &M::change, "ground over which the map may cease to hold, or begin to [m]",
                  greater_than(0.0))
          .number("before", &M::before, "probability that the map holds, before a drive has told",
                  {.lower = 0.0, .upper = 0.999, .lower_is_open = true})
          .number(
              "spread", &M::spread,
              "standard deviation by which a parameter differs at a place a metre away, relative to the width of its "
              "bounds",
              at_least(0.0))
          .number("least", &M::least, "standard deviation that the map has at least, relative to that width",
                  at_least(0.0))
          .number(
              "ageing", &M::ageing,
              "standard deviation by which a value is forgotten in a day, relative to that width; it grows with the "
              "square root of time",
              at_least(0.0))
          .integer("lag", &M::lag, "nodes over which values are smoothed before they are written", between(2, 2000))
          .integer("cells", &M::cells, "that the map has room for", between(1, 100000000));
  return rows;
}

MemorySection::MemorySection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)),
      section_(section),
      options_(MemoryOptions::table().parse(as_map(section), "estimator: memory")) {
  if (options_.origin.size() != 2 || !std::isfinite(options_.origin[0]) || !std::isfinite(options_.origin[1])) {
    const Settings* origin = section_.find("origin");
    throw(origin ? *origin : section_).mismatch("two finite numbers [x, y]");
  }
  if (options_.vehicle.empty()) options_.vehicle = context_->about.name;
  if (!is_given()) return;
  const Roles& roles = context_->about.roles;
  if (context_->about.parameters.empty() || roles.position_x < 0 || roles.position_y < 0)
    throw section_.error(fmt::format("a memory of places needs a model with parameters and a position; '{}' is none",
                                     context_->about.name));
  try {
    make_map();  // reports mistakes now
  } catch (const std::bad_alloc&) {
    const Settings* const cells = section_.find("cells");
    throw(cells ? *cells : section_)
        .error(fmt::format("there is not enough memory for a map of {} cells: {:.3g} GB are free; expected fewer cells",
                           options_.cells, free_memory() / 1e9));
  }
}

std::vector<OptionRow> MemorySection::rows() { return MemoryOptions::table().schema(); }

MapIdentity MemorySection::identity() const {
  MapIdentity identity;
  identity.vehicle = options_.vehicle;
  identity.model = context_->about.name;
  for (const Variable& parameter : context_->about.parameters) {
    identity.parameters.push_back(parameter.name);
    identity.units.push_back(parameter.unit);
  }
  identity.frame = options_.frame;
  identity.origin_x = options_.origin[0];
  identity.origin_y = options_.origin[1];
  return identity;
}

std::vector<double> MemorySection::of_width(double share) const {
  std::vector<double> values;
  for (const Variable& parameter : context_->about.parameters)
    values.push_back(share * ParameterRange(parameter).width);
  return values;
}

std::shared_ptr<SlipMap> MemorySection::make_map() const {
  SlipMap::Setup setup;
  setup.parameters = static_cast<int>(context_->about.parameters.size());
  setup.cell = options_.cell;
  setup.capacity = static_cast<std::size_t>(options_.cells);
  setup.reach = options_.reach;
  setup.visit = options_.visit;
  setup.spread = of_width(options_.spread);
  setup.ageing = of_width(options_.ageing / std::sqrt(seconds_a_day));
  try {
    return std::make_shared<SlipMap>(std::move(setup));
  } catch (const Error& mistake) {
    throw section_.error(mistake.what());
  }
}

PlaceMemory::Setup MemorySection::setup(std::shared_ptr<SlipMap> map) const {
  PlaceMemory::Setup setup;
  setup.map = std::move(map);
  setup.change = options_.change;
  setup.before = options_.before;
  setup.lag = options_.lag;
  setup.least = of_width(options_.least);
  return setup;
}

}  // namespace rhec
