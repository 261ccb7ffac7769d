#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/formula/tape.hpp"

namespace rhec {

/// A formula lists its options, if it has any, for whoever visits them:
///
///     template <class Scalar>
///     struct Bicycle {
///       Scalar wheelbase{1.4};  ///< [m]
///       int trailers = 0;
///       template <class Visitor>
///       void options(Visitor&& option) {
///         option("wheelbase", wheelbase, "distance of the axles [m]", greater_than(0.0));
///         option("trailers", trailers, "how many are drawn", between(0, 3));
///       }
///       ...
///
/// Those of type Scalar are inputs of the formula's graph, so that compiled kernels serve every value. Those of type
/// int or bool decide its structure: loops may count them, and other values than the defaults have a graph of their
/// own, which no kernel has been compiled for.
template <class Formula>
concept HasFormulaOptions = requires(Formula formula) {
  formula.options([](const char*, auto&, const char*, auto...) {});
};

namespace formula_options {

/// One option, as a formula shows it to a visitor.
template <class Formula, class Visit>
void for_each(Formula& formula, Visit visit) {
  if constexpr (HasFormulaOptions<Formula>)
    formula.options([&](const char* name, auto& member, const char* meaning, Range range = {}) {
      visit(name, member, meaning, range);
    });
}

/// The member that is number `which`, which has type Member.
template <class Member, class Formula>
Member& member(Formula& formula, int which) {
  Member* found = nullptr;
  int at = 0;
  for_each(formula, [&](const char*, auto& each, const char*, const Range&) {
    if constexpr (std::is_same_v<std::remove_reference_t<decltype(each)>, Member>) {
      if (at == which) found = &each;
    }
    ++at;
  });
  return *found;
}

/// Throws Error if a formula with `size` bytes of members shows options of `shown` bytes.
RHEC_EXPORT void check_shown(std::size_t size, std::size_t shown, std::size_t alignment);

}  // namespace formula_options

/// The options of a formula as those of a plugin: `using Options = FormulaOptions<Bicycle>`.
template <template <class> class Formula>
struct FormulaOptions : Formula<double> {
  static const OptionTable<FormulaOptions>& table() {
    static const auto options = make_table();
    return options;
  }

 private:
  template <class Member>
  struct Access {
    int which;
    Member& operator()(FormulaOptions& of) const {
      return formula_options::member<Member>(static_cast<Formula<double>&>(of), which);
    }
    Member operator()(const FormulaOptions& of) const {
      Formula<double> copy = of;
      return formula_options::member<Member>(copy, which);
    }
  };
  static OptionTable<FormulaOptions> make_table() {
    OptionTable<FormulaOptions> options;
    Formula<double> defaults;
    int at = 0;
    formula_options::for_each(defaults, [&](const char* name, auto& each, const char* meaning, const Range& range) {
      using Member = std::remove_reference_t<decltype(each)>;
      static_assert(std::is_same_v<Member, double> || std::is_same_v<Member, int> || std::is_same_v<Member, bool>,
                    "an option of a formula is a Scalar, or else, if it decides the structure, an int or a bool");
      const Access<Member> access{at++};
      if constexpr (std::is_same_v<Member, double>)
        options.number(name, access, meaning, range);
      else if constexpr (std::is_same_v<Member, int>)
        options.integer(name, access, meaning, range);
      else
        options.flag(name, access, meaning);
    });
    return options;
  }
};

/// Makes the options of type Scalar inputs of a graph, gives the others their values, and returns the inputs with
/// theirs.
template <template <class> class Formula>
std::vector<Tape::Known> trace_options(Graph& graph, const Formula<double>& values, Formula<Expression>& formula) {
  static_assert(HasFormulaOptions<Formula<double>> || std::is_empty_v<Formula<double>>,
                "the members of a formula are its options: show them in `template <class Visitor> void "
                "options(Visitor&& option)`, or make them static constexpr");
  Formula<double> given = values;
  std::vector<Tape::Known> known;
  std::size_t shown = 0;
  int at = 0;
  formula_options::for_each(formula, [&](const char* name, auto& each, const char*, const Range&) {
    using Member = std::remove_reference_t<decltype(each)>;
    if constexpr (std::is_same_v<Member, Expression>) {
      each = Expression::input(graph, name);
      known.push_back({each.node_in(graph), formula_options::member<double>(given, at)});
      shown += sizeof(double);
    } else {
      each = formula_options::member<Member>(given, at);
      shown += sizeof(Member);
    }
    ++at;
  });
  if constexpr (!std::is_empty_v<Formula<double>>)
    formula_options::check_shown(sizeof(Formula<double>), shown, alignof(Formula<double>));
  return known;
}

}  // namespace rhec
