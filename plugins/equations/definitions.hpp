#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/formula/graph.hpp"
#include "statements.hpp"

namespace rhec::equations {

/// Equations as nodes of a graph. They may stand in any order, and use each other and the variables; none may need
/// itself.
class Definitions {
 public:
  /// `variables`: the nodes of names that no equation is for; `expected`: what names there are, in words.
  Definitions(Graph& graph, std::string file, std::map<std::string, int> variables,
              std::string expected = "a state, an input, a parameter, an option, or a name that has an equation");

  /// Throws Error for a name that is defined twice or is a variable's.
  void add(std::vector<Statement> statements);
  bool has(const std::string& target) const { return statement_of_.contains(target); }
  const std::vector<Statement>& statements() const { return statements_; }
  /// Makes the nodes of all equations. Throws Error with the place of a name that is not known, of an equation that
  /// needs itself, and of what is not finite for any values, such as a division by 0.
  void build();
  /// The node of a name or of a derivative "x'"; -1 if there is no equation for it.
  int node(const std::string& target) const;
  Place place(const std::string& target) const;

  /// The node of a single term of the variables.
  int build_term(const std::vector<Item>& term) { return build_items(term).back(); }
  /// The node of each of its parts.
  std::vector<int> build_items(const std::vector<Item>& term);
  /// The value of a node that depends on nothing.
  std::optional<double> constant_value(int node) const {
    return graph_.is_constant(node) ? std::optional<double>(graph_[node].value) : std::nullopt;
  }
  /// The statements so that each comes after those that it needs. Throws Error if one needs itself.
  std::vector<int> order() const;

 private:
  int resolve(const Item& name) const;
  int apply(const Item& item, std::vector<int>& operands);
  int apply_function(const Item& item, const std::vector<int>& arguments);
  int apply_power(int base, int exponent);
  void check_names() const;

  Graph& graph_;
  std::string file_, expected_;
  std::map<std::string, int> variables_;
  std::vector<Statement> statements_;
  std::map<std::string, int> statement_of_;
  std::vector<int> nodes_;  ///< of the statements; -1 until built
};

}  // namespace rhec::equations
