#include "rhec/core/estimation/place_memory.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/prior/walk_prior.hpp"

namespace rhec {
namespace {

/// How the speed factor, and how the other parameters, may differ from the map: all combinations.
constexpr MapDeviation of_first[] = {{3.0, 1.0}, {10.0, 1.0}, {4.0, 2.5}, {12.0, 2.5}};
constexpr MapDeviation of_others[] = {{6.0, 1.0}, {8.0, 2.5}};

PlaceBank::Setup places_setup(const std::shared_ptr<const Model>& model, const PriorBank::Setup& filters,
                              int late_nodes, const PlaceMemory::Setup& setup) {
  const ModelDescription& about = model->description();
  const int parameters = model->parameter_count();
  if (!setup.map) throw Error("place: there is no map");
  if (static_cast<int>(setup.least.size()) != parameters)
    throw Error(
        fmt::format("place: {} least deviations given; expected {}, one a parameter", setup.least.size(), parameters));
  PlaceBank::Setup places;
  places.bank = filters;
  places.bank.adapts_noise = false;  // it takes over what the bank has learnt
  places.bank.map = setup.map;
  places.bank.members.clear();
  places.bank.initial_parameters.clear();
  PriorCombination walks;
  for (const Variable& parameter : about.parameters) {
    auto walk = std::make_shared<WalkPrior>(WalkPrior::Walk{});
    walk->set_up(parameter);
    walks.push_back(std::move(walk));
  }
  const int first = std::max(about.roles.speed_factor, 0);
  for (const MapDeviation& fast : of_first) {
    for (const MapDeviation& slow : of_others) {
      std::vector<MapDeviation> member;
      for (int j = 0; j < parameters; ++j) {
        member.push_back(j == first ? fast : slow);
        member.back().least = setup.least[j];
      }
      places.bank.members.push_back(walks);
      places.bank.deviations.push_back(std::move(member));
    }
  }
  places.change = setup.change;
  places.before = setup.before;
  places.nodes = late_nodes;
  return places;
}

}  // namespace

PlaceMemory::PlaceMemory(const std::shared_ptr<const Model>& model, const PriorBank& bank,
                         const PriorBank::Setup& filters, int late_nodes, Setup setup)
    : setup_(std::move(setup)),
      np_(model->parameter_count()),
      places_(model, places_setup(model, filters, late_nodes, setup_)),
      smoother_(model, bank,
                {.lag = setup_.lag, .input_variances = filters.input_variances, .substeps = filters.substeps}) {
  for (std::vector<double>* v : {&here_, &there_, &variances_}) v->assign(np_, 0.0);
}

int PlaceMemory::remembered_nodes(const Setup& setup, int late_nodes) noexcept {
  return late_nodes + PlaceSmoother::remembered_nodes({.lag = setup.lag, .input_variances = {}});
}

void PlaceMemory::reset() noexcept {
  places_.reset();
  smoother_.reset();
  advanced_ = {};
}

void PlaceMemory::add_node(BankHistory& history) noexcept {
  const BankHistory::Node node = history.node(history.newest());
  // A node may come again, behind late measurements, or later than it was at first.
  if (history.newest() >= advanced_.number) {
    const Advanced before = history.newest() == advanced_.number ? advanced_ : Advanced{};
    setup_.map->advance(std::max(0.0, node.way.duration - before.duration),
                        std::max(0.0, node.way.distance - before.distance));
    advanced_ = {history.newest(), node.way.duration, node.way.distance};
  }
  places_.follow(history, history.newest());
  smoother_.work(history, *setup_.map);
}

void PlaceMemory::finish(BankHistory& history) noexcept { smoother_.finish(history, *setup_.map); }

/// Where the map holds, the difference from it decays as that of the filters' members; where it does not, slip stays as
/// it is. Expected is the mean of the two.
void PlaceMemory::change(const double* here, const double* there, double distance, const double* parameters,
                         double* change) const noexcept {
  std::fill_n(change, np_, 0.0);
  if (!setup_.map->look_up(there[0], there[1], there_.data(), variances_.data())) return;
  const bool knows_here = setup_.map->look_up(here[0], here[1], here_.data(), variances_.data());
  const double phi = std::exp(-distance / setup_.ahead);
  for (int j = 0; j < np_; ++j) {
    const double before = knows_here ? here_[j] : there_[j];
    change[j] = places_.probability() * (there_[j] + phi * (parameters[j] - before) - parameters[j]);
  }
}

}  // namespace rhec
