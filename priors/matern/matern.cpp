// A Matern process about a mean of its own (docs/method.md, section 8).
#include "rhec/core/prior/matern_prior.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

enum class Smoothness { half = 1, three_halves = 2, five_halves = 3 };  // states of the process

struct MaternOptions : CommonPriorOptions {
  Smoothness smoothness = Smoothness::three_halves;
  double length = MaternPrior::Law{}.length;
  std::optional<double> sigma, mean_walk;

  static const OptionTable<MaternOptions>& table() {
    using M = MaternOptions;
    static const auto options = with_common_options(
        OptionTable<M>()
            .choice("smoothness", &M::smoothness,
                    {{"1/2", Smoothness::half}, {"3/2", Smoothness::three_halves}, {"5/2", Smoothness::five_halves}},
                    "nu: continuous, smooth, or twice as smooth")
            .number("length", &M::length, "correlation length [m, or s]", greater_than(0.0))
            .optional_number("sigma", &M::sigma,
                             "standard deviation about the mean; none: 0.15 of the width of the parameter's bounds",
                             greater_than(0.0))
            .optional_number("mean_walk", &M::mean_walk,
                             "standard deviation of the mean's own random walk per square root of a metre, or of a "
                             "second; none: 0.005 of that width",
                             at_least(0.0)));
    return options;
  }
};

class MaternPlugin final : public MaternPrior {
 public:
  using Options = MaternOptions;
  explicit MaternPlugin(const Options& options)
      : MaternPrior({options, static_cast<int>(options.smoothness), options.length, options.sigma, options.mean_walk}) {
  }
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(
    rhec::PluginKind::prior, rhec::MaternPlugin,
    {.name = "matern",
     .version = "1.0.0",
     .licence = "BSD-2-Clause",
     .source = "Hartikainen and Särkkä 2010, Kalman filtering and smoothing solutions to temporal Gaussian process "
               "regression models",
     .capabilities = "stationary and smooth, of a correlation length, about a mean that walks slowly"});
