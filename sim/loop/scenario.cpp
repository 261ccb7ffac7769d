#include "rhec/sim/loop/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/sim/world/paths.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::sim {
namespace {

struct PathOptions {
  enum class Name { figure8, zigzag, headland, file };
  Name name = Name::figure8;
  int laps = 2, legs = 6;
  double radius = 21.9, leg_length = 68.0, spacing = 0.1;
  int rows = 4;
  double row_length = 40.0, row_spacing = 3.0;
  std::optional<double> turn_radius;
  double acceleration = 1.0;
  std::optional<double> lateral_acceleration;
  double start = 0.0;
  std::string file;
};

struct TerrainOptions {
  enum class Name { gaussian, constant, patches, raster, split };
  Name name = Name::gaussian;
  double correlation_length = 10.0, period = 500.0, patch_size = 10.0;
  double lower = 0.5, upper = 1.0;
  std::optional<int> seed;
  Settings ranges, values;
  std::vector<std::string> files;
  RasterField::Interpolation interpolation = RasterField::Interpolation::bilinear;
  SplitField::Across across = SplitField::Across::x;
  double border = 0.0;
  Settings below, above;
};

const OptionTable<PathOptions>& path_table() {
  using P = PathOptions;
  static const auto rows =
      OptionTable<P>()
          .choice("name", &P::name,
                  {{"figure8", P::Name::figure8},
                   {"zigzag", P::Name::zigzag},
                   {"headland", P::Name::headland},
                   {"file", P::Name::file}},
                  "which path")
          .integer("laps", &P::laps, "of figure8", between(1, 1000))
          .number("radius", &P::radius, "of the circles of figure8 [m]", greater_than(0.0))
          .integer("legs", &P::legs, "of zigzag", between(1, 1000))
          .number("leg_length", &P::leg_length, "of zigzag [m]", greater_than(0.0))
          .integer("rows", &P::rows, "of headland", between(1, 1000))
          .number("row_length", &P::row_length, "of headland [m]", greater_than(0.0))
          .number("row_spacing", &P::row_spacing,
                  "of headland [m]; where it is less than two radii, the vehicle reverses in its turns",
                  greater_than(0.0))
          .optional_number("turn_radius", &P::turn_radius, "of zigzag (none: 9) and headland (none: 5) [m]",
                           between(1e-3, 1e6))
          .number("spacing", &P::spacing, "largest distance between waypoints [m]", greater_than(0.0))
          .text("file", &P::file, "of waypoints x, y (, speed, left, right), for path.name: file")
          .number("acceleration", &P::acceleration,
                  "with which speeds change along the path: a vehicle brakes in time for what comes [m/s^2]",
                  greater_than(0.0))
          .optional_number("lateral_acceleration", &P::lateral_acceleration,
                           "at most this in bends, where speeds are lowered for it; none: no limit [m/s^2]",
                           greater_than(0.0))
          .number("start", &P::start, "how far along the path the vehicle starts [m]", at_least(0.0));
  return rows;
}

constexpr double farthest_value = BoundsValue::farthest;

/// The values of constant terrain.
const NumbersByName& values_by_name() {
  static const NumbersByName map(
      "terrain values", {between(-farthest_value, farthest_value)},
      {{"PARAMETER",
        &ModelDescription::parameters,
        {"", [](const ModelDescription&, const Variable& parameter, std::size_t) { return parameter.nominal; }},
        "of constant; where nothing slips (1, or 0 of an angle)"}});
  return map;
}

const OptionTable<TerrainOptions>& terrain_table() {
  using T = TerrainOptions;
  static const auto rows =
      OptionTable<T>()
          .choice("name", &T::name,
                  {{"gaussian", T::Name::gaussian},
                   {"constant", T::Name::constant},
                   {"patches", T::Name::patches},
                   {"raster", T::Name::raster},
                   {"split", T::Name::split}},
                  "how the true parameters vary over the ground")
          .number("correlation_length", &T::correlation_length, "L of the gaussian field [m]", greater_than(0.0))
          .number("period", &T::period, "after which the gaussian field repeats itself [m]", greater_than(0.0))
          .number("patch_size", &T::patch_size, "of patches [m]", greater_than(0.0))
          .number("lower", &T::lower, "least value of gaussian and patches, of ratios (1 where nothing slips)",
                  between(-farthest_value, farthest_value))
          .number("upper", &T::upper, "largest value of gaussian and patches, of ratios",
                  between(-farthest_value, farthest_value))
          .optional_integer("seed", &T::seed, "of gaussian and patches; none: the scenario's", between(0, 2147483647))
          .map("ranges", &T::ranges,
               {{"PARAMETER", "[lower, upper]", "", "", "of gaussian and patches, in place of lower and upper"}})
          .map("values", &T::values, values_by_name().rows())
          .names("files", &T::files, "of raster: one a parameter")
          .choice(
              "interpolation", &T::interpolation,
              {{"bilinear", RasterField::Interpolation::bilinear}, {"nearest", RasterField::Interpolation::nearest}},
              "of raster")
          .choice("across", &T::across, {{"x", SplitField::Across::x}, {"y", SplitField::Across::y}},
                  "of split: the coordinate that decides")
          .number("border", &T::border, "of split: below is where that coordinate is less [m]", between(-1e9, 1e9))
          .subtree("below", &T::below, "of split: one of its two grounds, as a section terrain of its own")
          .subtree("above", &T::above, "of split: the other");
  return rows;
}

struct VehicleOptions {
  double step = TruthOptions{}.step;
  bool mechanical_stops = TruthOptions{}.mechanical_stops;
  Settings noise, actuators;
};

const NumbersByName& vehicle_noise_by_name() {
  static const NumbersByName map(
      "noise of the vehicle", {between(0.0, farthest_value)},
      {{"STATE", &ModelDescription::states, constant_default(0.0),
        "what disturbs it: white noise, by whose integral it strays in a second; per square root of a second. "
        "`noise.states` is what the estimator knows of it"}});
  return map;
}

const OptionTable<VehicleOptions>& vehicle_table() {
  using V = VehicleOptions;
  static const auto rows =
      OptionTable<V>()
          .number("step", &V::step, "integration step of the truth; on smooth ground it may take longer ones [s]",
                  between(1e-6, 1.0))
          .flag("mechanical_stops", &V::mechanical_stops, "bounded states cannot leave their bounds")
          .map("noise", &V::noise, vehicle_noise_by_name().rows())
          .map("actuators", &V::actuators,
               {{"INPUT", "map", "{}", "",
                 "lag, lower and upper of what the vehicle gets of it: see vehicle.actuators.INPUT"}});
  return rows;
}

/// A file named in a scenario is relative to the scenario; one named on the command line, to the working directory.
std::filesystem::path file_at(const Settings& named) {
  const std::filesystem::path given(named.as_text());
  const bool in_a_file = named.origin().line > 0;
  const std::filesystem::path folder = in_a_file ? std::filesystem::path(named.origin().file).parent_path() : "";
  if (std::filesystem::exists(folder / given)) return folder / given;
  throw named.error(
      fmt::format("found '{}', expected a file; there is no {}", given.string(), (folder / given).string()));
}

/// The key of a section; the section itself if it lacks the key.
const Settings& key_or_section(const Settings& section, std::string_view key) {
  const Settings* found = section.find(key);
  return found ? *found : section;
}

// A path or run beyond this indicates a wrong unit and would not fit into memory.
constexpr double most_waypoints = 2e6, most_samples = 1e6;

void require_few_waypoints(const Settings& section, double length, double spacing) {
  if (length / spacing <= most_waypoints) return;
  throw key_or_section(section, "spacing")
      .error(fmt::format("a path of {:.4g} m has a waypoint every {} m, more than {:g} of them; expected a larger "
                         "spacing, or a shorter path",
                         length, spacing, most_waypoints));
}

constexpr double least_way = 1e-6;  // [m]

/// A path of waypoints that lie in one place is none.
void require_a_way(const Settings& section, std::string_view size, const std::vector<Waypoint>& waypoints,
                   double spacing) {
  const auto apart = [&](const Waypoint& waypoint) {
    return std::hypot(waypoint.x - waypoints.front().x, waypoint.y - waypoints.front().y) >= least_way;
  };
  if (std::any_of(waypoints.begin(), waypoints.end(), apart)) return;
  const Settings* const place = section.find(size);
  throw(place ? *place : key_or_section(section, "spacing"))
      .error(
          fmt::format("the {} waypoints, {} m from each other at most, are all in one place; expected a longer path, "
                      "or a smaller path.spacing",
                      waypoints.size(), spacing));
}

std::vector<Waypoint> make_waypoints(const ScenarioOptions& options, const PathOptions& path) {
  struct {
    ZigZag zig_zag;
    Headland headland;
  } shape{
      .zig_zag = {.speed = options.speed, .legs = path.legs, .leg_length = path.leg_length, .spacing = path.spacing},
      .headland = {.speed = options.speed,
                   .rows = path.rows,
                   .row_length = path.row_length,
                   .row_spacing = path.row_spacing,
                   .point_spacing = path.spacing}};
  switch (path.name) {
    case PathOptions::Name::figure8:
      require_few_waypoints(options.path, path.laps * 4.0 * std::numbers::pi * path.radius, path.spacing);
      return figure_eight({options.speed, path.laps, path.radius, path.spacing});
    case PathOptions::Name::zigzag:
      shape.zig_zag.radius = path.turn_radius.value_or(shape.zig_zag.radius);
      require_few_waypoints(options.path, path.legs * (path.leg_length + std::numbers::pi * shape.zig_zag.radius),
                            path.spacing);
      return zig_zag(shape.zig_zag);
    case PathOptions::Name::headland:
      shape.headland.turn_radius = path.turn_radius.value_or(shape.headland.turn_radius);
      require_few_waypoints(options.path,
                            path.rows * (path.row_length + path.row_spacing + 6.0 * shape.headland.turn_radius),
                            path.spacing);
      return headland(shape.headland);
    case PathOptions::Name::file:
      if (path.file.empty())
        throw key_or_section(options.path, "name")
            .error("found 'file', but no path.file; expected there a CSV file of waypoints x, y (, speed)");
      return load_waypoints(file_at(*options.path.find("file")), {options.speed});
  }
  return {};
}

Path make_path(const ScenarioOptions& options) {
  const PathOptions path = path_table().parse(options.path, "path");
  std::vector<Waypoint> waypoints = make_waypoints(options, path);
  if (path.name != PathOptions::Name::file)
    require_a_way(options.path,
                  path.name == PathOptions::Name::figure8  ? "radius"
                  : path.name == PathOptions::Name::zigzag ? "leg_length"
                                                           : "row_length",
                  waypoints, path.spacing);
  return {waypoints,
          {.acceleration = path.acceleration, .lateral_acceleration = path.lateral_acceleration.value_or(infinity)}};
}

std::vector<SlipRange> slip_ranges(const TerrainOptions& terrain, const ModelDescription& about,
                                   const Settings& section) {
  check_keys(terrain.ranges, names_of(about.parameters), "terrain ranges");
  std::vector<SlipRange> ranges(about.parameters.size(), SlipRange{terrain.lower, terrain.upper});
  const bool varies = terrain.name == TerrainOptions::Name::gaussian || terrain.name == TerrainOptions::Name::patches;
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    const Variable& parameter = about.parameters[j];
    const Settings* pair = terrain.ranges.find(parameter.name);
    if (!pair && parameter.nominal != 1.0) {
      // The parameter is not a ratio: use part of its range. For angles, 0.5 to 1 rad would be unrealistic.
      ranges[j] = {0.5 * (parameter.nominal + parameter.lower), 0.5 * (parameter.nominal + parameter.upper)};
      if (varies && !(std::isfinite(ranges[j].lower) && std::isfinite(ranges[j].upper)))
        throw key_or_section(section, "ranges")
            .error(fmt::format("how far '{}' varies is not known, since the model gives it no bounds; expected [lower, "
                               "upper] under ranges.{}",
                               parameter.name, parameter.name));
    }
    if (pair) std::tie(ranges[j].lower, ranges[j].upper) = BoundsValue{}.read(*pair, {});
    if (pair && !(std::isfinite(ranges[j].lower) && std::isfinite(ranges[j].upper)))
      throw pair->mismatch("two finite numbers [lower, upper]");
  }
  return ranges;
}

std::unique_ptr<const SlipField> make_terrain(const Settings& section, int scenario_seed,
                                              const ModelDescription& about);

/// One of the grounds of a split one.
std::unique_ptr<const SlipField> make_side(const Settings& section, const char* key, int scenario_seed,
                                           const ModelDescription& about) {
  const Settings* const side = section.find(key);
  if (!side || side->is_null())
    throw key_or_section(section, "name")
        .error(fmt::format("found 'split', but no '{}' beside it; expected there the name and the options of a ground",
                           key));
  return make_terrain(*side, scenario_seed, about);
}

std::unique_ptr<const SlipField> make_terrain(const Settings& section, int scenario_seed,
                                              const ModelDescription& about) {
  const TerrainOptions terrain = terrain_table().parse(section, "terrain");
  if (!(terrain.lower <= terrain.upper))
    throw key_or_section(section, "lower")
        .error(fmt::format("lower is {} and upper is {}; expected lower <= upper", terrain.lower, terrain.upper));
  const std::vector<double> constant = values_by_name().read(terrain.values, about);
  const std::vector<SlipRange> ranges = slip_ranges(terrain, about, section);
  const auto seed = static_cast<std::uint64_t>(terrain.seed.value_or(scenario_seed));
  switch (terrain.name) {
    case TerrainOptions::Name::gaussian:
      try {
        return gaussian_random_field({seed, ranges, terrain.correlation_length, terrain.period});
      } catch (const Error& mistake) {
        const Settings* const period = section.find("period");
        throw(period ? *period : key_or_section(section, "correlation_length")).error(mistake.what());
      }
    case TerrainOptions::Name::patches:
      return patch_field({seed, ranges, terrain.patch_size});
    case TerrainOptions::Name::constant:
      return constant_field(constant);
    case TerrainOptions::Name::raster: {
      if (terrain.files.size() != about.parameters.size())
        throw key_or_section(section, "files")
            .error(fmt::format("{} raster files given; expected {}, one a parameter of the model", terrain.files.size(),
                               about.parameters.size()));
      RasterField raster;
      if (terrain.files.empty()) throw section.error("the model has no parameters; a raster has nothing to say");
      for (const Settings& file : section.find("files")->items()) raster.files.push_back(file_at(file));
      raster.interpolation = terrain.interpolation;
      return raster_field(raster);
    }
    case TerrainOptions::Name::split:
      return split_field({terrain.across, terrain.border, make_side(section, "below", scenario_seed, about),
                          make_side(section, "above", scenario_seed, about)});
  }
  return nullptr;
}

/// Files that are given to the wrong command say what they are.
void refuse_other_files(const Settings& settings) {
  struct {
    const char* key;
    const char* what;
  } constexpr others[] = {
      {"log", "is that of a recorded drive: this scenario is for 'rhec estimate', 'rhec smooth' and 'rhec tune'"},
      {"variants", "is that of a recorded drive: this scenario is for 'rhec estimate' and 'rhec smooth'"}};
  for (const auto& [key, what] : others)
    if (const Settings* found = settings.find(key)) throw found->error(what);
  refuse_what_is_no_scenario(settings);
}

ScenarioOptions parse_scenario(const Settings& settings) {
  refuse_other_files(settings);
  return ScenarioOptions::table().parse(settings, "scenario");
}

constexpr double slow_usual = 20.0;         // times the path's duration at the scenario's speed
constexpr double quickest_usual = 40.0;     // [m/s]
constexpr double most_acceleration = 20.0;  // of any ground vehicle, with a wide margin [m/s^2]
constexpr double most_turn = 1.0;           // in a step [rad]
constexpr double bends_too_sharp = 1.1;     // times what the vehicle can, for the roundness of waypoints
constexpr double share_that_counts = 0.1;   // of a path; corners of coarse waypoints are less
constexpr int most_places_looked_at = 2000;

/// Over places along the path, evenly: a number of what is there, that a share of the path exceeds.
template <class Number>
double exceeded_along(const Path& path, const Number& number) {
  const int count = std::clamp(static_cast<int>(path.length()), 10, most_places_looked_at);
  std::vector<double> numbers;
  numbers.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) numbers.push_back(number(path.point_at(path.length() * (i + 0.5) / count)));
  const auto place = numbers.begin() + static_cast<std::ptrdiff_t>((1.0 - share_that_counts) * count);
  std::nth_element(numbers.begin(), place, numbers.end());
  return *place;
}

/// How sharply a vehicle turns where nothing slips, with one of its states at a bound.
struct SharpestTurn {
  double curvature = 0.0;  ///< [1/m]; 0: not known
  int state = -1;
};

/// Of vehicles whose heading follows from a bounded state, such as a steering angle: one that an input turns at once,
/// or that nothing bounds, has none.
SharpestTurn sharpest_turn(const Model& model, const ModelDescription& about) {
  const Roles& roles = about.roles;
  if (roles.heading < 0) return {};
  const std::vector<double> parameters = nominal_values(about.parameters);
  std::vector<double> state(about.states.size(), 0.0), inputs(about.inputs.size(), 0.0), rates(about.states.size());
  model.straight_motion(1.0, parameters.data(), state.data(), inputs.data());
  const auto curvature = [&] {
    model.rates(state.data(), inputs.data(), parameters.data(), rates.data());
    const double speed = std::hypot(rates[roles.position_x], rates[roles.position_y]);
    return std::abs(rates[roles.heading]) / speed;
  };
  for (double& input : inputs) {
    const double before = input;
    input += 1e-3;
    const bool turns = curvature() > 0.0;
    input = before;
    if (turns) return {};
  }
  SharpestTurn sharpest;
  for (std::size_t j = 0; j < about.states.size(); ++j) {
    const Variable& variable = about.states[j];
    if (!std::isfinite(variable.lower) || !std::isfinite(variable.upper)) continue;
    const double before = state[j];
    for (const double bound : {variable.lower, variable.upper}) {
      state[j] = bound;
      if (const double bend = curvature(); std::isfinite(bend) && bend > sharpest.curvature)
        sharpest = {bend, static_cast<int>(j)};
    }
    state[j] = before;
  }
  return sharpest;
}

}  // namespace

const OptionTable<ScenarioOptions>& ScenarioOptions::table() {
  static const auto rows = [] {
    OptionTable<ScenarioOptions> table;
    table.text("name", &ScenarioOptions::name, "of the run, for titles")
        .number("speed", &ScenarioOptions::speed, "reference ground speed [m/s]", between(0.01, 100.0))
        .integer("seed", &ScenarioOptions::seed, "of terrain and noise", between(0, 2147483647))
        .subtree("path", &ScenarioOptions::path, "name: figure8 | zigzag | file, and its options")
        .subtree("terrain", &ScenarioOptions::terrain,
                 "name: gaussian | constant | patches | raster | split, and its options")
        .subtree("vehicle", &ScenarioOptions::vehicle, "the true vehicle: step, mechanical_stops, noise, actuators")
        .map("sensors", &ScenarioOptions::sensors,
             {{"OUTPUT", "map", "{}", "", "rate, phase and latency of a simulated sensor: see sensors.OUTPUT"}})
        .map("faults", &ScenarioOptions::faults, {{"", "list of maps", "[]", "", "what goes wrong: see faults"}});
    RobotOptions::add_to(table);
    return table;
  }();
  return rows;
}

namespace {

/// The keys of the table, and the one that load_scenario takes away.
std::vector<OptionRow> root_rows() {
  std::vector<OptionRow> rows = ScenarioOptions::table().schema();
  rows.push_back({"robot", "text", "", "a file",
                  "a robot's keys, from `step` on: as if they stood here, with what stands here put over them"});
  return rows;
}

}  // namespace

std::vector<OptionSection> scenario_sections() {
  std::vector<OptionSection> sections = {
      {"", "A scenario: a robot, and the world that it drives in.", root_rows()},
      {"path", "What the robot shall follow.", path_table().schema()},
      {"terrain", "The ground: the true parameters of the model as a function of position.", terrain_table().schema()},
      {"vehicle", "The vehicle as it really moves.", vehicle_table().schema()},
      {"vehicle.actuators.INPUT",
       "What an actuator makes of an input that it is asked for. What is measured of the input is what was asked for.",
       ActuatorOptions::table().schema()},
      {"sensors.OUTPUT", "When a simulated sensor measures, and when that arrives.", SensorTiming::table().schema()},
      {"faults", "A fault of the simulated sensors, stamps or wheels: one entry of the list, docs/faults.md.",
       FaultOptions::table().schema()},
  };
  for (OptionSection& section : robot_sections(scenario_estimators())) sections.push_back(std::move(section));
  return sections;
}

Scenario::Scenario(const Host& host, const Settings& settings)
    : options_(parse_scenario(settings)),
      robot_(host, options_, scenario_estimators()),
      path_(make_path(options_)),
      terrain_(make_terrain(options_.terrain, options_.seed, robot_.model()->description())) {
  const VehicleOptions vehicle = vehicle_table().parse(options_.vehicle, "vehicle");
  vehicle_ = {.step = vehicle.step, .mechanical_stops = vehicle.mechanical_stops};
  if (!vehicle.noise.is_null()) {
    vehicle_.noise = vehicle_noise_by_name().read(vehicle.noise, robot_.model()->description());
    vehicle_.seed = static_cast<std::uint64_t>(options_.seed);
  }
  const ModelDescription& about = robot_.model()->description();
  actuators_ = read_actuators(vehicle.actuators, about);
  sensor_timings_ = read_sensor_timings(options_.sensors, about);
  faults_ = read_faults(options_.faults, about);
  const double samples = path_.duration() / options_.step;
  if (!(samples >= 1.0 && samples <= most_samples))
    throw key_or_section(settings, "step")
        .error(
            fmt::format("a path of {:.4g} m that takes {:.4g} s has {:.4g} steps of {} s; expected between 1 and {:g}: "
                        "how long it takes is up to speed, to path.spacing of its waypoints, and to "
                        "path.acceleration and path.lateral_acceleration",
                        path_.length(), path_.duration(), samples, options_.step, most_samples));
  start_ = path_table().parse(options_.path, "path").start;
  if (!(start_ < path_.length()))
    throw key_or_section(options_.path, "start")
        .error(fmt::format("found {}, expected less than the path's length of {:.4g} m", start_, path_.length()));
  const PathPoint start = path_.point_at(start_);
  initial_state_ = Eigen::VectorXd::Zero(robot_.model()->state_count());
  robot_.model()->description().roles.place(start.x, start.y, start.heading, initial_state_.data());
}

std::vector<std::string> Scenario::notes() const {
  std::vector<std::string> notes = robot_.notes();
  const double quickest = path_.top_speed();
  if (quickest > quickest_usual)
    notes.push_back(fmt::format("speed: {:.4g} m/s is {:.0f} km/h; speeds are in m/s", quickest, 3.6 * quickest));
  const double usual_time = path_.length() / options_.speed;
  if (path_.duration() > slow_usual * usual_time)
    notes.push_back(
        fmt::format("path: {:.4g} m take {:.3g} s, {:.3g} steps, and at {:g} m/s they would take {:.3g} s; the speeds "
                    "of waypoints, path.lateral_acceleration or path.acceleration lower the speed so much",
                    path_.length(), path_.duration(), path_.duration() / options_.step, options_.speed, usual_time));
  const double acceleration = exceeded_along(
      path_, [](const PathPoint& point) { return point.speed * point.speed * std::abs(point.curvature); });
  if (acceleration > most_acceleration)
    notes.push_back(
        fmt::format("speed: in the bends of this path it is a lateral acceleration of {:.3g} m/s^2, which no vehicle "
                    "holds; lower the speed, widen the path, or set path.lateral_acceleration",
                    acceleration));
  const double turn = exceeded_along(
      path_, [this](const PathPoint& point) { return std::abs(point.speed * point.curvature) * robot_.step(); });
  if (turn > most_turn)
    notes.push_back(fmt::format(
        "step: in {} s the path turns by {:.2g} rad, which inputs that are constant for so long cannot follow; take a "
        "shorter step",
        robot_.step(), turn));
  const ModelDescription& about = robot_.bounded_description();
  const double bend = exceeded_along(path_, [](const PathPoint& point) { return std::abs(point.curvature); });
  if (const SharpestTurn most = sharpest_turn(*robot_.model(), about);
      most.state >= 0 && bend > bends_too_sharp * most.curvature)
    notes.push_back(
        fmt::format("path: it has bends of a radius of {:.3g} m; with '{}' at its bound the vehicle turns on {:.3g} m "
                    "where nothing slips, and leaves the path there",
                    1.0 / bend, about.states[static_cast<std::size_t>(most.state)].name, 1.0 / most.curvature));
  return notes;
}

}  // namespace rhec::sim
