#include "rhec/sim/problems/problem_format.hpp"

#include <gmock/gmock.h>

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/plugins/host/host.hpp"
#include "sim/support/same_point.hpp"
#include "support/error_of.hpp"
#include "support/random_problem.hpp"

namespace rhec::sim {
namespace problem_format_test {

using rhec::testing::RandomProblem;

std::shared_ptr<const Model> bicycle() { return Host().make_model("bicycle_slip"); }

TEST(ProblemFormat, IsFoundByTheNameOfItsKind) {
  EXPECT_THAT(problem_kinds(), ::testing::ElementsAre("rhe", "rhc"));
  for (const std::string& kind : problem_kinds()) EXPECT_EQ(problem_format(kind).traits().kind, kind);
  EXPECT_EQ(find_problem_format("parking"), nullptr);
  EXPECT_CONTAINS(error_of([] { problem_format("parking"); }), "'parking'");
  EXPECT_CONTAINS(error_of([] { problem_format("parking"); }), "rhe, rhc");
}

TEST(ProblemFormat, ACopyIsAProblemOfItsOwn) {
  RandomProblem random(bicycle(), 5);
  for (const std::shared_ptr<HorizonProblem>& problem :
       {std::shared_ptr<HorizonProblem>(random.rhe({})), std::shared_ptr<HorizonProblem>(random.rhc({}))}) {
    const ProblemFormat& format = problem_format(problem->kind());
    const std::unique_ptr<HorizonProblem> copy = format.copy(*problem);
    EXPECT_EQ(copy->kind(), problem->kind());
    std::vector<double> scratch(problem->scratch_size());
    const Iterate point = RandomProblem::cold_start(*problem);
    const double before = problem->evaluate(point, nullptr, scratch);
    EXPECT_EQ(copy->evaluate(point, nullptr, scratch), before);
    for (int i = 0; i < problem->intervals(); ++i) problem->set_duration(i, 2.0 * problem->duration(i));
    const double after = problem->evaluate(point, nullptr, scratch);
    std::vector<double> defects(problem->capacity().intervals * problem->capacity().states), others(defects);
    problem->evaluate(point, defects.data(), scratch);
    copy->evaluate(point, others.data(), scratch);
    EXPECT_NE(defects, others);
    format.take_data(*problem, *copy);
    EXPECT_EQ(copy->evaluate(point, others.data(), scratch), after);
    EXPECT_EQ(defects, others);
  }
}

/// A kind of problem from elsewhere, whose name is taken.
class Impostor final : public HorizonProblem {
 public:
  explicit Impostor(const HorizonProblem& like) : HorizonProblem(like) {}
  std::string_view kind() const noexcept override { return "rhe"; }
  const double* initial_state() const noexcept override { return nullptr; }

 protected:
  double cost(const Iterate&, double*, std::span<double>) const noexcept override { return 0.0; }
  double write_cost(StageRange, const Iterate&, Hessian, CostParts, StageQp&,
                    std::span<double>) const noexcept override {
    return 0.0;
  }
};

TEST(ProblemFormat, RefusesAClassThatOnlyBorrowsTheName) {
  RandomProblem random(bicycle(), 5);
  const Impostor impostor(*random.rhc({}));
  EXPECT_CONTAINS(error_of([&] { record_of(impostor, nullptr, "x", "bicycle_slip", {}); }), "another name than 'rhe'");
  EXPECT_CONTAINS(error_of([&] { problem_format(impostor.kind()).copy(impostor); }), "another class");
}

}  // namespace problem_format_test
}  // namespace rhec::sim
