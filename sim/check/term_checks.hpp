#pragma once

#include <deque>
#include <vector>

#include "rhec/core/term/term.hpp"
#include "rhec/sim/check/finding.hpp"
#include "rhec/sim/check/term_check.hpp"
#include "term_formula.hpp"

// The individual checks of `check_term`.
namespace rhec::sim {

/// Random places of nodes, the first of them at the origin at time 0. They have more obstacles than a term regards, the
/// same number, fewer or none.
class TermPlaces {
 public:
  TermPlaces(int count, int most_obstacles, std::uint64_t seed);
  TermPlaces(const TermPlaces&) = delete;
  TermPlaces& operator=(const TermPlaces&) = delete;
  const std::vector<TermPlace>& all() const { return places_; }

 private:
  std::deque<std::vector<Obstacle>> obstacles_;  ///< places have views of them
  std::vector<TermPlace> places_;
};

/// What a term says of itself, and what its rows on the vehicles are called.
std::vector<Finding> check_term_description(const TermDescription& about, const std::vector<TermFormula>& on);
/// Data and bounds of nodes: all of them written, and nothing else, the same each time, lower at most upper.
std::vector<Finding> check_rows(const std::vector<TermFormula>& on, const TermPlaces& places);

}  // namespace rhec::sim
