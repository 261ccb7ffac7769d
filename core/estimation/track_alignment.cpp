#include "track_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <utility>

#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

using Point = std::complex<double>;

constexpr double shortest_reach = 5.0, longest_reach = 40.0;  // of a piece to each side, along the track [m]
constexpr int fewest_fixes = 4;
constexpr double least_spread = 1.5;                       // of the fixes of a piece, root mean square [m]
constexpr double least_stretch = 0.5, most_stretch = 2.0;  // beyond these, something else is wrong
constexpr int reweightings = 20;
constexpr double least_jump = 1.0;  // of a gap; for less, linearisation is good enough [m]

struct Pose {
  Point position;
  double heading = 0.0;
};

Pose chained(const Pose& from, const Pose& motion) {
  return {from.position + std::polar(1.0, from.heading) * motion.position, from.heading + motion.heading};
}

/// A measured position: where along the nodes, what the chain has there, and how far along it that is [m].
struct PositionFix {
  double place = 0.0;
  Point observed, measured;
  double gone = 0.0;
};

class AlignedTrack {
 public:
  AlignedTrack(const RheProblem& problem, const Model& vehicle, std::vector<double>& states,
               std::vector<double>& inputs, const std::vector<double>& parameters)
      : problem_(problem),
        model_(vehicle),
        roles_(model_.description().roles),
        states_(states),
        inputs_(inputs),
        parameters_(parameters),
        count_(problem.intervals() + 1) {
    // The driving states and inputs are those that straight motion sets.
    const std::vector<double> nominal = nominal_values(model_.description().parameters);
    std::vector<double> state(model_.state_count(), 0.0), input(model_.input_count(), 0.0);
    model_.straight_motion(1.0, nominal.data(), state.data(), input.data());
    const auto find = [](const std::vector<double>& motion, std::vector<int>& driving) {
      for (std::size_t j = 0; j < motion.size(); ++j)
        if (motion[j] != 0.0) driving.push_back(static_cast<int>(j));
    };
    find(state, driving_states_);
    find(input, driving_inputs_);
  }

  void align() {
    if (roles_.position_x < 0 || roles_.position_y < 0 || roles_.heading < 0 || !find_outputs()) return;
    chain();
    std::vector<Pose> poses(count_);
    std::vector<char> known(count_, 0);
    for (int k = 0; k < count_; ++k) known[k] = fit(k, poses[k]) ? 1 : 0;
    const int first = static_cast<int>(std::find(known.begin(), known.end(), 1) - known.begin());
    if (first == count_) return;
    for (int k = first - 1; k >= 0; --k) {
      poses[k].heading = poses[k + 1].heading - motions_[k].heading;
      poses[k].position = poses[k + 1].position - std::polar(1.0, poses[k].heading) * motions_[k].position;
    }
    int last_known = first;
    for (int k = first + 1; k < count_; ++k) {
      const Pose reached = chained(poses[k - 1], motions_[k - 1]);
      if (!known[k]) {
        poses[k] = reached;
        continue;
      }
      if (k > last_known + 1) close_gap(last_known, k, reached.position, poses);
      // Full turns are counted along the track, not by the fit.
      const double expected = chained(poses[k - 1], motions_[k - 1]).heading;
      poses[k].heading = expected + angle_difference(poses[k].heading, expected);
      last_known = k;
    }
    for (int k = 0; k < count_; ++k) write(k, poses[k]);
  }

 private:
  double* state(int node) { return states_.data() + static_cast<std::ptrdiff_t>(node) * model_.state_count(); }
  Pose pose_of(const double* s) const { return {{s[roles_.position_x], s[roles_.position_y]}, s[roles_.heading]}; }
  void write(int node, const Pose& pose) {
    state(node)[roles_.position_x] = pose.position.real();
    state(node)[roles_.position_y] = pose.position.imag();
    roles_.turn(pose.heading - state(node)[roles_.heading], state(node));
  }

  /// Finds the outputs that equal the position's x and y up to an offset.
  bool find_outputs() {
    const int ny = model_.output_count();
    std::vector<double> jacobian(static_cast<std::size_t>(ny) * model_.state_count());
    Model::Nodes request;
    request.count = 1;
    request.states = state(0);
    request.jacobians = jacobian.data();
    model_.observe(request);
    for (int j = 0; j < ny; ++j) {
      const double by_x = jacobian[static_cast<std::ptrdiff_t>(roles_.position_x) * ny + j];
      const double by_y = jacobian[static_cast<std::ptrdiff_t>(roles_.position_y) * ny + j];
      if (by_x == 1.0 && by_y == 0.0) x_output_ = j;
      if (by_x == 0.0 && by_y == 1.0) y_output_ = j;
    }
    return x_output_ >= 0 && y_output_ >= 0;
  }

  /// Chains the motions to a track, with the outputs observed along it and the distance travelled.
  void chain() {
    motions_.resize(count_ - 1);
    chain_.resize(count_);
    gone_.assign(count_, 0.0);
    for (int k = 0; k < count_; ++k) {
      add_fix(chain_[k], state(k), problem_.output(k), k, gone_[k]);
      if (k + 1 == count_) break;
      const Pose from = pose_of(state(k));
      const auto motion_after = [&](double seconds) {
        const Pose to = pose_of(integrated(k, seconds));
        return Pose{std::polar(1.0, -from.heading) * (to.position - from.position), to.heading - from.heading};
      };
      const BetweenNodes& between = problem_.between(k);
      for (int i = 0; i < between.count(); ++i) {
        const Pose motion = motion_after(between.time(i));
        add_fix(chained(chain_[k], motion), next_.data(), between.outputs(i),
                k + between.time(i) / problem_.duration(k), gone_[k] + std::abs(motion.position));
      }
      motions_[k] = motion_after(problem_.duration(k));
      chain_[k + 1] = chained(chain_[k], motions_[k]);
      gone_[k + 1] = gone_[k] + std::abs(motions_[k].position);
    }
  }

  /// The state so long after a node.
  const double* integrated(int node, double seconds) {
    const std::ptrdiff_t nu = model_.input_count(), np = model_.parameter_count();
    next_.resize(model_.state_count());
    Model::Intervals request;
    request.count = 1;
    request.states = state(node);
    request.inputs = inputs_.data() + node * nu;
    request.parameters = parameters_.data() + node * np;
    request.durations = &seconds;
    request.substeps = problem_.substeps();
    request.next_states = next_.data();
    model_.integrate(request);
    return next_.data();
  }

  /// If a position was measured: what is observed of a state with its pose on the chain.
  void add_fix(const Pose& pose, const double* state, const double* measured, double place, double gone) {
    if (std::isnan(measured[x_output_]) || std::isnan(measured[y_output_])) return;
    std::vector<double> moved(state, state + model_.state_count()), outputs(model_.output_count());
    moved[roles_.position_x] = pose.position.real();
    moved[roles_.position_y] = pose.position.imag();
    roles_.turn(pose.heading - moved[roles_.heading], moved.data());
    Model::Nodes observation;
    observation.count = 1;
    observation.states = moved.data();
    observation.outputs = outputs.data();
    model_.observe(observation);
    fixes_.push_back(
        {place, {outputs[x_output_], outputs[y_output_]}, {measured[x_output_], measured[y_output_]}, gone});
  }

  /// Finds the pose of a node from the position fixes around it.
  bool fit(int node, Pose& pose) {
    for (double reach = shortest_reach; reach <= longest_reach; reach *= 2.0) {
      const auto from = std::partition_point(fixes_.begin(), fixes_.end(),
                                             [&](const PositionFix& fix) { return fix.gone < gone_[node] - reach; });
      const auto to = std::partition_point(from, fixes_.end(),
                                           [&](const PositionFix& fix) { return fix.gone <= gone_[node] + reach; });
      if (to - from < fewest_fixes || !surrounds(from->place, (to - 1)->place, node)) continue;
      weights_.assign(static_cast<std::size_t>(to - from), 1.0);
      Point turn, shift;
      double spread = 0.0;
      for (int round = 0; round < reweightings; ++round) {
        double sum = 0.0, square = 0.0;
        Point from_mean, to_mean, cross;
        for (auto fix = from; fix != to; ++fix) {
          const double w = weights_[fix - from];
          sum += w;
          from_mean += w * fix->observed;
          to_mean += w * fix->measured;
        }
        from_mean /= sum;
        to_mean /= sum;
        for (auto fix = from; fix != to; ++fix) {
          const double w = weights_[fix - from];
          const Point offset = fix->observed - from_mean;
          cross += w * std::conj(offset) * (fix->measured - to_mean);
          square += w * std::norm(offset);
        }
        spread = std::sqrt(square / sum);
        if (!(spread > 0.0)) break;
        turn = cross / square;
        shift = to_mean - turn * from_mean;
        for (auto fix = from; fix != to; ++fix)
          weights_[fix - from] =
              1.0 / std::max(std::abs(turn * fix->observed + shift - fix->measured), 1e-3 * least_spread);
      }
      if (!(spread > least_spread)) continue;
      if (!(std::abs(turn) > least_stretch && std::abs(turn) < most_stretch)) return false;
      pose.position = turn * chain_[node].position + shift;
      pose.heading = chain_[node].heading + std::arg(turn);
      return true;
    }
    return false;
  }

  /// A piece determines the poses between its fixes, not beyond.
  bool surrounds(double first, double last, int node) const {
    return (first <= node || node == 0 || first == fixes_.front().place) &&
           (last >= node || last == fixes_.back().place);
  }

  void close_gap(int start, int end, Point reached, std::vector<Pose>& poses) {
    const Point from = poses[start].position, was = reached - from, is = poses[end].position - from;
    if (!(std::abs(is - was) > least_jump)) return;
    const Point factor = is / was;
    if (!(std::abs(factor) > least_stretch && std::abs(factor) < most_stretch)) return;
    for (int i = start; i < end; ++i) {
      poses[i].position = from + factor * (poses[i].position - from);
      poses[i].heading += std::arg(factor);
      for (const int j : driving_inputs_)
        inputs_[static_cast<std::ptrdiff_t>(i) * model_.input_count() + j] *= std::abs(factor);
      for (const int j : driving_states_) state(i)[j] *= std::abs(factor);
    }
  }

  const RheProblem& problem_;
  const Model& model_;
  const Roles& roles_;
  std::vector<double>& states_;
  std::vector<double>& inputs_;
  const std::vector<double>& parameters_;
  int count_;
  std::vector<int> driving_states_, driving_inputs_;
  int x_output_ = -1, y_output_ = -1;
  std::vector<Pose> motions_, chain_;  ///< per interval, relative to its start; chained from the origin
  std::vector<double> gone_;           ///< distance travelled along the chain [m]
  std::vector<PositionFix> fixes_;
  std::vector<double> weights_, next_;
};

}  // namespace

void align_track(const RheProblem& problem, const Model& vehicle, std::vector<double>& states,
                 std::vector<double>& inputs, const std::vector<double>& parameters) {
  AlignedTrack(problem, vehicle, states, inputs, parameters).align();
}

}  // namespace rhec
