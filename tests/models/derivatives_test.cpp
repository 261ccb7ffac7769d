// Every model plugin that is found, and vehicles of equations: `rhec check`, instruction sets, and no allocation in
// evaluation.
#include <gmock/gmock.h>

#include <filesystem>
#include <memory>

#include "model_checks.hpp"
#include "rhec/core/model/graph_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/check/model_check.hpp"
#include "support/allocations.hpp"

namespace rhec {
namespace derivatives_test {

class EveryModel : public testing::TestWithParam<std::string> {
 protected:
  std::shared_ptr<Model> model_ = Host().make_model(GetParam());

  template <class Check>
  void for_each_instruction_set(Check check) {
    for (const std::string& set : model_->instruction_sets()) {
      SCOPED_TRACE(set);
      ASSERT_TRUE(model_->use_instruction_set(set));
      check();
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Found, EveryModel, testing::ValuesIn(Host().names(PluginKind::model)),
                         [](const auto& found) { return found.param; });
INSTANTIATE_TEST_SUITE_P(OfEquations, EveryModel,
                         testing::Values(RHEC_VEHICLES "/bicycle.yaml", RHEC_VEHICLES "/skid_steer.yaml"),
                         [](const auto& file) { return std::filesystem::path(file.param).stem().string(); });

TEST(Models, TheBicycleIsFound) {
  EXPECT_THAT(Host().names(PluginKind::model), testing::Contains("bicycle_slip")) << Host().diagnosis();
}

TEST_P(EveryModel, PassesItsCheck) {
  const sim::ModelCheck found = sim::check_model(*model_);
  for (const sim::Finding& finding : found.findings)
    EXPECT_NE(finding.verdict, sim::Verdict::fail) << finding.check << ": " << finding.where << ": " << finding.found;
}

TEST_P(EveryModel, IntegratesByRungeKutta) {
  for_each_instruction_set([&] {
    for (const int substeps : {1, 2, 5})
      for (const bool ramp : {false, true}) checks::expect_runge_kutta(*model_, ramp, substeps);
  });
}

TEST_P(EveryModel, DerivativesAreThoseOfTheValues) {
  for_each_instruction_set([&] {
    for (const unsigned seed : {1u, 2u, 3u})
      for (const int substeps : {1, 3})
        for (const bool ramp : {false, true}) checks::expect_derivatives(*model_, ramp, substeps, seed);
  });
}

TEST_P(EveryModel, AllInstructionSetsAgreeAndWriteWhatIsAskedFor) {
  const std::shared_ptr<Model> generic = Host().make_model(GetParam());
  ASSERT_TRUE(generic->use_instruction_set(generic->instruction_sets().front()));
  for_each_instruction_set([&] { checks::same_as_generic(*model_, *generic); });
}

// Compiled kernels and the interpreter have the same bits on the same instruction set.
TEST_P(EveryModel, IsCompiledToWhatIsInterpreted) {
  Settings options;
  options.set("outputs", Settings::scalar("all"));
  const std::shared_ptr<Model> whole = Host().make_model(GetParam(), options);
  auto* const compiled = dynamic_cast<GraphModel*>(whole.get());
  ASSERT_NE(compiled, nullptr);
  if (!compiled->is_compiled()) GTEST_SKIP() << "is not compiled";
  GraphModel interpreted(compiled->vehicle(), compiled->description());
  for (const std::string& set : compiled->instruction_sets()) {
    if (set == "interpreted") continue;
    SCOPED_TRACE(set);
    ASSERT_TRUE(compiled->use_instruction_set(set));
    ASSERT_TRUE(interpreted.use_instruction_set(set));
    checks::expect_same_bits(*compiled, interpreted);
  }
}

TEST_P(EveryModel, ObservesByRowsWhatItObserves) {
  for_each_instruction_set([&] {
    for (int count = 0; count <= 17; ++count) {
      checks::same_by_rows(*model_, count, [&](const NodeRows& request) { model_->observe_rows(request); });
      // As a model does that leaves it to the base class.
      checks::same_by_rows(*model_, count, [&](const NodeRows& request) { model_->Model::observe_rows(request); });
    }
  });
}

TEST_P(EveryModel, IntegratesByRowsWhatItIntegrates) {
  for_each_instruction_set([&] {
    for (const int count : {0, 1, 7, 8, 9, 16, 17})
      for (const int substeps : {1, 2})
        for (const bool ramp : {false, true}) {
          const auto ask = [&](const IntervalRows& request) { model_->integrate_rows(request); };
          checks::same_steps_by_rows(*model_, count, ramp, substeps, ask);
          const auto ask_base = [&](const IntervalRows& request) { model_->Model::integrate_rows(request); };
          checks::same_steps_by_rows(*model_, count, ramp, substeps, ask_base);
        }
  });
}

TEST_P(EveryModel, RefusesAnUnknownInstructionSetAndKeepsItsOwn) {
  EXPECT_FALSE(model_->use_instruction_set("mmx"));
  checks::expect_runge_kutta(*model_, false, 1);
}

TEST_P(EveryModel, EvaluatesWithoutAllocation) {
  const bool second = model_->has_second_derivatives();
  for_each_instruction_set([&] {
    checks::Stages s = checks::random_stages(*model_, 15, true, 5);
    const auto intervals = s.intervals(true, true, second);
    const auto nodes = s.nodes(true, true, second);
    const long before = allocation_count();
    model_->integrate(intervals);
    model_->observe(nodes);
    EXPECT_EQ(allocation_count(), before);
  });
}

}  // namespace derivatives_test
}  // namespace rhec
