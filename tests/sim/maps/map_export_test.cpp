#include "rhec/sim/maps/map_export.hpp"

#include <geotiffio.h>
#include <unistd.h>
#include <xtiffio.h>

#include <array>
#include <cmath>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace map_export_test {

using testing::HasSubstr;

/// Two cells, (0, 0) and (2, 1), of 0.5 m.
SlipMapContent content() {
  SlipMapContent content;
  content.identity = {"red one", "bicycle_slip", {"kappa", "mu"}, {"1", "1"}, "EPSG:25833", 1000.0, 2000.0};
  content.cell = 0.5;
  content.cells = {{0.1, 0.2, 0.0, 1, 1, {0.7, 0.9}, {0.01, 0.04}}, {1.2, 0.6, 0.0, 1, 1, {0.5, 0.8}, {0.09, 0.16}}};
  return content;
}

TEST(MapExport, RastersBeginInTheNorth) {
  const MapRaster raster = raster_of(content(), 1, "field.sqlite");
  ASSERT_EQ(raster.columns, 3U);
  ASSERT_EQ(raster.rows, 2U);
  EXPECT_EQ(raster.west, 1000.0);
  EXPECT_EQ(raster.south, 2000.0);
  EXPECT_EQ(raster.means[2], 0.8);
  EXPECT_DOUBLE_EQ(raster.sigmas[2], 0.4);
  EXPECT_EQ(raster.means[3], 0.9);
  EXPECT_TRUE(std::isnan(raster.means[0]));
}

TEST(MapExport, AsciiIsEsris) {
  const MapRaster raster = raster_of(content(), 0, "field.sqlite");
  EXPECT_EQ(ascii_raster(raster, raster.means),
            "ncols 3\nnrows 2\nxllcorner 1000\nyllcorner 2000\ncellsize 0.5\nNODATA_value -9999\n"
            "-9999 -9999 0.5\n0.7 -9999 -9999\n");
}

TEST(MapExport, GeoTiffHasItsPlaceAndItsFrame) {
  const TemporaryFolder folder;
  const std::string file = folder / "field.tif";
  write_geotiff(file, raster_of(content(), 0, "field.sqlite"), "EPSG:25833");
  TIFF* const tiff = XTIFFOpen(file.c_str(), "r");
  ASSERT_NE(tiff, nullptr);
  std::uint32_t width = 0, height = 0;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &height);
  EXPECT_EQ(width, 3U);
  EXPECT_EQ(height, 2U);
  std::uint16_t count = 0;
  double* tie = nullptr;
  ASSERT_EQ(TIFFGetField(tiff, TIFFTAG_GEOTIEPOINTS, &count, &tie), 1);
  EXPECT_EQ(tie[3], 1000.0);
  EXPECT_EQ(tie[4], 2001.0);
  GTIF* const keys = GTIFNew(tiff);
  unsigned short epsg = 0;
  EXPECT_EQ(GTIFKeyGet(keys, ProjectedCSTypeGeoKey, &epsg, 0, 1), 1);
  EXPECT_EQ(epsg, 25833);
  GTIFFree(keys);
  std::array<float, 3> line{};
  ASSERT_EQ(TIFFReadScanline(tiff, line.data(), 1, 0), 1);
  EXPECT_FLOAT_EQ(line[0], 0.7F);
  EXPECT_TRUE(std::isnan(line[1]));
  ASSERT_EQ(TIFFReadScanline(tiff, line.data(), 0, 1), 1);
  EXPECT_FLOAT_EQ(line[2], 0.3F);
  XTIFFClose(tiff);
}

TEST(MapExport, RefusesAnEmptyMapAHugeOneAndAFileThatCannotBe) {
  SlipMapContent none = content();
  none.cells.clear();
  EXPECT_THAT(error_of([&] { raster_of(none, 0, "field.sqlite"); }), HasSubstr("field.sqlite: the map is empty"));
  SlipMapContent huge = content();
  huge.cells[1].x = huge.cells[1].y = 1e6;
  EXPECT_THAT(error_of([&] { raster_of(huge, 0, "field.sqlite"); }), HasSubstr("at most"));
  EXPECT_THAT(error_of([&] { write_geotiff("/no/such/folder/x.tif", raster_of(content(), 0, ""), "local"); }),
              HasSubstr("/no/such/folder/x.tif"));
}

}  // namespace map_export_test
}  // namespace rhec::sim
