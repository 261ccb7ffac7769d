// The vehicle is not faster in a turn than a lateral acceleration allows (docs/terms.md).
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct LateralAccelerationOptions : LimitOptions {
  double most = 2.0;

  static const OptionTable<LateralAccelerationOptions>& table() {
    using L = LateralAccelerationOptions;
    static const auto options = with_limit_options(OptionTable<L>().number(
        "most", &L::most, "speed over ground times rate of turn, to either side [m/s2]", greater_than(0.0)));
    return options;
  }
};

class LateralAcceleration final : public Term {
 public:
  using Options = LateralAccelerationOptions;
  explicit LateralAcceleration(const Options& options) : options_(options) {}

  void write(TermWriter& writer) const override {
    writer.limit(writer.ground_speed() * writer.heading_rate(), options_.softness(), "lateral acceleration");
  }
  void write_data(const TermPlace&, double*, double* lower, double* upper) const noexcept override {
    *lower = -options_.most;
    *upper = options_.most;
  }

 private:
  Options options_;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::term, rhec::LateralAcceleration,
            {.name = "lateral_acceleration",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "bounds speed over ground times rate of turn, from the vehicle's own equations"});
