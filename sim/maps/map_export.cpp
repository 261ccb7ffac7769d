#include "rhec/sim/maps/map_export.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <limits>
#include <memory>

#include <fmt/format.h>

#include <geotiffio.h>
#include <xtiffio.h>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

constexpr double most_cells = 1e8;
constexpr const char* no_data_text = "nan";
constexpr int no_data_tag = 42113;  // GDAL_NODATA, which geographic programs read

struct CloseTiff {
  void operator()(TIFF* tiff) const noexcept { XTIFFClose(tiff); }
};
struct FreeOptions {
  void operator()(TIFFOpenOptions* options) const noexcept { TIFFOpenOptionsFree(options); }
};

/// What fails is reported by return values; nothing is printed.
int say_nothing(TIFF*, void*, const char*, const char*, va_list) { return 1; }
struct FreeKeys {
  void operator()(GTIF* keys) const noexcept { GTIFFree(keys); }
};

/// The number of an EPSG code that fits into the keys; 0 for none.
int epsg_of(const std::string& frame) {
  constexpr std::string_view prefix = "EPSG:";
  if (!frame.starts_with(prefix)) return 0;
  int code = 0;
  const auto [end, error] = std::from_chars(frame.data() + prefix.size(), frame.data() + frame.size(), code);
  const bool is_code = error == std::errc() && end == frame.data() + frame.size() && code > 0 && code < 65536;
  return is_code ? code : 0;
}

}  // namespace

MapRaster raster_of(const SlipMapContent& content, std::size_t parameter, const std::filesystem::path& file) {
  if (content.cells.empty())
    throw Error(fmt::format("{}: the map is empty; there is nothing to export. Drive first", file.string()));
  const double cell = content.cell, infinity = std::numeric_limits<double>::infinity();
  double west = infinity, south = infinity, east = -infinity, north = -infinity;
  const auto column_of = [cell](double x) { return std::floor(x / cell); };
  for (const SlipMap::Cell& each : content.cells) {
    west = std::min(west, column_of(each.x));
    east = std::max(east, column_of(each.x));
    south = std::min(south, column_of(each.y));
    north = std::max(north, column_of(each.y));
  }
  if ((east - west + 1.0) * (north - south + 1.0) > most_cells)
    throw Error(fmt::format("{}: the map spans {:.0f} x {:.0f} cells; a raster has at most {:g}", file.string(),
                            east - west + 1.0, north - south + 1.0, most_cells));
  MapRaster raster;
  raster.columns = static_cast<std::size_t>(east - west + 1.0);
  raster.rows = static_cast<std::size_t>(north - south + 1.0);
  raster.west = west * cell + content.identity.origin_x;
  raster.south = south * cell + content.identity.origin_y;
  raster.cell = cell;
  raster.means.assign(raster.columns * raster.rows, std::numeric_limits<double>::quiet_NaN());
  raster.sigmas = raster.means;
  for (const SlipMap::Cell& each : content.cells) {
    const auto column = static_cast<std::size_t>(column_of(each.x) - west);
    const auto row = static_cast<std::size_t>(north - column_of(each.y));
    raster.means[row * raster.columns + column] = each.means[parameter];
    raster.sigmas[row * raster.columns + column] = std::sqrt(each.variances[parameter]);
  }
  return raster;
}

std::string ascii_raster(const MapRaster& raster, const std::vector<double>& values) {
  std::string text = fmt::format("ncols {}\nnrows {}\nxllcorner {}\nyllcorner {}\ncellsize {}\nNODATA_value -9999\n",
                                 raster.columns, raster.rows, raster.west, raster.south, raster.cell);
  for (std::size_t row = 0; row < raster.rows; ++row) {
    for (std::size_t column = 0; column < raster.columns; ++column) {
      const double value = values[row * raster.columns + column];
      if (column > 0) text += ' ';
      text += std::isnan(value) ? "-9999" : fmt::format("{:.6g}", value);
    }
    text += '\n';
  }
  return text;
}

void write_geotiff(const std::filesystem::path& file, const MapRaster& raster, const std::string& frame) {
  const auto refuse = [&file] {
    throw Error(
        fmt::format("{}: cannot be written; choose another folder, or look whether the disk is full", file.string()));
  };
  const std::unique_ptr<TIFFOpenOptions, FreeOptions> options(TIFFOpenOptionsAlloc());
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &say_nothing, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &say_nothing, nullptr);
  XTIFFInitialize();  // the tags of GeoTIFF
  const std::unique_ptr<TIFF, CloseTiff> tiff(TIFFOpenExt(file.c_str(), "w", options.get()));
  if (!tiff) refuse();
  TIFF* const t = tiff.get();
  const std::array fields{TIFFFieldInfo{no_data_tag, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0,
                                        const_cast<char*>("GDAL_NODATA")}};  // NOLINT: libtiff's interface
  TIFFMergeFieldInfo(t, fields.data(), fields.size());
  TIFFSetField(t, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(raster.columns));
  TIFFSetField(t, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(raster.rows));
  TIFFSetField(t, TIFFTAG_BITSPERSAMPLE, 32);
  TIFFSetField(t, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(t, TIFFTAG_SAMPLESPERPIXEL, 2);
  const std::array<std::uint16_t, 1> extra{EXTRASAMPLE_UNSPECIFIED};
  TIFFSetField(t, TIFFTAG_EXTRASAMPLES, 1, extra.data());
  TIFFSetField(t, TIFFTAG_PLANARCONFIG, PLANARCONFIG_SEPARATE);
  TIFFSetField(t, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(t, TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  TIFFSetField(t, TIFFTAG_ROWSPERSTRIP, 1);
  TIFFSetField(t, no_data_tag, no_data_text);
  const std::array scale{raster.cell, raster.cell, 0.0};
  const double north = raster.south + static_cast<double>(raster.rows) * raster.cell;
  const std::array tie{0.0, 0.0, 0.0, raster.west, north, 0.0};
  TIFFSetField(t, TIFFTAG_GEOPIXELSCALE, 3, scale.data());
  TIFFSetField(t, TIFFTAG_GEOTIEPOINTS, 6, tie.data());
  const std::unique_ptr<GTIF, FreeKeys> keys(GTIFNew(t));
  if (!keys) refuse();
  const int epsg = epsg_of(frame);
  GTIFKeySet(keys.get(), GTModelTypeGeoKey, TYPE_SHORT, 1, ModelTypeProjected);
  GTIFKeySet(keys.get(), GTRasterTypeGeoKey, TYPE_SHORT, 1, RasterPixelIsArea);
  GTIFKeySet(keys.get(), GTCitationGeoKey, TYPE_ASCII, 0, frame.c_str());
  if (epsg > 0) GTIFKeySet(keys.get(), ProjectedCSTypeGeoKey, TYPE_SHORT, 1, epsg);
  GTIFKeySet(keys.get(), ProjLinearUnitsGeoKey, TYPE_SHORT, 1, Linear_Meter);
  if (GTIFWriteKeys(keys.get()) == 0) refuse();
  std::vector<float> line(raster.columns);
  for (std::uint16_t band = 0; band < 2; ++band) {
    const std::vector<double>& values = band == 0 ? raster.means : raster.sigmas;
    for (std::size_t row = 0; row < raster.rows; ++row) {
      const auto first = values.begin() + static_cast<std::ptrdiff_t>(row * raster.columns);
      std::transform(first, first + static_cast<std::ptrdiff_t>(raster.columns), line.begin(),
                     [](double value) { return static_cast<float>(value); });
      if (TIFFWriteScanline(t, line.data(), static_cast<std::uint32_t>(row), band) != 1) refuse();
    }
  }
  if (TIFFFlush(t) != 1) refuse();
}

}  // namespace rhec::sim
