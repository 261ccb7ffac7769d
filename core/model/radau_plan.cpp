#include "radau_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace rhec {
namespace {

constexpr int stages = RadauMethod::stages;

void join(std::vector<char>& to, const std::vector<char>& from) {
  for (std::size_t c = 0; c < to.size(); ++c) to[c] |= from[c];
}

std::uint32_t number(int index) { return static_cast<std::uint32_t>(index); }

}  // namespace

RadauMethod::RadauMethod() : nodes{}, inverse{}, sums{} {
  const double root = std::sqrt(6.0);
  nodes = {(4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0};
  const std::array<std::array<double, 3>, 3> A{
      {{(88.0 - 7.0 * root) / 360.0, (296.0 - 169.0 * root) / 1800.0, (-2.0 + 3.0 * root) / 225.0},
       {(296.0 + 169.0 * root) / 1800.0, (88.0 + 7.0 * root) / 360.0, (-2.0 - 3.0 * root) / 225.0},
       {(16.0 - root) / 36.0, (16.0 + root) / 36.0, 1.0 / 9.0}}};
  // Its determinant is 1/60; the inverse by cofactors.
  for (std::size_t s = 0; s < 3; ++s) {
    for (std::size_t t = 0; t < 3; ++t) {
      const std::size_t r0 = (t + 1) % 3, r1 = (t + 2) % 3, c0 = (s + 1) % 3, c1 = (s + 2) % 3;
      inverse[s][t] = 60.0 * (A[r0][c0] * A[r1][c1] - A[r0][c1] * A[r1][c0]);
      sums[s] += inverse[s][t];
    }
  }
}

RadauPlan::RadauPlan(const RatesStructure& of, bool ramp, bool single)
    : of_(of), ramp_(ramp), single_(single), nz_(of.na() + (ramp ? of.np : 0)) {
  plan_order();
  plan_fill();
  plan_places();
  plan_newton();
  plan_factors();
  plan_sensitivities();
  plan_adjoints();
  plan_curvature();
}

/// Next comes the state whose elimination fills least (Markowitz 1957).
void RadauPlan::plan_order() {
  const auto n = static_cast<std::size_t>(of_.nx);
  std::vector<Pattern> left(n, Pattern(n, 0));
  for (std::size_t r = 0; r < n; ++r) left[r][r] = 1;
  for (const auto& [r, c] : of_.slopes)
    if (c < of_.nx) left[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] = 1;
  std::vector<char> is_done(n, 0);
  position_.assign(n, 0);
  for (std::size_t step = 0; step < n; ++step) {
    std::size_t best = n;
    long least = std::numeric_limits<long>::max();
    for (std::size_t k = 0; k < n; ++k) {
      if (is_done[k]) continue;
      long in_row = 0, in_column = 0;
      for (std::size_t j = 0; j < n; ++j) {
        if (is_done[j] || j == k) continue;
        in_row += left[k][j];
        in_column += left[j][k];
      }
      if (in_row * in_column >= least) continue;
      least = in_row * in_column;
      best = k;
    }
    is_done[best] = 1;
    position_[best] = static_cast<int>(step);
    order_.push_back(static_cast<int>(best));
    for (std::size_t r = 0; r < n; ++r)
      if (!is_done[r] && left[r][best]) join(left[r], left[best]);
  }
}

/// Where the factors of M are not zero.
void RadauPlan::plan_fill() {
  const auto size = static_cast<std::size_t>(unknowns());
  fill_.assign(size, Pattern(size, 0));
  for (int i = 0; i < of_.nx; ++i)
    for (int s = 0; s < stages; ++s)
      for (int t = 0; t < stages; ++t)
        fill_[static_cast<std::size_t>(unknown(i, s))][static_cast<std::size_t>(unknown(i, t))] = 1;
  for (const auto& [r, c] : of_.slopes)
    for (int s = 0; s < stages && c < of_.nx; ++s)
      fill_[static_cast<std::size_t>(unknown(r, s))][static_cast<std::size_t>(unknown(c, s))] = 1;
  for (std::size_t k = 0; k < size; ++k)
    for (std::size_t i = k + 1; i < size; ++i)
      if (fill_[i][k])
        for (std::size_t j = k + 1; j < size; ++j) fill_[i][j] |= fill_[k][j];
}

std::uint32_t RadauPlan::offset(int q, int r) const {
  return offsets_[static_cast<std::size_t>(q)][static_cast<std::size_t>(r)];
}

void RadauPlan::plan_places() {
  std::uint32_t next_place = 0;
  const auto take = [&](int size) { return std::exchange(next_place, next_place + number(size)); };
  const auto take_3 = [&](int size) {
    std::array<std::uint32_t, 3> places{};
    for (std::uint32_t& place : places) place = take(size);
    return places;
  };
  const int nx = of_.nx, na = of_.na(), size = unknowns();
  at_.zero = take(1);
  at_.one = take(1);
  at_.inverse = take(9);
  at_.minus_inverse = take(9);
  at_.sums = take(3);
  at_.h = take(1);
  at_.minus_h = take(1);
  for (std::uint32_t* place : {&at_.h_run, &at_.h_rest, &at_.run, &at_.rest}) *place = take(3);
  at_.z = take(nz_);
  for (std::uint32_t* place : {&at_.x, &at_.next, &at_.weights, &at_.next_weights}) *place = take(nx);
  for (std::uint32_t* place : {&at_.moves, &at_.base, &at_.tried, &at_.residual, &at_.pushed, &at_.newton, &at_.pulled,
                               &at_.adjoints, &at_.pivots, &at_.minus_pivots})
    *place = take(size);
  at_.sum = take(1);
  at_.arguments = take_3(na);
  at_.rates = take_3(nx);
  at_.slopes = take_3(static_cast<int>(of_.slopes.size()));
  at_.stage_weights = take_3(nx);
  at_.bends = take(static_cast<int>(of_.bends.size()));
  std::uint32_t filled = 0;
  for (const Pattern& row : fill_) {
    offsets_.emplace_back(row.size(), 0);
    for (std::size_t c = 0; c < row.size(); ++c)
      if (row[c]) offsets_.back()[c] = filled++;
  }
  at_.matrix_size = filled;
  at_.matrix = take(static_cast<int>(filled));
  at_.upper = take(static_cast<int>(filled));
  at_.right = take(size * nz_);
  at_.moved = take(size * nz_);
  at_.moved_start = take(nx * nz_);
  at_.bent = take(na * nz_);
  at_.hessian = take(nz_ * nz_);
  at_.count = next_place;
}

void RadauPlan::plan_newton() {
  const std::uint32_t nx = number(of_.nx), np = number(of_.np), nu = number(of_.nu), na = number(of_.na());
  const auto product = [](List& to, std::uint32_t factor, std::uint32_t from, std::uint32_t sum, std::uint32_t size) {
    if (size > 0) to.push_back({factor, from, sum, size});
  };
  constexpr std::uint32_t none = SparseProduct::none;
  for (int stage = 0; stage < stages; ++stage) {
    const std::uint32_t s = number(stage), a = at_.arguments[s], p = a + nx, u = p + np;
    List& list = arguments_[s];
    product(list, none, 0, a, na);
    product(list, at_.one, at_.x, a, nx);
    for (int i = 0; i < of_.nx; ++i) product(list, at_.one, at_.moves + number(unknown(i, stage)), a + number(i), 1);
    product(list, ramp_ ? at_.rest + s : at_.one, at_.z + nx, p, np);
    if (ramp_) product(list, at_.run + s, at_.z + na, p, np);
    product(list, at_.one, at_.z + nx + np, u, nu);
  }
  product(residual_, none, 0, at_.residual, number(unknowns()));
  product(matrix_, none, 0, at_.matrix, at_.matrix_size);
  for (int i = 0; i < of_.nx; ++i) {
    for (int s = 0; s < stages; ++s) {
      const int q = unknown(i, s);
      product(residual_, at_.h, at_.rates[number(s)] + number(i), at_.residual + number(q), 1);
      for (int t = 0; t < stages; ++t)
        product(residual_, at_.minus_inverse + number(stages * s + t), at_.moves + number(unknown(i, t)),
                at_.residual + number(q), 1);
      product(matrix_, at_.one, at_.inverse + number(stages * s), entry(q, unknown(i, 0)), stages);
    }
  }
  for (std::size_t e = 0; e < of_.slopes.size(); ++e) {
    const auto& [r, c] = of_.slopes[e];
    for (int s = 0; s < stages && c < of_.nx; ++s)
      product(matrix_, at_.minus_h, at_.slopes[number(s)] + static_cast<std::uint32_t>(e),
              entry(unknown(r, s), unknown(c, s)), 1);
  }
  product(next_, none, 0, at_.next, nx);
  product(next_, at_.one, at_.x, at_.next, nx);
  for (int i = 0; i < of_.nx; ++i)
    product(next_, at_.one, at_.moves + number(unknown(i, stages - 1)), at_.next + number(i), 1);
}

/// M = L U with ones on L's diagonal. In the place of L_ik stands -L_ik; U = D (I - V), and V stands in `upper`.
void RadauPlan::plan_factors() {
  const int size = unknowns();
  // Entries of two rows that both follow each other.
  const auto runs = [&](int q, int other, auto use) {
    for (int first = q + 1; first < size;) {
      if (!has(q, first)) {
        ++first;
        continue;
      }
      int end = first + 1;
      while (end < size && has(q, end) && offset(other, end) == offset(other, end - 1) + 1) ++end;
      use(first, end - first);
      first = end;
    }
  };
  for (int q = 0; q < size; ++q) {
    diagonal_.push_back(entry(q, q));
    List list;
    const std::uint32_t minus = at_.minus_pivots + number(q);
    runs(q, q, [&](int first, int count) {
      list.push_back({SparseProduct::none, 0, at_.upper + offset(q, first), number(count)});
      list.push_back({minus, entry(q, first), at_.upper + offset(q, first), number(count)});
    });
    // U's row times -L_iq = M_iq times V's row.
    for (int i = q + 1; i < size; ++i)
      if (has(i, q))
        runs(q, i, [&](int first, int count) {
          list.push_back({entry(i, q), at_.upper + offset(q, first), entry(i, first), number(count)});
        });
    eliminate_.push_back(std::move(list));
  }
  // Forward with -L_iq = M_iq (-1 / pivot), which `pushed` holds of the right side.
  solve_.push_back({SparseProduct::none, 0, at_.pushed, number(size)});
  solve_.push_back({SparseProduct::none, 0, at_.newton, number(size)});
  for (int q = 0; q < size; ++q) {
    solve_.push_back({at_.minus_pivots + number(q), at_.residual + number(q), at_.pushed + number(q), 1});
    for (int i = q + 1; i < size; ++i)
      if (has(i, q)) solve_.push_back({at_.pushed + number(q), entry(i, q), at_.residual + number(i), 1});
  }
  for (int q = size - 1; q >= 0; --q) {
    const std::uint32_t to = at_.newton + number(q);
    solve_.push_back({at_.pivots + number(q), at_.residual + number(q), to, 1});
    for (int r = q + 1; r < size; ++r)
      if (has(q, r)) solve_.push_back({at_.upper + offset(q, r), at_.newton + number(r), to, 1});
  }
}

std::vector<RadauPlan::Part> RadauPlan::parts(const Pattern& pattern, std::uint32_t first) {
  std::vector<Part> found;
  for (int c = 0; c < static_cast<int>(pattern.size()); ++c) {
    if (!pattern[static_cast<std::size_t>(c)]) continue;
    if (found.empty() || found.back().column + found.back().count < c)
      found.push_back({first + number(c), c, 1});
    else
      ++found.back().count;
  }
  return found;
}

void RadauPlan::add(List& to, std::uint32_t factor, const std::vector<Part>& row, std::uint32_t sum, int limit) {
  for (const Part& part : row)
    if (const int count = std::min(part.count, limit - part.column); count > 0)
      to.push_back({factor, part.from, sum + number(part.column), number(count)});
}

/// dx/dz at a step's start, where several steps follow each other: what any of them can reach.
std::vector<RadauPlan::Pattern> RadauPlan::closed() const {
  std::vector<Pattern> pattern(static_cast<std::size_t>(of_.nx), Pattern(static_cast<std::size_t>(nz_), 0));
  for (std::size_t r = 0; r < pattern.size(); ++r) pattern[r][r] = 1;
  for (bool changes = true; changes;) {
    const std::vector<Pattern> before = pattern;
    for (const auto& [r, c] : of_.slopes) {
      Pattern& into = pattern[static_cast<std::size_t>(r)];
      if (c < of_.nx) {
        join(into, pattern[static_cast<std::size_t>(c)]);
        continue;
      }
      into[static_cast<std::size_t>(c)] = 1;
      if (ramp_ && c < of_.nx + of_.np) into[static_cast<std::size_t>(of_.na() + c - of_.nx)] = 1;
    }
    changes = pattern != before;
  }
  return pattern;
}

void RadauPlan::plan_sensitivities() {
  const int size = unknowns(), nx = of_.nx;
  const Pattern none(static_cast<std::size_t>(nz_), 0);
  const std::vector<Pattern> reachable = closed();
  std::vector<Pattern> rows(static_cast<std::size_t>(size), none);
  const auto pattern_at = [&](std::vector<Pattern>& of, int q) -> Pattern& { return of[static_cast<std::size_t>(q)]; };
  // The right side.
  List right;
  for (int i = 0; i < nx; ++i) {
    for (int s = 0; s < stages; ++s) {
      const int q = unknown(i, s);
      if (single_) {
        pattern_at(rows, q)[static_cast<std::size_t>(i)] = 1;
        right.push_back({at_.sums + number(s), at_.one, row(at_.right, q) + number(i), 1});
      } else {
        join(pattern_at(rows, q), reachable[static_cast<std::size_t>(i)]);
        add(right, at_.sums + number(s), parts(reachable[static_cast<std::size_t>(i)], row(at_.moved_start, i)),
            row(at_.right, q), nz_);
      }
    }
  }
  for (std::size_t e = 0; e < of_.slopes.size(); ++e) {
    const auto& [r, c] = of_.slopes[e];
    for (int s = 0; s < stages && c >= nx; ++s) {
      const int q = unknown(r, s);
      const std::uint32_t slope = at_.slopes[number(s)] + static_cast<std::uint32_t>(e);
      const bool is_ramped = ramp_ && c < nx + of_.np;
      const auto to = [&](int column, std::uint32_t factor) {
        pattern_at(rows, q)[static_cast<std::size_t>(column)] = 1;
        right.push_back({factor, slope, row(at_.right, q) + number(column), 1});
      };
      to(c, is_ramped ? at_.h_rest + number(s) : at_.h);
      if (is_ramped) to(of_.na() + c - nx, at_.h_run + number(s));
    }
  }
  // Forward, as in `solve`; the multiple -1 / pivot of a row is held in its place among the results.
  List forward;
  for (int q = 0; q < size; ++q) {
    bool is_used = false;
    for (int i = q + 1; i < size; ++i) is_used |= has(i, q);
    if (!is_used) continue;
    add(forward, SparseProduct::none, parts(pattern_at(rows, q), 0), row(at_.moved, q), nz_);
    add(forward, at_.minus_pivots + number(q), parts(pattern_at(rows, q), row(at_.right, q)), row(at_.moved, q), nz_);
    for (int i = q + 1; i < size; ++i) {
      if (!has(i, q)) continue;
      join(pattern_at(rows, i), pattern_at(rows, q));
      add(forward, entry(i, q), parts(pattern_at(rows, q), row(at_.moved, q)), row(at_.right, i), nz_);
    }
  }
  reached_ = rows;
  List backward;
  for (int q = size - 1; q >= 0; --q) {
    for (int r = q + 1; r < size; ++r)
      if (has(q, r)) join(pattern_at(reached_, q), pattern_at(reached_, r));
    add(backward, SparseProduct::none, parts(pattern_at(reached_, q), 0), row(at_.moved, q), nz_);
    add(backward, at_.pivots + number(q), parts(pattern_at(rows, q), row(at_.right, q)), row(at_.moved, q), nz_);
    for (int r = q + 1; r < size; ++r)
      if (has(q, r))
        add(backward, at_.upper + offset(q, r), parts(pattern_at(reached_, r), row(at_.moved, r)), row(at_.moved, q),
            nz_);
  }
  for (int q = 0; q < size; ++q)
    add(sensitivities_, SparseProduct::none, parts(pattern_at(rows, q), 0), row(at_.right, q), nz_);
  for (const List* list : {&right, &forward, &backward})
    sensitivities_.insert(sensitivities_.end(), list->begin(), list->end());
  moved_.assign(static_cast<std::size_t>(nx) * static_cast<std::size_t>(nz_), at_.zero);
  for (int i = 0; i < nx; ++i) {
    const int q = unknown(i, stages - 1);
    for (int c = 0; c < nz_; ++c)
      if (pattern_at(reached_, q)[static_cast<std::size_t>(c)]) moved_[cell(i, c)] = row(at_.moved, q) + number(c);
  }
}

/// M' mu = [0; 0; w] with M = L D (I - V).
void RadauPlan::plan_adjoints() {
  const int size = unknowns();
  List& list = adjoints_;
  list.push_back({SparseProduct::none, 0, at_.pulled, number(size)});
  for (int i = 0; i < of_.nx; ++i)
    list.push_back({at_.one, at_.weights + number(i), at_.pulled + number(unknown(i, stages - 1)), 1});
  for (int q = 0; q < size; ++q)
    for (int r = q + 1; r < size; ++r)
      if (has(q, r)) list.push_back({at_.pulled + number(q), at_.upper + offset(q, r), at_.pulled + number(r), 1});
  // mu_q = (1 / pivot) (pulled_q - sum over i > q of M_iq mu_i), with M_iq of the elimination.
  list.push_back({SparseProduct::none, 0, at_.adjoints, number(size)});
  for (int q = size - 1; q >= 0; --q) {
    const std::uint32_t to = at_.adjoints + number(q);
    list.push_back({at_.pivots + number(q), at_.pulled + number(q), to, 1});
    bool is_used = false;
    for (int i = q + 1; i < size; ++i) is_used |= has(i, q);
    if (!is_used) continue;
    list.push_back({SparseProduct::none, 0, at_.sum, 1});
    for (int i = q + 1; i < size; ++i)
      if (has(i, q)) list.push_back({entry(i, q), at_.adjoints + number(i), at_.sum, 1});
    list.push_back({at_.minus_pivots + number(q), at_.sum, to, 1});
  }
  list.push_back({SparseProduct::none, 0, at_.next_weights, number(of_.nx)});
  for (int s = 0; s < stages; ++s) {
    list.push_back({SparseProduct::none, 0, at_.stage_weights[number(s)], number(of_.nx)});
    for (int i = 0; i < of_.nx; ++i) {
      const std::uint32_t from = at_.adjoints + number(unknown(i, s));
      list.push_back({at_.h, from, at_.stage_weights[number(s)] + number(i), 1});
      list.push_back({at_.sums + number(s), from, at_.next_weights + number(i), 1});
    }
  }
}

/// Row a of D_s.
std::vector<RadauPlan::Part> RadauPlan::argument_row(int a, int s) const {
  if (a < of_.nx) {
    const int q = unknown(a, s);
    return parts(reached_[static_cast<std::size_t>(q)], row(at_.moved, q));
  }
  if (ramp_ && a < of_.nx + of_.np)
    return {{at_.rest + number(s), a, 1}, {at_.run + number(s), of_.na() + a - of_.nx, 1}};
  return {{at_.one, a, 1}};
}

void RadauPlan::plan_curvature() {
  const auto na = static_cast<std::size_t>(of_.na());
  std::vector<Pattern> filled(static_cast<std::size_t>(nz_), Pattern(static_cast<std::size_t>(nz_), 0));
  for (int s = 0; s < stages; ++s) {
    List& list = curvature_[number(s)];
    std::vector<std::vector<Part>> rows;
    rows.reserve(na);
    for (int a = 0; a < of_.na(); ++a) rows.push_back(argument_row(a, s));
    std::vector<Pattern> bent(na, Pattern(static_cast<std::size_t>(nz_), 0));
    List products;
    for (std::size_t e = 0; e < of_.bends.size(); ++e) {
      const auto& [r, c] = of_.bends[e];
      const auto bend = [&](int a, int b) {
        for (const Part& part : rows[static_cast<std::size_t>(b)])
          std::fill_n(bent[static_cast<std::size_t>(a)].begin() + part.column, part.count, 1);
        add(products, at_.bends + static_cast<std::uint32_t>(e), rows[static_cast<std::size_t>(b)], row(at_.bent, a),
            nz_);
      };
      bend(r, c);
      if (r != c) bend(c, r);
    }
    for (int a = 0; a < of_.na(); ++a)
      add(list, SparseProduct::none, parts(bent[static_cast<std::size_t>(a)], 0), row(at_.bent, a), nz_);
    list.insert(list.end(), products.begin(), products.end());
    for (int a = 0; a < of_.na(); ++a) {
      const Pattern& pattern = bent[static_cast<std::size_t>(a)];
      const std::vector<Part> bent_row = parts(pattern, row(at_.bent, a));
      for (const Part& part : rows[static_cast<std::size_t>(a)]) {
        for (int k = 0; k < part.count; ++k) {
          const int r = part.column + k;
          add(list, part.from + number(k), bent_row, row(at_.hessian, r), r + 1);
          for (int c = 0; c <= r; ++c)
            filled[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] |= pattern[static_cast<std::size_t>(c)];
        }
      }
    }
  }
  hessian_.assign(static_cast<std::size_t>(nz_) * static_cast<std::size_t>(nz_), at_.zero);
  for (int r = 0; r < nz_; ++r)
    for (int c = 0; c <= r; ++c)
      if (filled[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)])
        hessian_[cell(r, c)] = hessian_[cell(c, r)] = row(at_.hessian, r) + number(c);
}

long RadauPlan::count(const List& list) {
  long sum = 0;
  for (const SparseProduct& product : list)
    if (product.factor != SparseProduct::none) sum += product.count;
  return sum;
}

long RadauPlan::iteration_operations() const {
  long sum = count(residual_) + count(matrix_) + count(solve_);
  for (const List& list : arguments_) sum += count(list);
  for (const List& list : eliminate_) sum += count(list) + 1;
  return sum;
}

long RadauPlan::hessian_operations() const {
  long sum = count(adjoints_);
  for (const List& list : curvature_) sum += count(list);
  return sum;
}

}  // namespace rhec
