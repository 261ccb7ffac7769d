#include "rhec/sim/world/faults.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/bicycle.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace faults_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double infinite = std::numeric_limits<double>::infinity();

std::vector<FaultOptions> faults_of(const std::string& yaml) {
  return read_faults(parse_yaml(yaml, "faults.yaml"), Bicycle().description());
}

/// What the outputs x, y and delta of some samples, a second apart, become: each is 1 + its number of the sample.
class Drive {
 public:
  explicit Drive(const std::string& yaml, std::uint64_t seed = 1)
      : faults_(faults_of(yaml), Bicycle().description(), seed) {}

  std::vector<double> next() {
    faults_.begin(time_);
    const double value = 1.0 + time_;
    std::vector<double> outputs{value, value, value};
    faults_.change_outputs(outputs.data());
    faults_.send(outputs, 0.0, deliveries_);
    names_.push_back(faults_.take_names());
    time_ += 1.0;
    return outputs;
  }
  /// An output of some samples, less what it is without faults.
  std::vector<double> errors(int samples, std::size_t output) {
    std::vector<double> all;
    for (int k = 0; k < samples; ++k) {
      const double right = 1.0 + time_;
      all.push_back(next()[output] - right);
    }
    return all;
  }
  Faults& faults() { return faults_; }
  const std::vector<std::string>& names() const { return names_; }
  /// The stamps of what arrives, by the time of its arrival.
  std::vector<double> stamps_at(double time) {
    std::vector<double> stamps;
    deliveries_.deliver(time, [&](double stamp, const std::vector<double>&) { stamps.push_back(stamp); });
    return stamps;
  }

 private:
  Faults faults_;
  Deliveries deliveries_;
  double time_ = 0.0;
  std::vector<std::string> names_;
};

TEST(Faults, WithoutAnyNothingChanges) {
  Drive drive("[]");
  EXPECT_THAT(drive.errors(3, 0), ElementsAre(0.0, 0.0, 0.0));
  EXPECT_THAT(drive.names(), ElementsAre("", "", ""));
  EXPECT_THAT(drive.stamps_at(10.0), ElementsAre(0.0, 1.0, 2.0));
  EXPECT_EQ(drive.faults().clock(), 0.0);
}

TEST(Faults, ASpikeIsAsLargeAsItSaysInTheSpaceOfItsSensors) {
  Drive drive("[{kind: spike, start: 1.5, sensors: [x, y], size: 100}]");
  for (int k = 0; k < 5; ++k) {
    const std::vector<double> outputs = drive.next();
    const double right = 1.0 + k, off = std::hypot(outputs[0] - right, outputs[1] - right);
    EXPECT_NEAR(off, k == 2 ? 100.0 : 0.0, 1e-12) << k;
    EXPECT_EQ(outputs[2], right);
  }
  EXPECT_THAT(drive.names(), ElementsAre("", "", "spike", "", ""));
}

TEST(Faults, ASpikeWaitsForAValueToChange) {
  Faults faults(faults_of("[{kind: spike, sensors: [x], size: 5}]"), Bicycle().description(), 1);
  std::vector<double> outputs{std::nan(""), 0.0, 0.0};
  faults.begin(0.0);
  faults.change_outputs(outputs.data());
  EXPECT_EQ(faults.take_names(), "");
  outputs[0] = 0.0;
  faults.begin(1.0);
  faults.change_outputs(outputs.data());
  EXPECT_EQ(std::abs(outputs[0]), 5.0);
  EXPECT_EQ(faults.take_names(), "spike");
}

TEST(Faults, AnOffsetStaysAndADriftGrows) {
  const auto offset = Drive("[{kind: offset, start: 1, sensors: [delta], size: 2}]").errors(4, 2);
  EXPECT_EQ(offset[0], 0.0);
  EXPECT_NEAR(std::abs(offset[1]), 2.0, 1e-12);
  EXPECT_NEAR(offset[3], offset[1], 1e-12);
  const auto drift = Drive("[{kind: drift, start: 1, length: 2.5, sensors: [delta], size: 2}]").errors(6, 2);
  EXPECT_NEAR(drift[1], 0.0, 1e-12);
  EXPECT_NEAR(std::abs(drift[2]), 2.0, 1e-12);
  EXPECT_NEAR(drift[3], 2.0 * drift[2], 1e-12);
  EXPECT_EQ(drift[4], 0.0) << "it is over";
}

TEST(Faults, AStuckSensorRepeatsItsLastValue) {
  EXPECT_THAT(Drive("[{kind: stuck, start: 2, length: 2, sensors: [x]}]").errors(6, 0),
              ElementsAre(0.0, 0.0, -1.0, -2.0, 0.0, 0.0));
}

TEST(Faults, ValuesAreMissingOrWhatTheyAreSaidToBe) {
  Drive drive(
      "[{kind: dropout, start: 1, length: 1, sensors: [y]}, {kind: value, start: 2, sensors: [x], size: .inf}]");
  drive.next();
  const std::vector<double> missing = drive.next(), infinite_one = drive.next();
  EXPECT_TRUE(std::isnan(missing[1]));
  EXPECT_EQ(missing[0], 2.0);
  EXPECT_EQ(infinite_one[0], infinite);
  EXPECT_EQ(infinite_one[1], 3.0);
}

TEST(Faults, NoiseHasItsStandardDeviation) {
  const int samples = 4000;
  double squared = 0.0;
  for (const double error : Drive("[{kind: noise, sensors: [x], size: 3}]").errors(samples, 0))
    squared += error * error;
  EXPECT_NEAR(std::sqrt(squared / samples), 3.0, 0.15);
}

TEST(Faults, MultipathJumpsAndHolds) {
  Drive drive("[{kind: multipath, start: 0, length: 20, every: 60, sensors: [x, y], size: 3}]");
  const int samples = 20000;
  int off = 0, jumps = 0;
  double last = 0.0;
  for (const double error : drive.errors(samples, 0)) {
    off += error != 0.0;
    jumps += std::abs(error - last) > 1e-9;
    last = error;
  }
  EXPECT_NEAR(off / static_cast<double>(samples), 20.0 / 80.0, 0.05) << "the share of its two states";
  EXPECT_NEAR(jumps, 2.0 * samples / 80.0, 100.0) << "one into each span, and one out of it";
}

TEST(Faults, TheSeedDecidesWhatIsDrawn) {
  const std::string own = "[{kind: spike, sensors: [x, y], size: 1, seed: 7}]",
                    none = "[{kind: spike, sensors: [x, y], size: 1}]";
  EXPECT_EQ(Drive(own, 1).next(), Drive(own, 2).next());
  EXPECT_EQ(Drive(none, 1).next(), Drive(none, 1).next());
  EXPECT_NE(Drive(none, 1).next(), Drive(none, 2).next());
}

TEST(Faults, WheelSpinTakesFromTheVehicleAndNotFromWhatIsMeasured) {
  Faults faults(faults_of("[{kind: wheel_spin, sensors: [u1], size: 0.25}, {kind: value, sensors: [u2], size: 1e6}]"),
                Bicycle().description(), 1);
  faults.begin(0.0);
  std::vector<double> applied{4.0, 1.0}, measured{4.0, 1.0};
  faults.change_applied_inputs(applied.data());
  faults.change_measured_inputs(measured.data());
  EXPECT_THAT(applied, ElementsAre(3.0, 1.0));
  EXPECT_THAT(measured, ElementsAre(4.0, 1e6));
  EXPECT_EQ(faults.take_names(), "wheel_spin+value");
}

TEST(Faults, StampsAndMessages) {
  const auto stamps = [](const std::string& fault) {
    Drive drive("[{" + fault + "}]");
    std::vector<double> all;
    for (int k = 0; k < 5; ++k) {
      drive.next();
      for (const double stamp : drive.stamps_at(k)) all.push_back(stamp);
    }
    return all;
  };
  EXPECT_THAT(stamps("kind: stamp, start: 2, size: 100"), ElementsAre(0.0, 1.0, 102.0, 3.0, 4.0));
  EXPECT_THAT(stamps("kind: doubled, start: 2"), ElementsAre(0.0, 1.0, 2.0, 2.0, 3.0, 4.0));
  EXPECT_THAT(stamps("kind: swapped, start: 2"), ElementsAre(0.0, 1.0, 3.0, 2.0, 4.0));
  EXPECT_THAT(stamps("kind: swapped, start: 0, length: 9"), ElementsAre(1.0, 0.0, 3.0, 2.0));
  EXPECT_THAT(stamps("kind: silence, start: 1, length: 3"), ElementsAre(0.0, 4.0));
  EXPECT_THAT(stamps("kind: late, start: 1, size: 1.5"), ElementsAre(0.0, 2.0, 1.0, 3.0, 4.0));
  EXPECT_THAT(stamps("kind: clock, start: 3, size: -1000"), ElementsAre(0.0, 1.0, 2.0, -997.0, -996.0));
}

TEST(Faults, MistakesAreToldWithTheirPlaceAndWhatWasExpected) {
  const auto mistake = [](const std::string& fault) { return error_of([&] { faults_of("- {" + fault + "}"); }); };
  EXPECT_THAT(mistake("kind: spik, sensors: [x], size: 1"),
              AllOf(HasSubstr("faults.yaml:1"), HasSubstr("did you mean 'spike'")));
  EXPECT_THAT(mistake("kind: spike, sensor: [x], size: 1"), HasSubstr("did you mean 'sensors'"));
  EXPECT_THAT(mistake("kind: spike, sensors: [delt], size: 1"), HasSubstr("delta"));
  EXPECT_THAT(mistake("kind: spike, size: 1"),
              HasSubstr("needs sensors; expected a list of some of x, y, delta, u1, u2"));
  EXPECT_THAT(mistake("kind: spike, sensors: [x]"), HasSubstr("a fault 'spike' needs a size"));
  EXPECT_THAT(mistake("kind: stuck, sensors: [x], size: 1"), HasSubstr("a fault 'stuck' has no size"));
  EXPECT_THAT(mistake("kind: clock, sensors: [x], size: 1"), HasSubstr("of whole measurements"));
  EXPECT_THAT(mistake("kind: wheel_spin, sensors: [x], size: 1"), HasSubstr("u1, u2"));
  EXPECT_THAT(mistake("kind: wheel_spin, sensors: [u1], size: 2"), HasSubstr("a share from 0 to 1"));
  EXPECT_THAT(mistake("kind: offset, sensors: [x], size: -2"), HasSubstr("at least 0"));
  EXPECT_THAT(mistake("sensors: [x], size: 2"), HasSubstr("a fault without a kind"));
  EXPECT_THAT(error_of([] { faults_of("{kind: spike}"); }), HasSubstr("a list of faults"));
}

}  // namespace faults_test
}  // namespace rhec::sim
