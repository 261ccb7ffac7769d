#include "rhec/sim/tuning/search.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <thread>

#include "support/address_space.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace search_test {

SearchOptions box(Eigen::Index size, double half) {
  SearchOptions options;
  options.lower = Eigen::VectorXd::Constant(size, -half);
  options.upper = Eigen::VectorXd::Constant(size, half);
  options.step = Eigen::VectorXd::Constant(size, 0.3);
  options.tolerance = 1e-8;
  return options;
}

double hill(const Eigen::VectorXd& at) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < at.size(); ++i) sum -= static_cast<double>(1 + i) * (at[i] - 0.5) * (at[i] - 0.5);
  return sum - at.sum() * at.sum();
}

TEST(Search, FindsAMaximumWithinBounds) {
  const Maximum free = maximise(hill, {Eigen::VectorXd::Zero(3)}, box(3, 2.0));
  // d/dx_i: (1 + i) (x_i - 1/2) + sum = 0.
  const double sum = 1.5 / (1.0 + 1.0 + 0.5 + 1.0 / 3.0);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(free.at[i], 0.5 - sum / (1 + i), 1e-3);
  const Maximum bounded =
      maximise([](const Eigen::VectorXd& at) { return at[0]; }, {Eigen::VectorXd::Zero(2)}, box(2, 2.0));
  EXPECT_NEAR(bounded.at[0], 2.0, 1e-3);
  const Maximum single = maximise(hill, {Eigen::VectorXd::Zero(1)}, box(1, 2.0));
  EXPECT_NEAR(single.at[0], 0.25, 1e-3);
}

TEST(Search, TakesTheBestOfSeveralStarts) {
  const auto two_hills = [](const Eigen::VectorXd& at) {
    return std::exp(-20.0 * (at.array() - 1.0).square().sum()) +
           2.0 * std::exp(-20.0 * (at.array() + 1.0).square().sum());
  };
  SearchOptions options = box(2, 2.0);
  options.threads = 2;
  const Maximum found =
      maximise(two_hills, {Eigen::VectorXd::Constant(2, 0.8), Eigen::VectorXd::Constant(2, -0.8)}, options);
  EXPECT_NEAR(found.value, 2.0, 1e-3);
  EXPECT_NEAR(found.at[0], -1.0, 0.05);
}

TEST(Search, KeepsTheBestWhenItIsStopped) {
  SearchOptions options = box(3, 2.0);
  int calls = 0;
  double best = -std::numeric_limits<double>::infinity();
  options.stop = [&] { return calls >= 7; };
  const Maximum found = maximise(
      [&](const Eigen::VectorXd& at) {
        ++calls;
        best = std::max(best, hill(at));
        return hill(at);
      },
      {Eigen::VectorXd::Zero(3)}, options);
  EXPECT_TRUE(found.stopped);
  EXPECT_EQ(found.evaluations, 7);
  EXPECT_EQ(found.value, best);
  EXPECT_EQ(hill(found.at), best);
}

TEST(Search, PassesErrorsOnAndRefusesWhatHasNoValue) {
  EXPECT_EQ(error_of([] {
              maximise([](const Eigen::VectorXd&) -> double { throw Error("no such road"); },
                       {Eigen::VectorXd::Zero(2)}, box(2, 1.0));
            }),
            "no such road");
  EXPECT_NE(error_of([] {
              maximise([](const Eigen::VectorXd&) { return std::numeric_limits<double>::quiet_NaN(); },
                       {Eigen::VectorXd::Zero(2)}, box(2, 1.0));
            }).find("finite"),
            std::string::npos);
  EXPECT_EQ(error_of([] {
              in_parallel(8, 3, [](int i) {
                if (i == 5) throw Error("five");
              });
            }),
            "five");
}

TEST(Search, WorksWithTheThreadsThatTheSystemStarts) {
  constexpr int count = 1000;
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<bool> has_begun = false;
  std::atomic<int> done = 0;
  const AddressSpace limit(std::size_t{64} << 20);
  in_parallel(count, AddressSpace::is_limited ? count : 3, [&](int) {
    if (std::this_thread::get_id() == caller) {
      has_begun = true;  // with all threads that there will be
      has_begun.notify_all();
    }
    has_begun.wait(false);
    ++done;
  });
  EXPECT_EQ(done, count);
}

}  // namespace search_test
}  // namespace rhec::sim
