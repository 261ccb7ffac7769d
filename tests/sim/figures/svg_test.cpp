#include "rhec/sim/figures/svg.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace rhec::sim {
namespace svg_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(Svg, FillsWhateverItIsShownIn) {
  const std::string document = Svg(300.0, 200.0).document();
  const std::string head = document.substr(0, document.find('>'));
  EXPECT_NE(head.find("viewBox=\"0 0 300 200\""), std::string::npos) << head;
  EXPECT_EQ(head.find(" width="), std::string::npos) << head;
  EXPECT_EQ(head.find(" height="), std::string::npos) << head;
}

TEST(NiceTicks, AreRoundAndWithinTheAxis) {
  EXPECT_EQ(nice_ticks(0.0, 1.0, 5).labels, (std::vector<std::string>{"0", "0.2", "0.4", "0.6", "0.8", "1.0"}));
  EXPECT_EQ(nice_ticks(-25.0, 72.0, 5).labels, (std::vector<std::string>{"-20", "0", "20", "40", "60"}));
  EXPECT_EQ(nice_ticks(0.0012, 0.0031, 4).labels, (std::vector<std::string>{"0.0015", "0.0020", "0.0025", "0.0030"}));
  EXPECT_EQ(nice_ticks(0.0, 99.0, 10).labels.back(), "90");
  EXPECT_TRUE(nice_ticks(1.0, 1.0, 5).values.empty());
  EXPECT_TRUE(nice_ticks(nan, 1.0, 5).values.empty());
}

TEST(ThinCurve, KeepsPeaksAndGaps) {
  std::vector<double> values(100000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::sin(0.001 * static_cast<double>(i));
  values[31234] = 7.0;
  values[77777] = -9.0;
  values[50000] = nan;
  const auto kept = thin_curve(values, 2000);
  EXPECT_LE(kept.size(), 2001u);
  EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
  for (std::size_t index : {0u, 31234u, 50000u, 77777u, 99999u}) {
    EXPECT_TRUE(std::binary_search(kept.begin(), kept.end(), index)) << index;
  }
  EXPECT_EQ(thin_curve(std::vector<double>(100, 1.0), 2000).size(), 100u);
}

TEST(ThinTrack, StaysWithinItsToleranceAndItsNumber) {
  std::vector<Point> track;
  for (int i = 0; i <= 50000; ++i) track.push_back({100.0 * std::cos(1e-3 * i), 100.0 * std::sin(1e-3 * i)});
  const auto kept = thin_track(track, 0.3, 2000);
  EXPECT_LE(kept.size(), 2000u);
  EXPECT_GT(kept.size(), 500u);
  EXPECT_EQ(kept.front().x, track.front().x);
  EXPECT_EQ(kept.back().x, track.back().x);
  const auto gappy = thin_track(std::vector<Point>{{0, 0}, {nan, nan}, {nan, nan}, {5, 5}}, 0.3);
  EXPECT_EQ(gappy.size(), 3u);
  std::vector<Point> shreds;
  for (int i = 0; i < 100; ++i) shreds.push_back(i % 2 ? Point{nan, nan} : Point{1.0 * i, 0.0});
  EXPECT_FALSE(thin_track(shreds, 0.3, 10).empty()) << "it ends, even where it cannot get below the number";
}

}  // namespace svg_test
}  // namespace rhec::sim
