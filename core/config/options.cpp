#include "rhec/core/config/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace rhec {
namespace {

/// The number of letters to insert, drop, change or swap with a neighbour to turn one word into the other.
std::size_t edit_distance(std::string_view from, std::string_view to) {
  std::vector<std::size_t> before_last, last(to.size() + 1), row(to.size() + 1);
  for (std::size_t j = 0; j <= to.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= from.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (from[i - 1] != to[j - 1])});
      const bool swapped = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
      if (swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
    before_last = last;
    last = row;
  }
  return last[to.size()];
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string near = nearest(word, candidates);
  return near.empty() ? std::string() : fmt::format("; did you mean '{}'?", near);
}

}  // namespace

std::string Range::text() const {
  const bool has_lower = std::isfinite(lower), has_upper = std::isfinite(upper);
  const std::string_view lower_word = lower_is_open ? "greater than" : "at least";
  if (has_lower && has_upper && !lower_is_open) return fmt::format("between {} and {}", lower, upper);
  if (has_lower && has_upper) return fmt::format("{} {}, at most {}", lower_word, lower, upper);
  if (has_lower) return fmt::format("{} {}", lower_word, lower);
  if (has_upper) return fmt::format("at most {}", upper);
  return {};
}

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  std::string best;
  // If more than a third of the letters differ, it is another word, not a typing error.
  std::size_t fewest = std::max<std::size_t>(1, (word.size() + 2) / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < fewest) {
      fewest = distance;
      best = candidate;
    }
  }
  if (!best.empty() || word.size() < 3) return best;
  // Or it is a part of a longer name: the shortest one then.
  for (const std::string& candidate : candidates)
    if (candidate.find(word) != std::string::npos && (best.empty() || candidate.size() < best.size())) best = candidate;
  return best;
}

Error wrong_option(const Settings& at, const std::string& type, const std::string& constraint,
                   const OptionContext& context) {
  const std::string_view article = type.find_first_of("aeiou") == 0 ? "an" : "a";
  return at.error(fmt::format("found {}, expected {} {}{}{} ({}: {})", at.found(), article, type,
                              constraint.empty() ? "" : ", ", constraint, context.owner, context.meaning));
}

void check_keys(const Settings& from, const std::vector<std::string>& known, std::string_view owner,
                std::initializer_list<std::string_view> skip) {
  if (from.is_null()) return;
  if (from.kind() != Settings::Kind::map) throw from.mismatch(fmt::format("a map with the options of {}", owner));
  for (const auto& [key, value] : from.members()) {
    const bool is_known = std::find(known.begin(), known.end(), key) != known.end();
    const bool is_skipped = std::find(skip.begin(), skip.end(), key) != skip.end();
    if (is_known || is_skipped) continue;
    if (known.empty()) throw value.error(fmt::format("{} has no options; remove '{}'", owner, key));
    throw value.error(fmt::format("{} has no option '{}'{} Its options are: {}", owner, key,
                                  nearest(key, known).empty() ? "." : suggestion(key, known), fmt::join(known, ", ")));
  }
}

void check_old_names(const Settings& from, const std::vector<std::pair<std::string, std::string>>& renamed,
                     std::string_view owner) {
  for (const auto& [old_name, new_name] : renamed)
    if (const Settings* value = from.find(old_name))
      throw value->error(fmt::format("'{}' of {} is called '{}' now; rename the key", old_name, owner, new_name));
}

void check_new_name(const std::string& name, const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), name) == known.end()) return;
  throw Error(fmt::format("an option table has the name '{}' twice; give each option a name of its own", name));
}

double NumberValue::read(const Settings& from, const OptionContext& context) const {
  const auto value = from.number();
  if (!value || !range.contains(*value)) throw wrong_option(from, type(), constraint(), context);
  if (std::isinf(*value)) {
    if (!range.may_be_infinite) throw wrong_option(from, "finite number", constraint(), context);
    return *value;
  }
  const double magnitude = std::abs(*value);
  if (magnitude > 0.0 && !(magnitude >= Range::least_magnitude && magnitude <= Range::most_magnitude))
    throw wrong_option(from,
                       fmt::format("number{} of a magnitude between {:g} and {:g}", range.contains(0.0) ? ", 0 or" : "",
                                   Range::least_magnitude, Range::most_magnitude),
                       constraint(), context);
  return *value;
}

std::string NumberValue::print(double value) const {
  return std::isinf(value) ? (value > 0 ? ".inf" : "-.inf") : fmt::format("{}", value);
}

int IntegerValue::read(const Settings& from, const OptionContext& context) const {
  const auto value = from.integer();
  if (!value || !range.contains(*value)) throw wrong_option(from, type(), constraint(), context);
  return *value;
}

bool FlagValue::read(const Settings& from, const OptionContext& context) const {
  const auto value = from.flag();
  if (!value) throw wrong_option(from, type(), constraint(), context);
  return *value;
}

std::string TextValue::read(const Settings& from, const OptionContext& context) const {
  if (from.kind() != Settings::Kind::scalar) throw wrong_option(from, type(), constraint(), context);
  return from.text();
}

std::size_t read_choice(const Settings& from, const std::vector<std::string>& names, const OptionContext& context) {
  const auto at = std::find(names.begin(), names.end(), from.text());
  if (from.kind() == Settings::Kind::scalar && at != names.end()) return static_cast<std::size_t>(at - names.begin());
  const std::string hint = from.kind() == Settings::Kind::scalar ? suggestion(from.text(), names) : std::string();
  throw from.error(fmt::format("found {}, expected {} ({}: {}){}", from.found(), one_of(names), context.owner,
                               context.meaning, hint));
}

std::string one_of(const std::vector<std::string>& names) { return fmt::format("one of {}", fmt::join(names, ", ")); }

}  // namespace rhec
