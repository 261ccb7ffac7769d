#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "rhec/sim/store/slip_map_file.hpp"

namespace rhec::sim {

/// One parameter of a map as a raster: row 0 is the northernmost. NaN where nothing is known.
struct MapRaster {
  std::size_t columns = 0, rows = 0;
  double west = 0.0, south = 0.0;     ///< lower left corner, in the frame's coordinates [m]
  double cell = 0.0;                  ///< [m]
  std::vector<double> means, sigmas;  ///< rows x columns; standard deviations are those at the time of the value
};

/// The raster of a parameter. Throws Error for an empty map, and one too large for a raster.
RHEC_EXPORT MapRaster raster_of(const SlipMapContent& content, std::size_t parameter,
                                const std::filesystem::path& file);

/// An Esri ASCII raster of the means or the standard deviations; -9999 where nothing is known.
RHEC_EXPORT std::string ascii_raster(const MapRaster& raster, const std::vector<double>& values);

/// Writes a GeoTIFF with two bands of 32 bits, mean and standard deviation; NaN where nothing is known. A frame that is
/// written EPSG:<number> is named in its keys. Throws Error if the file cannot be written.
RHEC_EXPORT void write_geotiff(const std::filesystem::path& file, const MapRaster& raster, const std::string& frame);

}  // namespace rhec::sim
