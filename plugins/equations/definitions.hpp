#pragma once

#include <map>
#include <string>
#include <vector>

#include "rhec/core/formula/graph.hpp"
#include "statements.hpp"

namespace rhec::equations {

/// Equations as nodes of a graph. They may stand in any order, and use each other and the variables; none may need
/// itself.
class Definitions {
 public:
  /// `variables`: the nodes of names that no equation is for. Throws Error for a name that is defined twice or is a
  /// variable's.
  Definitions(Graph& graph, std::string file, std::map<std::string, int> variables);

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
  int build_term(const std::vector<Item>& term);

 private:
  int resolve(const Item& name) const;
  int apply(const Item& item, std::vector<int>& operands);
  int apply_function(const Item& item, const std::vector<int>& arguments);
  int apply_power(int base, int exponent);
  void check_names() const;
  std::vector<int> order() const;

  Graph& graph_;
  std::string file_;
  std::map<std::string, int> variables_;
  std::vector<Statement> statements_;
  std::map<std::string, int> statement_of_;
  std::vector<int> nodes_;  ///< of the statements; -1 until built
};

}  // namespace rhec::equations
