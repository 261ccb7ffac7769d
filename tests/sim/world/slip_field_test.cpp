#include "rhec/sim/world/slip_field.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace slip_field_test {

TEST(ConstantField, IsTheSameEverywhereOnThePlane) {
  const auto field = constant_field({0.8, 0.9});
  std::array<double, 2> values{};
  field->sample(1e6, -1e6, values.data());
  EXPECT_EQ(values, (std::array<double, 2>{0.8, 0.9}));
  field->sample(std::numeric_limits<double>::quiet_NaN(), 0.0, values.data());
  EXPECT_TRUE(std::isnan(values[0])) << "what is no position has no slip";
  EXPECT_THROW(constant_field({}), Error);
}

TEST(RasterField, InterpolatesAndGoesOnBeyondTheEdge) {
  const TemporaryFolder folder;
  const auto file = folder.put("raster.csv", "origin_x,origin_y,cell_size\n10,20,2\n0,1,2\n10,11,12\n");
  const auto smooth = raster_field({.files = {file}});
  const auto stepped = raster_field({.files = {file}, .interpolation = RasterField::Interpolation::nearest});
  const auto at = [](const SlipField& field, double x, double y) {
    double value = 0.0;
    field.sample(x, y, &value);
    return value;
  };
  EXPECT_DOUBLE_EQ(at(*smooth, 10, 20), 0.0);
  EXPECT_DOUBLE_EQ(at(*smooth, 14, 22), 12.0);
  EXPECT_DOUBLE_EQ(at(*smooth, 11, 21), 5.5);
  EXPECT_DOUBLE_EQ(at(*smooth, 12.5, 20.5), 1.25 + 2.5);
  EXPECT_DOUBLE_EQ(at(*smooth, -100, 200), 10.0);
  EXPECT_DOUBLE_EQ(at(*stepped, 10.9, 20.9), 0.0);
  EXPECT_DOUBLE_EQ(at(*stepped, 11.1, 20.9), 1.0);
  EXPECT_DOUBLE_EQ(at(*stepped, 500, 21.1), 12.0);
}

TEST(RasterField, NamesFileAndLineOfAMistake) {
  const auto message_for = [](const std::string& content) {
    const TemporaryFolder folder;
    return error_of([&] { raster_field({.files = {folder.put("raster.csv", content)}}); });
  };
  const std::string head = "origin_x,origin_y,cell_size\n0,0,1\n";
  EXPECT_CONTAINS(message_for(head + "1,2\n1,2,3\n"), "raster.csv:4: 3 field(s) where 2");
  EXPECT_CONTAINS(message_for(head + "1,2\n1,x\n"), "raster.csv:4: field 2 is 'x'");
  EXPECT_CONTAINS(message_for(head + "1,2\n,2\n"), "raster.csv:4: field 1 is missing");
  EXPECT_CONTAINS(message_for("x0,y0,cell\n0,0,1\n1,2\n"), "raster.csv:1: the names are 'x0,y0,cell'");
  EXPECT_CONTAINS(message_for("origin_x,origin_y,cell_size\n0,0,0\n1,2\n"), "raster.csv:2");
  EXPECT_CONTAINS(message_for("origin_x,origin_y,cell_size\n0,0\n1,2\n"), "raster.csv:2: 2 field(s) where 3");
  EXPECT_CONTAINS(message_for("origin_x,origin_y,cell_size\n0,0,1\n"), "empty");
  EXPECT_CONTAINS(message_for("1,2\n"), "no values");
  EXPECT_CONTAINS(error_of([] { raster_field({.files = {"no/such/file.csv"}}); }), "no/such/file.csv: cannot be read");
  EXPECT_CONTAINS(error_of([] { raster_field({}); }), "no files");
}

TEST(SplitField, HasAGroundOnEachSideOfItsBorders) {
  const auto constant = [](double kappa, double mu) { return constant_field({kappa, mu}); };
  const auto field = split_field({.border = 10.0,
                                  .below = constant(0.5, 0.6),
                                  .above = split_field({.across = SplitField::Across::y,
                                                        .border = -5.0,
                                                        .below = constant(0.7, 0.8),
                                                        .above = constant(0.9, 1.0)})});
  const auto at = [&](double x, double y) {
    std::array<double, 2> values{};
    field->sample(x, y, values.data());
    return values;
  };
  EXPECT_EQ(field->channels(), 2);
  EXPECT_FALSE(field->is_smooth()) << "there is an edge";
  EXPECT_EQ(at(9.999, 100.0), (std::array{0.5, 0.6}));
  EXPECT_EQ(at(10.0, -5.001), (std::array{0.7, 0.8})) << "the border is above";
  EXPECT_EQ(at(1e6, -5.0), (std::array{0.9, 1.0}));
}

TEST(SplitField, RefusesSidesThatDoNotFit) {
  const auto message_for = [](std::unique_ptr<const SlipField> below, std::unique_ptr<const SlipField> above,
                              double at) {
    return error_of([&] { split_field({.border = at, .below = std::move(below), .above = std::move(above)}); });
  };
  EXPECT_CONTAINS(message_for(constant_field({1}), nullptr, 0.0), "on each side");
  EXPECT_CONTAINS(message_for(constant_field({1}), constant_field({1, 2}), 0.0), "1 channel(s) below the border and 2");
  EXPECT_CONTAINS(message_for(constant_field({1}), constant_field({1}), NAN), "border is nan");
}

}  // namespace slip_field_test
}  // namespace rhec::sim
