// The chain of masses as a plugin, for the benchmark of models with many states; RHEC_CHAIN is its number of states.
#include <string>
#include <vector>

#include "chain_of_masses.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/kit/sdk.hpp"

#define RHEC_JOINED(a, b) a##b
#define RHEC_JOIN(a, b) RHEC_JOINED(a, b)
#define RHEC_TEXT_OF_CHAIN(a) #a
#define RHEC_CHAIN_TEXT(a) RHEC_TEXT_OF_CHAIN(a)
#define RHEC_CHAIN_NAME RHEC_JOIN(chain_, RHEC_CHAIN)
#define RHEC_CHAIN_KERNELS RHEC_JOIN(RHEC_CHAIN_NAME, _kernels)

namespace rhec {
const StraightCode& RHEC_CHAIN_KERNELS();  // defined by rhec_add_model
}

namespace {

template <class Scalar>
using Formula = RHEC_JOIN(Chain, RHEC_CHAIN)<Scalar>;

rhec::ModelDescription describe() {
  using Chain = Formula<double>;
  rhec::ModelDescription model;
  model.name = RHEC_CHAIN_TEXT(RHEC_CHAIN_NAME);
  model.source = "Wirsching, Bock and Diehl (2006)";
  const auto triple = [](const std::string& letter, int number, const char* unit, const char* meaning) {
    std::vector<rhec::Variable> three;
    for (const char axis : {'x', 'y', 'z'})
      three.push_back({.name = letter + std::to_string(number) + axis, .unit = unit, .meaning = meaning});
    return three;
  };
  const auto append = [](std::vector<rhec::Variable>& to, const std::vector<rhec::Variable>& more) {
    to.insert(to.end(), more.begin(), more.end());
  };
  const int masses = Chain::end / 3;
  for (int i = 1; i <= masses + 1; ++i) append(model.states, triple("p", i, "m", "position of a mass"));
  for (int i = 1; i <= masses; ++i) append(model.states, triple("v", i, "m/s", "its velocity"));
  model.inputs = triple("u", masses + 1, "m/s", "velocity of the moved end");
  for (rhec::Variable& input : model.inputs) {
    input.lower = -1.0;
    input.upper = 1.0;
  }
  model.outputs = triple("y", masses + 1, "m", "position of the moved end");
  return model;
}

class ChainModel : public rhec::FormulaModel<Formula> {
 public:
  explicit ChainModel(const Options& options) : FormulaModel(options, describe(), rhec::RHEC_CHAIN_KERNELS()) {}
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::model, ChainModel,
            {.name = RHEC_CHAIN_TEXT(RHEC_CHAIN_NAME),
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = "Wirsching, Bock and Diehl (2006)",
             .capabilities = "many states, for benchmarks"});
