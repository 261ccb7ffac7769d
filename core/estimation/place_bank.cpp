#include "rhec/core/estimation/place_bank.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

/// Neither hypothesis becomes less probable than this, so that it can come back.
constexpr double least_probability = 1e-6;
/// However the drive went: ground that has changed may end, and so may ground that has not.
constexpr double least_trust = 0.02;

PriorBank make_bank(const std::shared_ptr<const Model>& model, const PlaceBank::Setup& setup) {
  if (!setup.bank.map) throw Error("place: there is no map");
  if (!(setup.change > 0.0)) throw Error("place: change: expected a positive length");
  if (!(setup.before > 0.0 && setup.before < 1.0)) throw Error("place: before: expected a probability between 0 and 1");
  for (const PriorCombination& member : setup.bank.members)
    for (const auto& prior : member)
      if (prior->state_count() != 1) throw Error("place: expected priors of one state");
  return {model, setup.bank};
}

}  // namespace

PlaceBank::PlaceBank(const std::shared_ptr<const Model>& model, Setup setup)
    : setup_(std::move(setup)),
      bank_(make_bank(model, setup_)),
      states_(static_cast<std::size_t>(std::max(setup_.nodes, 1)) + 2),
      saved_(states_.size() * bank_.state_size(), 0.0) {
  bank_.moments(mean_, covariance_);  // takes on their sizes
  difference_ = mean_;
  reset();
}

void PlaceBank::reset() noexcept {
  probability_ = trust_ = setup_.before;
  knows_ = false;
}

void PlaceBank::follow(const BankHistory& history, std::int64_t from) noexcept {
  const std::int64_t oldest = history.newest() - history.count() + 1;
  if (from <= oldest) {
    // The first node that is known: nothing was known of its place.
    from = oldest + 1;
    reset();
    states_[place(oldest)] = {probability_, trust_, false};
    bank_.save(saved_.data() + place(oldest) * bank_.state_size());
  }
  // What changed before the nodes that are remembered here has its effect on the bank alone.
  from = std::max(from, history.newest() - static_cast<std::int64_t>(states_.size()) + 2);
  const State& state = states_[place(from - 1)];
  probability_ = state.probability;
  trust_ = state.trust;
  knows_ = state.knows;
  if (from <= history.newest()) bank_.restore(saved_.data() + place(from - 1) * bank_.state_size());
  bank_.take_noise(history.bank());
  for (std::int64_t number = from; number <= history.newest(); ++number) {
    take_node(history.node(number - 1), history.node(number));
    states_[place(number)] = {probability_, trust_, knows_};
    bank_.save(saved_.data() + place(number) * bank_.state_size());
  }
}

void PlaceBank::take_node(const BankHistory::Node& before, const BankHistory::Node& node) noexcept {
  const double change = -std::expm1(-node.way.distance / setup_.change);
  if (!knows_) {
    // Nothing has told the two hypotheses from each other: the map's members are what the bank was.
    bank_.forget_weights();
    bank_.take_share(1.0, before.mean, before.covariance);
    probability_ += change * (trust_ - probability_);
  } else {
    // Over the ground it is drawn anew whether the map holds.
    const double begins = (1.0 - probability_) * change * trust_;
    const double stays = probability_ * (1.0 - change * (1.0 - trust_));
    probability_ = stays + begins;
    bank_.take_share(begins / probability_, before.mean, before.covariance);
  }
  // Without jumps: of slip that jumps the map says what it is behind it.
  bank_.predict(node.between->over(node.way.duration, node.inputs), node.outputs);
  knows_ = bank_.knows_place();
  if (!knows_) return;
  bank_.update(node.outputs, node.robust_weights);
  const double odds = std::log(probability_ / (1.0 - probability_)) + bank_.log_likelihood() +
                      bank_.between_log_likelihood() - node.log_likelihood;
  const double probability = 1.0 / (1.0 + std::exp(-odds));
  probability_ = std::isfinite(probability) ? std::clamp(probability, least_probability, 1.0 - least_probability)
                                            : least_probability;
  trust_ += -std::expm1(-node.way.distance / setup_.trust) * (probability_ - trust_);
  trust_ = std::clamp(trust_, least_trust, 1.0 - least_trust);
}

void PlaceBank::fuse(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept {
  if (!knows_) return;
  bank_.moments(mean_, covariance_);
  if (!mean_.allFinite() || !covariance_.allFinite()) return;
  difference_ = mean_ - mean;
  mean += probability_ * difference_;
  const double across = probability_ * (1.0 - probability_);
  for (Eigen::Index c = 0; c < mean.size(); ++c)
    for (Eigen::Index r = 0; r < mean.size(); ++r)
      covariance(r, c) +=
          probability_ * (covariance_(r, c) - covariance(r, c)) + across * difference_[r] * difference_[c];
}

}  // namespace rhec
