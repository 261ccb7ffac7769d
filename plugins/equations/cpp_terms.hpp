#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "definitions.hpp"
#include "statements.hpp"

namespace rhec::equations {

/// Names of a vehicle as identifiers of C++: unchanged where they can be.
class CppNames {
 public:
  /// The identifier for a name, or for a derivative "x'"; the same for each call.
  const std::string& of(const std::string& name);
  /// An identifier close to `wanted` that nothing else has.
  std::string unused(const std::string& wanted);
  /// The same; `otherwise` is tried second.
  std::string unused(const std::string& wanted, const std::string& otherwise) {
    return unused(taken_.contains(wanted) ? otherwise : wanted);
  }

 private:
  std::map<std::string, std::string> chosen_;
  std::set<std::string> taken_;
};

/// Terms of equations as C++, for any number type.
class CppTerms {
 public:
  /// `scalar`: the number type's name. `definitions` know which parts are constant; they have been built.
  CppTerms(Definitions& definitions, CppNames& names, std::string scalar)
      : definitions_(definitions), names_(names), scalar_(std::move(scalar)) {}

  /// Names stand as what `names` has for them, or what was set here.
  void set(const std::string& name, std::string text) { texts_[name] = std::move(text); }
  std::string text(const std::vector<Item>& term);
  /// Functions that the texts so far call: "cos", "smooth_abs", ...
  const std::set<std::string>& called() const { return called_; }
  bool uses_pi() const { return uses_pi_; }

 private:
  struct Piece;
  Piece combined(const Item& item, const std::vector<Piece>& parts, const std::vector<int>& nodes);
  Piece power(const Piece& base, const Piece& exponent, int exponent_node);
  Piece call(const std::string& function, const std::vector<Piece>& arguments);

  Definitions& definitions_;
  CppNames& names_;
  std::string scalar_;
  std::map<std::string, std::string> texts_;
  std::set<std::string> called_;
  bool uses_pi_ = false;
};

/// A number as a literal of type double, which reads back as the same bits.
std::string cpp_number(double value);
/// A text as a literal; and within a comment, on one line.
std::string cpp_text(std::string_view text);
std::string cpp_comment(std::string_view text);
/// Lines of at most 120 columns: `text` is broken at blanks, further lines begin with `more`. A literal that is broken
/// goes on as another one.
std::string cpp_wrapped(const std::string& text, const std::string& more);
/// True if code uses an identifier, outside of literals.
bool cpp_mentions(std::string_view text, std::string_view word);
/// Lines of code with their comments below each other.
std::string cpp_aligned(const std::vector<std::pair<std::string, std::string>>& lines, const char* mark);

}  // namespace rhec::equations
