#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "output.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/maps/map_export.hpp"

namespace rhec::apps {
namespace {

namespace fs = std::filesystem;

struct MapArguments {
  std::vector<std::string> files;
  std::string merged, ascii, geotiff;
  bool json = false;
};

/// What is known of a parameter over all cells.
struct ParameterFigures {
  std::string name;
  double least, mean, largest, median_sigma;
};

std::vector<ParameterFigures> figures_of(const sim::SlipMapContent& content) {
  std::vector<ParameterFigures> figures;
  for (std::size_t j = 0; j < content.identity.parameters.size() && !content.cells.empty(); ++j) {
    std::vector<double> means, sigmas;
    double sum = 0.0;
    for (const SlipMap::Cell& cell : content.cells) {
      means.push_back(cell.means[j]);
      sigmas.push_back(std::sqrt(cell.variances[j]));
      sum += cell.means[j];
    }
    std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2), sigmas.end());
    const auto [lowest, largest] = std::minmax_element(means.begin(), means.end());
    figures.push_back({content.identity.parameters[j], *lowest, sum / static_cast<double>(means.size()), *largest,
                       sigmas[sigmas.size() / 2]});
  }
  return figures;
}

void print_content(const sim::SlipMapContent& content, const fs::path& file) {
  const MapIdentity& identity = content.identity;
  fmt::print("{}: {} cells of {} m, of '{}' ({}), in '{}' from ({}, {})\n", file.string(), content.cells.size(),
             content.cell, identity.vehicle, identity.model, identity.frame, identity.origin_x, identity.origin_y);
  if (content.cells.empty()) return;
  double least = content.cells.front().time;
  std::int64_t visits = 0, values = 0;
  for (const SlipMap::Cell& cell : content.cells) {
    least = std::min(least, cell.time);
    visits += cell.visits;
    values += cell.values;
  }
  const double count = static_cast<double>(content.cells.size());
  fmt::print("{:.1f} visits and {:.1f} observations a cell, from {:.1f} s to {:.1f} s\n\n",
             static_cast<double>(visits) / count, static_cast<double>(values) / count, least, content.newest());
  fmt::print("{:<12} {:>8} {:>8} {:>8}   {:>16}\n", "PARAMETER", "LEAST", "MEAN", "LARGEST", "MEDIAN SIGMA");
  for (const ParameterFigures& each : figures_of(content))
    fmt::print("{:<12} {:>8.3f} {:>8.3f} {:>8.3f}   {:>16.4f}\n", each.name, each.least, each.mean, each.largest,
               each.median_sigma);
  fmt::print("\n");
}

sim::Json json_of(const sim::SlipMapContent& content, const fs::path& file) {
  const MapIdentity& identity = content.identity;
  sim::Json parameters = sim::Json::array();
  for (const ParameterFigures& each : figures_of(content))
    parameters.push_back({{"name", each.name},
                          {"least", each.least},
                          {"mean", each.mean},
                          {"largest", each.largest},
                          {"median_sigma", each.median_sigma}});
  return {{"file", file.string()},
          {"cells", content.cells.size()},
          {"cell", content.cell},
          {"vehicle", identity.vehicle},
          {"model", identity.model},
          {"frame", identity.frame},
          {"origin", std::vector<double>{identity.origin_x, identity.origin_y}},
          {"parameters", parameters}};
}

/// All files on one map: that of the first, with its frame and its lattice.
sim::SlipMapContent merged(const std::vector<sim::SlipMapContent>& contents, const std::vector<std::string>& files) {
  SlipMap::Setup setup;
  setup.parameters = std::max(static_cast<int>(contents.front().identity.parameters.size()), 1);
  setup.cell = contents.front().cell;
  setup.reach = setup.cell;
  setup.capacity = 1;
  for (const sim::SlipMapContent& content : contents) setup.capacity += content.cells.size();
  SlipMap map(setup);
  for (std::size_t i = 0; i < contents.size(); ++i)
    sim::merge_slip_map(contents[i], files[i], contents.front().identity, map);
  return {contents.front().identity, setup.cell, map.cells()};
}

int run_map(const MapArguments& arguments) {
  std::vector<sim::SlipMapContent> contents;
  for (const std::string& file : arguments.files) contents.push_back(sim::read_slip_map(file));
  const sim::SlipMapContent content = contents.size() == 1 ? contents.front() : merged(contents, arguments.files);
  sim::Json written = sim::Json::object();
  if (!arguments.merged.empty()) {
    sim::write_slip_map(arguments.merged, content);
    written["merged"] = arguments.merged;
  }
  for (const bool is_ascii : {true, false}) {
    const std::string& name = is_ascii ? arguments.ascii : arguments.geotiff;
    if (name.empty()) continue;
    sim::OutputFolder folder(name);
    for (std::size_t j = 0; j < content.identity.parameters.size(); ++j) {
      const std::string& parameter = content.identity.parameters[j];
      const sim::MapRaster raster = sim::raster_of(content, j, arguments.files.front());
      if (is_ascii) {
        folder.write(parameter + ".asc", sim::ascii_raster(raster, raster.means));
        folder.write(parameter + "_sigma.asc", sim::ascii_raster(raster, raster.sigmas));
      } else {
        sim::write_geotiff(folder.file(parameter + ".tif"), raster, content.identity.frame);
      }
    }
    folder.commit();
    written[is_ascii ? "ASCII rasters" : "GeoTIFF"] = folder.path().string();
  }
  if (arguments.json) {
    sim::Json maps = sim::Json::array();
    for (std::size_t i = 0; i < contents.size(); ++i) maps.push_back(json_of(contents[i], arguments.files[i]));
    fmt::print("{}\n", sim::Json({{"maps", maps}, {"written", written}}).dump(2));
    return exit_fine;
  }
  for (std::size_t i = 0; i < contents.size(); ++i) print_content(contents[i], arguments.files[i]);
  for (const auto& [what, place] : written.items())
    fmt::print("{}: {}{}\n", what, place.as_text(),
               what == "merged" ? fmt::format(" ({} cells)", content.cells.size()) : "");
  return exit_fine;
}

}  // namespace

void add_map(Program& program) {
  auto arguments = std::make_shared<MapArguments>();
  Command command = program.add("map", "Lists, merges and exports maps of slip, as estimator.memory.file keeps them.",
                                "Maps of one vehicle and one frame are merged; where two know a cell, their values are "
                                "weighed by their variances,\n"
                                "or the later one stays if they contradict each other.\n\n"
                                "Examples:\n"
                                "  rhec map field.sqlite\n"
                                "  rhec map monday.sqlite tuesday.sqlite --merge week.sqlite\n"
                                "  rhec map field.sqlite --ascii out/rasters --geotiff out/geotiff",
                                [arguments] { return run_map(*arguments); });
  command.add("files", arguments->files, "maps: SQLite files that estimators have written").value("FILE...").required();
  command.add("--merge", arguments->merged, "write all of them as one map").value("FILE");
  command.add("--ascii", arguments->ascii, "folder for Esri ASCII rasters: PARAMETER.asc and PARAMETER_sigma.asc")
      .value("DIR");
  command.add("--geotiff", arguments->geotiff, "folder for GeoTIFF: PARAMETER.tif, with bands for mean and sigma")
      .value("DIR");
  add_json(command, arguments->json);
}

}  // namespace rhec::apps
