#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report_parts.hpp"
#include "rhec/sim/maps/map_export.hpp"

namespace rhec::sim {
namespace {

/// A raster for the page, whose rows begin in the south.
Json raster_json(const MapRaster& raster, const std::vector<double>& values, const std::string& parameter,
                 const std::string& unit, const char* quantity) {
  Json json;
  json["parameter"] = parameter;
  json["unit"] = unit;
  json["quantity"] = quantity;
  json["nx"] = static_cast<std::int64_t>(raster.columns);
  json["ny"] = static_cast<std::int64_t>(raster.rows);
  json["x0"] = raster.west + 0.5 * raster.cell;
  json["y0"] = raster.south + 0.5 * raster.cell;
  json["dx"] = json["dy"] = raster.cell;
  double lower = std::numeric_limits<double>::infinity(), upper = -lower;
  Json list = Json::array();
  for (std::size_t row = raster.rows; row-- > 0;) {
    for (std::size_t column = 0; column < raster.columns; ++column) {
      const double value = values[row * raster.columns + column];
      if (!std::isnan(value)) {
        lower = std::min(lower, value);
        upper = std::max(upper, value);
      }
      list.push_back(value);  // what is not a number becomes null
    }
  }
  json["lower"] = lower;
  json["upper"] = upper;
  json["values"] = std::move(list);
  return json;
}

}  // namespace

Json map_report(const std::filesystem::path& file) {
  const SlipMapContent content = read_slip_map(file);
  const MapIdentity& identity = content.identity;
  Json document;
  document["kind"] = "place";
  document["title"] = fmt::format("Map of slip of {}", identity.vehicle);
  document["subtitle"] = fmt::format("{}, {} cells of {} m, coordinates in {}", identity.model, content.cells.size(),
                                     content.cell, identity.frame);
  Json rasters = Json::array();
  for (std::size_t j = 0; j < identity.parameters.size(); ++j) {
    const MapRaster raster = raster_of(content, j, file);
    rasters.push_back(raster_json(raster, raster.means, identity.parameters[j], identity.units[j], "mean"));
    rasters.push_back(raster_json(raster, raster.sigmas, identity.parameters[j], identity.units[j], "sigma"));
  }
  std::int64_t visits = 0, values = 0;
  double first = content.cells.front().time;
  for (const SlipMap::Cell& cell : content.cells) {
    visits += cell.visits;
    values += cell.values;
    first = std::min(first, cell.time);
  }
  const auto count = static_cast<double>(content.cells.size());
  document["cells"] = static_cast<std::int64_t>(content.cells.size());
  document["visits"] = static_cast<double>(visits) / count;
  document["observations"] = static_cast<double>(values) / count;
  document["seconds"] = content.newest() - first;
  document["rasters"] = std::move(rasters);
  Json notes = Json::array();
  add_note(notes, "place",
           "Values and standard deviations are those of each cell's last visit; until they are used, uncertainty grows "
           "with their age.");
  document["notes"] = std::move(notes);
  return document;
}

}  // namespace rhec::sim
