#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/error.hpp"

namespace rhec::equations {

/// A text of a file: each line with its place there, so that an error can name line and column.
struct SourceText {
  struct Line {
    std::string_view text;
    int number = 0;  ///< in the file, from 1
    int column = 0;  ///< of the line's first character, from 1; 0 if it is not known
  };
  std::string file;
  std::vector<Line> lines;
  std::string where{};  ///< of the text as a whole, for errors in lines whose place in a file is not known
};

/// A line as it is shown below an error.
struct WrittenLine {
  std::string text, target;  ///< the name that its equation is for; empty in a single term
  std::string where;         ///< as of the SourceText
  int row = 0;               ///< in the text, from 1
};

/// A place in a file, and in the text that it is in.
struct Place {
  int line = 0, column = 0;
  std::shared_ptr<const WrittenLine> written{};
  int at = 0;  ///< in the line, from 0

  /// The number of the line for people: of the file, or else of the text.
  int shown_line() const { return line > 0 || !written ? line : written->row; }
};
/// "vehicle.yaml:12:8: " and the text, with the equation that it is in; below it the line, and a caret under the place.
Error error_at(const std::string& file, const Place& place, const std::string& text);

/// What a term is computed by, in the order of the computation: operands first.
struct Item {
  enum class Kind { number, name, negate, add, subtract, multiply, divide, power, function };
  Kind kind = Kind::number;
  Place place;
  double value = 0.0;  ///< of a number
  std::string name{};  ///< of a name (with its prime, "x'"), or a function
};

/// One equation: name = term, or name' = term.
struct Statement {
  std::string target;  ///< with its prime
  Place place;
  std::vector<Item> term;
};

/// The functions that a term may call.
struct FunctionInfo {
  const char* name;
  int arguments;
};
/// Which functions there are: those with derivatives everywhere; or, of numbers that nobody differentiates, also those
/// with corners (abs, min, max) and where(condition, a, b): a where the condition is above 0, else b.
enum class Functions { smooth, with_corners };
const std::vector<FunctionInfo>& known_functions(Functions functions = Functions::smooth);
/// How many parts before it an item combines: 0, 1, 2 or 3.
int operands_of(const Item& item);
/// True for functions and constants, which no variable may be named as.
bool is_reserved(std::string_view name, Functions functions = Functions::smooth);
/// True for a letter or underscore, followed by letters, digits and underscores.
bool is_name(std::string_view text);

/// The equations of a text, one a line (docs/equations.md has the grammar). Throws Error with the place of the first
/// mistake, what was found there and what was expected.
std::vector<Statement> parse_statements(const SourceText& source);
/// A single term that fills the text.
std::vector<Item> parse_term(const SourceText& source, Functions functions = Functions::smooth);

}  // namespace rhec::equations
