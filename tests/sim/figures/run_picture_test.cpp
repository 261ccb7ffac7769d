#include "rhec/sim/figures/run_picture.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace run_picture_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(SlipPalette, GrowsEvenlyLighter) {
  double before = -1.0;
  for (int i = 0; i <= 20; ++i) {
    const Colour colour = slip_palette(i / 20.0);
    const double luminance =
        0.2126 * std::pow(colour.red, 2.2) + 0.7152 * std::pow(colour.green, 2.2) + 0.0722 * std::pow(colour.blue, 2.2);
    EXPECT_GT(luminance, before);
    before = luminance;
  }
  EXPECT_EQ(hex({1.0, 0.5, 0.0}), "#ff8000");
}

RunPicture example(std::size_t samples) {
  RunPicture picture;
  picture.title = "A <run> & more";
  Curve curve{"estimate", {}, {}, {}, CurveRole::estimate};
  for (std::size_t i = 0; i < samples; ++i) {
    const double t = 0.2 * static_cast<double>(i);
    picture.path.push_back({t, std::sin(t)});
    picture.driven.push_back({t, std::sin(t) + 0.1});
    curve.times.push_back(t);
    curve.values.push_back(i % 97 == 5 ? nan : std::cos(t));
    curve.sigmas.push_back(0.1);
  }
  picture.panels = {{"Kappa", "1", {curve}}, {"Speed", "m/s", {}}};
  picture.base = BaseMap{"kappa", [](double x, double y) { return std::abs(std::sin(x + y)); }, 0.0, 1.0};
  return picture;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(DrawRun, IsWellFormedAndSmall) {
  for (std::size_t samples : {0u, 1u, 2u, 500u, 100000u}) {
    const std::string svg = draw_run(example(samples));
    EXPECT_TRUE(svg.starts_with("<svg")) << samples;
    EXPECT_TRUE(svg.ends_with("</svg>\n")) << samples;
    EXPECT_EQ(count(svg, "<g "), count(svg, "</g>")) << samples;
    EXPECT_EQ(count(svg, "nan"), 0u) << samples;
    EXPECT_EQ(count(svg, "inf"), 0u) << samples;
    EXPECT_NE(svg.find("A &lt;run&gt; &amp; more"), std::string::npos);
    EXPECT_LT(svg.size(), 1500000u) << samples;
  }
}

TEST(DrawRun, ManagesWithoutAnything) {
  EXPECT_TRUE(draw_run({}).starts_with("<svg"));
  RunPicture lost = example(10);
  for (Point& point : lost.driven) point.x = nan;
  lost.panels[0].curves[0].values.assign(10, nan);
  EXPECT_EQ(count(draw_run(lost), "nan"), 0u);
}

TEST(DrawRun, RefusesCurvesThatDoNotFit) {
  RunPicture picture = example(10);
  picture.panels[0].curves[0].times.pop_back();
  EXPECT_THROW(draw_run(picture), Error);
  picture = example(10);
  picture.base->value = nullptr;
  EXPECT_THROW(draw_run(picture), Error);
}

}  // namespace run_picture_test
}  // namespace rhec::sim
