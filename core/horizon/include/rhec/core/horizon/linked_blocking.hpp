#pragma once

#include <optional>

#include "rhec/core/config/options.hpp"
#include "rhec/core/horizon/blocking.hpp"

namespace rhec {

/// How the value of a block is related to that of the previous block (docs/method.md, section 4): options common to all
/// strategies with more than one block. A strategy's options derive from it and add it to their table:
///
///     struct MyOptions : BlockLink {
///       int size = 5;
///       static const OptionTable<MyOptions>& table() {
///         static const auto options = with_block_link(OptionTable<MyOptions>().integer("size", ...));
///         return options;
///       }
///     };
struct BlockLink {
  Transition transition = Transition::step;
  std::optional<double> neighbour_sigma;  ///< [unit of the parameter per square root of a step]
};

/// The table followed by the options of BlockLink.
template <class Options>
OptionTable<Options> with_block_link(OptionTable<Options> table) {
  // The option is a member of the base class, which template deduction does not find by itself.
  Transition Options::*const transition = &BlockLink::transition;
  table
      .choice("transition", transition, {{"step", Transition::step}, {"ramp", Transition::ramp}},
              "how the value moves to that of the next block: it jumps, or runs there over the block's first interval")
      .optional_number("neighbour_sigma", &BlockLink::neighbour_sigma,
                       "standard deviation of the random walk that links neighbouring blocks [per square root of a "
                       "step]; none: they are not linked",
                       greater_than(0.0));
  return table;
}

/// A strategy whose blocks are linked by a BlockLink.
class LinkedBlocking : public Blocking {
 public:
  explicit LinkedBlocking(const BlockLink& link) : link_(link) {}

  Transition transition() const noexcept override { return link_.transition; }
  std::optional<double> neighbour_sigma() const noexcept override { return link_.neighbour_sigma; }

 private:
  BlockLink link_;
};

/// Reference point from which block borders are counted.
enum class Anchor {
  time,    ///< the start of the run: borders slide through the horizon (estimation)
  horizon  ///< the start of the horizon: borders move with it (move blocking of inputs)
};

}  // namespace rhec
