#include "chain_rule.hpp"

#include <algorithm>
#include <cstddef>

namespace rhec {
namespace {

/// The columns of `from` join those of `to`.
void join(std::vector<char>& to, const std::vector<char>& from) {
  for (std::size_t c = 0; c < to.size(); ++c) to[c] |= from[c];
}

std::uint32_t number(int index) { return static_cast<std::uint32_t>(index); }

}  // namespace

ChainRulePlaces::ChainRulePlaces(const RatesStructure& of, bool has_ramp)
    : ramp(has_ramp), nx(of.nx), np(of.np), nu(of.nu), na(of.na()), nz(of.na() + (has_ramp ? of.np : 0)) {
  std::uint32_t next_place = 0;
  const auto take = [&](std::size_t size) {
    return std::exchange(next_place, next_place + static_cast<std::uint32_t>(size));
  };
  const auto states = static_cast<std::size_t>(nx), matrix = states * static_cast<std::size_t>(nz);
  const auto take_4 = [&](std::size_t size) {
    std::array<std::uint32_t, 4> places{};
    for (std::uint32_t& place : places) place = take(size);
    return places;
  };
  zero = take(1);
  one = take(1);
  share = take(4);
  reach = take(4);
  run = take(4);
  rest = take(4);
  z = take(static_cast<std::size_t>(nz));
  x = take(states);
  next = take(states);
  weights = take(states);
  next_weights = take(states);
  product = take(states);
  arguments = take_4(static_cast<std::size_t>(na));
  rates = take_4(states);
  slopes = take_4(of.slopes.size());
  adjoints = take_4(states);
  bends = take(of.bends.size());
  moved = take_4(matrix);
  sum = take(static_cast<std::size_t>(nz));
  moved_next = take(matrix);
  hessian = take(static_cast<std::size_t>(nz) * static_cast<std::size_t>(nz));
  for (std::uint32_t& place : bent) place = take(matrix);
  pull = take(matrix);
  pull_next = take(matrix);
  count = next_place;
}

ChainRule::ChainRule(const RatesStructure& of, const ChainRulePlaces& places, bool single)
    : of_(of), at_(places), single_(single) {
  plan_values();
  plan_adjoints();
  plan_forward();
  plan_backward();
}

/// The parts of a row of registers that begins at `first`.
std::vector<ChainRule::Part> ChainRule::parts(const std::vector<char>& pattern, std::uint32_t first) const {
  std::vector<Part> found;
  for (int c = 0; c < at_.nz; ++c) {
    if (!pattern[static_cast<std::size_t>(c)]) continue;
    if (found.empty() || found.back().column + found.back().count < c)
      found.push_back({first + number(c), c, 1});
    else
      ++found.back().count;
  }
  return found;
}

ChainRule::Pattern ChainRule::pattern_of(const Rows& rows) const {
  Pattern pattern(rows.size(), std::vector<char>(static_cast<std::size_t>(at_.nz), 0));
  for (std::size_t r = 0; r < rows.size(); ++r)
    for (const Part& part : rows[r]) std::fill_n(pattern[r].begin() + part.column, part.count, 1);
  return pattern;
}

/// dx/dz at a step's start, where several steps follow each other: what any of them can reach.
ChainRule::Pattern ChainRule::closed() const {
  Pattern pattern(static_cast<std::size_t>(at_.nx), std::vector<char>(static_cast<std::size_t>(at_.nz), 0));
  for (int r = 0; r < at_.nx; ++r) pattern[static_cast<std::size_t>(r)][static_cast<std::size_t>(r)] = 1;
  for (bool changes = true; changes;) {
    const Pattern before = pattern;
    const Pattern moved_by = pattern_of(stage(3, pattern));
    for (const auto& [r, c] : of_.slopes)
      join(pattern[static_cast<std::size_t>(r)], moved_by[static_cast<std::size_t>(c)]);
    changes = pattern != before;
  }
  return pattern;
}

/// The rows of da_k/dz, whose states have a pattern.
ChainRule::Rows ChainRule::stage(int k, const Pattern& states) const {
  Rows rows;
  for (int r = 0; r < at_.nx; ++r) {
    if (single_ && k == 0)
      rows.push_back({{at_.one, r, 1}});
    else
      rows.push_back(parts(states[static_cast<std::size_t>(r)], at_.entry(at_.moved[k], r, 0)));
  }
  for (int c = at_.nx; c < at_.na; ++c) {
    if (at_.ramp && c < at_.nx + at_.np)
      rows.push_back({{at_.rest + number(k), c, 1}, {at_.run + number(k), at_.na + c - at_.nx, 1}});
    else
      rows.push_back({{at_.one, c, 1}});
  }
  return rows;
}

/// The row `sum` += factor * row, in the columns before `limit`.
void ChainRule::add(List& to, std::uint32_t factor, const std::vector<Part>& row, std::uint32_t sum, int limit) const {
  for (const Part& part : row)
    if (const int count = std::min(part.count, limit - part.column); count > 0)
      to.push_back({factor, part.from, sum + number(part.column), number(count)});
}

void ChainRule::clear(List& to, const std::vector<char>& pattern, std::uint32_t sum, int limit) const {
  add(to, SparseProduct::none, parts(pattern, 0), sum, limit);
}

void ChainRule::plan_values() {
  const std::uint32_t nx = number(at_.nx), np = number(at_.np), nu = number(at_.nu), na = number(at_.na);
  const auto add = [](List& to, std::uint32_t factor, std::uint32_t from, std::uint32_t sum, std::uint32_t count) {
    if (count > 0) to.push_back({factor, from, sum, count});
  };
  for (std::uint32_t k = 0; k < 4; ++k) {
    List& list = arguments_[k];
    const std::uint32_t a = at_.arguments[k], p = a + nx, u = p + np;
    add(list, SparseProduct::none, 0, a, na);
    add(list, at_.one, at_.x, a, nx);
    if (k > 0) add(list, at_.reach + k, at_.rates[k - 1], a, nx);
    add(list, at_.ramp ? at_.rest + k : at_.one, at_.z + nx, p, np);
    if (at_.ramp) add(list, at_.run + k, at_.z + na, p, np);
    add(list, at_.one, at_.z + nx + np, u, nu);
  }
  add(next_, SparseProduct::none, 0, at_.next, nx);
  add(next_, at_.one, at_.x, at_.next, nx);
  for (std::uint32_t k = 0; k < 4; ++k) add(next_, at_.share + k, at_.rates[k], at_.next, nx);
}

void ChainRule::plan_adjoints() {
  const std::uint32_t nx = number(at_.nx);
  // sum += f_x(a_k)' mu_k
  const auto pull = [&](List& list, std::size_t k, std::uint32_t sum) {
    for (std::size_t e = 0; e < of_.slopes.size(); ++e) {
      const auto& [r, c] = of_.slopes[e];
      if (c < at_.nx)
        list.push_back(
            {at_.slopes[k] + static_cast<std::uint32_t>(e), at_.adjoints[k] + number(r), sum + number(c), 1});
    }
  };
  const auto begin = [&](List& list, std::uint32_t sum) { list.push_back({SparseProduct::none, 0, sum, nx}); };
  for (std::uint32_t k = 0; k < 4; ++k) {
    List& list = adjoints_[k];
    begin(list, at_.adjoints[k]);
    list.push_back({at_.share + k, at_.weights, at_.adjoints[k], nx});
    if (k == 3) continue;
    begin(list, at_.product);
    pull(list, k + 1, at_.product);
    list.push_back({at_.reach + k + 1, at_.product, at_.adjoints[k], nx});
  }
  begin(weights_, at_.next_weights);
  weights_.push_back({at_.one, at_.weights, at_.next_weights, nx});
  for (std::size_t k = 0; k < 4; ++k) pull(weights_, k, at_.next_weights);
}

void ChainRule::plan_forward() {
  const auto states = static_cast<std::size_t>(at_.nx);
  const std::vector<char> none(static_cast<std::size_t>(at_.nz), 0);
  reached_[0] = single_ ? pattern_of(stage(0, {})) : closed();
  reached_[0].resize(states);
  const Rows begin = stage(0, reached_[0]);
  // What moves f at each stage, and what has moved in the end.
  std::array<Pattern, 4> rates;
  Pattern end = reached_[0];
  for (std::size_t k = 0; k < 4; ++k) {
    const Pattern moved_by = pattern_of(stage(static_cast<int>(k), reached_[k]));
    rates[k].assign(states, none);
    for (const auto& [r, c] : of_.slopes)
      join(rates[k][static_cast<std::size_t>(r)], moved_by[static_cast<std::size_t>(c)]);
    if (k < 3) reached_[k + 1] = reached_[0];
    for (std::size_t r = 0; r < states; ++r) {
      if (k < 3) join(reached_[k + 1][r], rates[k][r]);
      join(end[r], rates[k][r]);
    }
  }
  for (std::uint32_t k = 0; k < 4; ++k) {
    List& list = forward_[k];
    const Rows from = stage(static_cast<int>(k), reached_[k]);
    std::size_t entry = 0;
    for (int r = 0; r < at_.nx; ++r) {
      const auto row = static_cast<std::size_t>(r);
      clear(list, rates[k][row], at_.sum, at_.nz);
      for (; entry < of_.slopes.size() && of_.slopes[entry].row == r; ++entry)
        add(list, at_.slopes[k] + static_cast<std::uint32_t>(entry),
            from[static_cast<std::size_t>(of_.slopes[entry].column)], at_.sum, at_.nz);
      const std::vector<Part> made = parts(rates[k][row], at_.sum);
      if (k < 3) {
        const std::uint32_t to = at_.entry(at_.moved[k + 1], r, 0);
        clear(list, reached_[k + 1][row], to, at_.nz);
        add(list, at_.one, begin[row], to, at_.nz);
        add(list, at_.reach + k + 1, made, to, at_.nz);
      }
      const std::uint32_t to = at_.entry(at_.moved_next, r, 0);
      if (k == 0) {
        clear(list, end[row], to, at_.nz);
        add(list, at_.one, begin[row], to, at_.nz);
      }
      add(list, at_.share + k, made, to, at_.nz);
    }
  }
  moved_.assign(states * static_cast<std::size_t>(at_.nz), at_.zero);
  for (int r = 0; r < at_.nx; ++r)
    for (int c = 0; c < at_.nz; ++c)
      if (end[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)])
        moved_[static_cast<std::size_t>(r) * static_cast<std::size_t>(at_.nz) + static_cast<std::size_t>(c)] =
            at_.entry(at_.moved_next, r, c);
}

void ChainRule::plan_backward() {
  const auto states = static_cast<std::size_t>(at_.nx), all = static_cast<std::size_t>(at_.na),
             variables = static_cast<std::size_t>(at_.nz);
  const std::vector<char> none(variables, 0), full(variables, 1);
  std::vector<std::vector<std::pair<int, std::uint32_t>>> bends(all),
      slopes(all);  // by row of G: other index, register
  for (std::size_t e = 0; e < of_.bends.size(); ++e) {
    const auto& [r, c] = of_.bends[e];
    const std::uint32_t at = at_.bends + static_cast<std::uint32_t>(e);
    bends[static_cast<std::size_t>(r)].emplace_back(c, at);
    if (r != c) bends[static_cast<std::size_t>(c)].emplace_back(r, at);
  }
  for (std::size_t e = 0; e < of_.slopes.size(); ++e)
    slopes[static_cast<std::size_t>(of_.slopes[e].column)].emplace_back(of_.slopes[e].row, number(static_cast<int>(e)));

  Pattern hessian(variables, none);
  Pattern bent(states, single_ ? none : full);  // of d mu_k / dz
  for (int k = 3; k >= 0; --k) {
    const auto stage_number = static_cast<std::size_t>(k);
    List& list = backward_[stage_number];
    const std::uint32_t adjoints = at_.bent[stage_number % 2], before = at_.bent[(stage_number + 1) % 2];
    const Rows from = stage(k, reached_[stage_number]);
    const Pattern moved_by = pattern_of(from);
    if (k == 3 && !single_) {
      // d mu_4 / dz, and the start of the sums.
      for (int r = 0; r < at_.nx; ++r) {
        clear(list, full, at_.entry(adjoints, r, 0), at_.nz);
        add(list, at_.share + 3, parts(full, at_.entry(at_.pull, r, 0)), at_.entry(adjoints, r, 0), at_.nz);
        clear(list, full, at_.entry(at_.pull_next, r, 0), at_.nz);
        add(list, at_.one, parts(full, at_.entry(at_.pull, r, 0)), at_.entry(at_.pull_next, r, 0), at_.nz);
      }
    }
    if (k == 3 && single_)
      for (int r = 0; r < at_.nz; ++r) clear(list, full, at_.entry(at_.hessian, r, 0), r + 1);
    Pattern bent_before(states, single_ ? none : full);
    for (std::size_t a = 0; a < all; ++a) {
      const int row = static_cast<int>(a);
      const bool is_state = row < at_.nx, is_ramp = at_.ramp && !is_state && row < at_.nx + at_.np;
      const int end = is_ramp ? at_.na + row - at_.nx : row;  // the last row of the Hessian that it belongs to
      const int limit = is_state && (k > 0 || !single_) ? at_.nz : end + 1;
      std::vector<char> pattern = none;
      for (const auto& [other, unused] : bends[a]) join(pattern, moved_by[static_cast<std::size_t>(other)]);
      for (const auto& [other, unused] : slopes[a]) join(pattern, bent[static_cast<std::size_t>(other)]);
      clear(list, pattern, at_.sum, limit);
      for (const auto& [other, at] : bends[a]) add(list, at, from[static_cast<std::size_t>(other)], at_.sum, limit);
      for (const auto& [other, entry] : slopes[a])
        add(list, at_.slopes[stage_number] + entry,
            parts(bent[static_cast<std::size_t>(other)], at_.entry(adjoints, other, 0)), at_.sum, limit);
      const std::vector<Part> made = parts(pattern, at_.sum);
      const auto to_hessian = [&](std::uint32_t factor, int r) {
        add(list, factor, made, at_.entry(at_.hessian, r, 0), r + 1);
        join(hessian[static_cast<std::size_t>(r)], pattern);
      };
      if (is_ramp) {
        to_hessian(at_.rest + number(k), row);
        to_hessian(at_.run + number(k), end);
      } else if (!is_state || single_) {
        to_hessian(at_.one, row);
      } else {
        add(list, at_.one, made, at_.entry(at_.pull_next, row, 0), at_.nz);
      }
      if (!is_state || k == 0) continue;
      // d mu_{k-1} / dz
      const std::uint32_t to = at_.entry(before, row, 0);
      if (single_) {
        bent_before[a] = pattern;
        clear(list, pattern, to, at_.nz);
      } else {
        clear(list, full, to, at_.nz);
        add(list, at_.share + number(k) - 1, parts(full, at_.entry(at_.pull, row, 0)), to, at_.nz);
      }
      add(list, at_.reach + number(k), made, to, at_.nz);
    }
    bent = bent_before;
  }
  hessian_.assign(variables * variables, at_.zero);
  for (int r = 0; r < at_.nz; ++r) {
    for (int c = 0; c <= r; ++c) {
      const bool is_state = r < at_.nx && !single_;
      if (!is_state && !hessian[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)]) continue;
      const std::uint32_t at = at_.entry(is_state ? at_.pull : at_.hessian, r, c);
      hessian_[static_cast<std::size_t>(r) * variables + static_cast<std::size_t>(c)] = at;
      hessian_[static_cast<std::size_t>(c) * variables + static_cast<std::size_t>(r)] = at;
    }
  }
}

long ChainRule::operations(bool with_hessian) const {
  long sum = 0;
  const auto count = [&](const List& list) {
    for (const SparseProduct& product : list)
      if (product.factor != SparseProduct::none) sum += product.count;
  };
  count(next_);
  for (std::size_t k = 0; k < 4; ++k) {
    count(arguments_[k]);
    count(forward_[k]);
    if (!with_hessian) continue;
    count(adjoints_[k]);
    count(backward_[k]);
  }
  return sum;
}

}  // namespace rhec
