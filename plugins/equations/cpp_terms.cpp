#include "cpp_terms.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

namespace rhec::equations {
namespace {

/// Words of the language, macros of its library, and what the generated code uses itself.
constexpr std::string_view words[] = {"alignas",
                                      "alignof",
                                      "and",
                                      "and_eq",
                                      "asm",
                                      "auto",
                                      "bitand",
                                      "bitor",
                                      "bool",
                                      "break",
                                      "case",
                                      "catch",
                                      "char",
                                      "char16_t",
                                      "char32_t",
                                      "char8_t",
                                      "class",
                                      "co_await",
                                      "co_return",
                                      "co_yield",
                                      "compl",
                                      "concept",
                                      "const",
                                      "const_cast",
                                      "consteval",
                                      "constexpr",
                                      "constinit",
                                      "continue",
                                      "decltype",
                                      "default",
                                      "delete",
                                      "do",
                                      "double",
                                      "dynamic_cast",
                                      "else",
                                      "enum",
                                      "explicit",
                                      "export",
                                      "extern",
                                      "false",
                                      "float",
                                      "for",
                                      "friend",
                                      "goto",
                                      "if",
                                      "inline",
                                      "int",
                                      "long",
                                      "mutable",
                                      "namespace",
                                      "new",
                                      "noexcept",
                                      "not",
                                      "not_eq",
                                      "nullptr",
                                      "operator",
                                      "or",
                                      "or_eq",
                                      "private",
                                      "protected",
                                      "public",
                                      "register",
                                      "reinterpret_cast",
                                      "requires",
                                      "return",
                                      "short",
                                      "signed",
                                      "sizeof",
                                      "static",
                                      "static_assert",
                                      "static_cast",
                                      "struct",
                                      "switch",
                                      "template",
                                      "this",
                                      "thread_local",
                                      "throw",
                                      "true",
                                      "try",
                                      "typedef",
                                      "typeid",
                                      "typename",
                                      "union",
                                      "unsigned",
                                      "using",
                                      "virtual",
                                      "void",
                                      "volatile",
                                      "wchar_t",
                                      "while",
                                      "xor",
                                      "xor_eq",
                                      "assert",
                                      "errno",
                                      "linux",
                                      "unix",
                                      "i386",
                                      "stdin",
                                      "stdout",
                                      "stderr",
                                      "signbit",
                                      "isnan",
                                      "isinf",
                                      "isfinite",
                                      "Scalar",
                                      "Visitor",
                                      "visit",
                                      "options",
                                      "dynamics",
                                      "outputs",
                                      "state_count",
                                      "input_count",
                                      "parameter_count",
                                      "output_count",
                                      "named",
                                      "pow",
                                      "rhec",
                                      "std",
                                      "describe",
                                      "model",
                                      "vehicle",
                                      "vehicle_",
                                      "Options",
                                      "main"};

bool is_word(const std::string& name) {
  return std::find(std::begin(words), std::end(words), name) != std::end(words) || is_reserved(name) ||
         name.find("__") != std::string::npos ||                                     // the compiler's own
         (name.size() > 1 && name[0] == '_' && name[1] >= 'A' && name[1] <= 'Z') ||  // as these are
         (name.size() > 1 && name.back() != '_' &&
          std::all_of(name.begin(), name.end(), [](char c) {  // a macro's, perhaps
            return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
          }));
}

/// How tightly a text holds together.
enum Level : int { sum = 1, product = 2, sign = 3, atom = 4 };

}  // namespace

const std::string& CppNames::of(const std::string& name) {
  const auto found = chosen_.find(name);
  if (found != chosen_.end()) return found->second;
  std::string plain = name;
  if (plain.ends_with('\'')) plain.replace(plain.size() - 1, 1, "_rate");
  return chosen_.emplace(name, unused(plain)).first->second;
}

std::string CppNames::unused(const std::string& wanted) {
  std::string name = wanted;
  for (std::size_t at = name.find("__"); at != std::string::npos; at = name.find("__")) name.erase(at, 1);
  if (name[0] == '_') name = "v" + name;
  if (is_word(name)) name += name.ends_with('_') ? "value" : "_";
  if (is_word(name)) name += "value";
  std::string tried = name;
  for (int k = 2; taken_.contains(tried); ++k) tried = fmt::format("{}{}{}", name, name.ends_with('_') ? "" : "_", k);
  taken_.insert(tried);
  return tried;
}

struct CppTerms::Piece {
  std::string text;
  int level = atom;
  bool is_plain = false;  ///< of numbers alone, whose type is double

  std::string within(int least) const { return level < least || text[0] == '-' ? "(" + text + ")" : text; }
};

std::string CppTerms::text(const std::vector<Item>& term) {
  const std::vector<int> nodes = definitions_.build_items(term);
  std::vector<Piece> pieces;
  std::vector<int> piece_nodes;
  for (std::size_t k = 0; k < term.size(); ++k) {
    const auto count = static_cast<std::ptrdiff_t>(operands_of(term[k]));
    const std::vector<Piece> parts(pieces.end() - count, pieces.end());
    const std::vector<int> part_nodes(piece_nodes.end() - count, piece_nodes.end());
    pieces.resize(pieces.size() - static_cast<std::size_t>(count));
    piece_nodes.resize(pieces.size());
    pieces.push_back(combined(term[k], parts, part_nodes));
    piece_nodes.push_back(nodes[k]);
  }
  return pieces.back().text;
}

CppTerms::Piece CppTerms::combined(const Item& item, const std::vector<Piece>& parts, const std::vector<int>& nodes) {
  const auto infix = [&](const char* sign, int own, int right) {
    // A sign at the left end of the whole is no sign within it.
    const std::string first = parts[0].level < own ? "(" + parts[0].text + ")" : parts[0].text;
    return Piece{fmt::format("{} {} {}", first, sign, parts[1].within(right)), own,
                 parts[0].is_plain && parts[1].is_plain};
  };
  switch (item.kind) {
    case Item::Kind::number:
      return {cpp_number(item.value), atom, true};
    case Item::Kind::name:
      if (item.name == "pi") {
        uses_pi_ = true;
        return {"std::numbers::pi", atom, true};
      }
      if (const auto found = texts_.find(item.name); found != texts_.end()) return {found->second, atom, false};
      return {names_.of(item.name), atom, false};
    case Item::Kind::negate:
      return {"-" + parts[0].within(sign), sign, parts[0].is_plain};
    case Item::Kind::add:
      return infix("+", sum, product);
    case Item::Kind::subtract:
      return infix("-", sum, product);
    case Item::Kind::multiply:
      return infix("*", product, sign);
    case Item::Kind::divide:
      return infix("/", product, sign);
    case Item::Kind::power:
      return power(parts[0], parts[1], nodes[1]);
    case Item::Kind::function:
      break;
  }
  return call(item.name, parts);
}

/// As Definitions does it: a product, a root, or exp(exponent log(base)).
CppTerms::Piece CppTerms::power(const Piece& base, const Piece& exponent, int exponent_node) {
  constexpr double largest = 1000.0;
  if (const auto value = definitions_.constant_value(exponent_node)) {
    if (*value == std::round(*value) && std::abs(*value) <= largest) {
      const bool is_name = base.level == atom && base.text.find_first_of("( ") == std::string::npos;
      if (*value == 2.0 && is_name) return {base.text + " * " + base.text, product, base.is_plain};
      called_.insert("pow");
      return {fmt::format("pow({}, {})", base.is_plain ? fmt::format("{}({})", scalar_, base.text) : base.text,
                          static_cast<int>(*value)),
              atom, false};
    }
    if (*value == 0.5) return call("sqrt", {base});
  }
  const Piece logarithm = call("log", {base});
  return call("exp", {{exponent.within(product) + " * " + logarithm.text, product, false}});
}

CppTerms::Piece CppTerms::call(const std::string& function, const std::vector<Piece>& arguments) {
  called_.insert(function);
  const bool is_smooth = function.starts_with("smooth_");
  std::string text = function + (is_smooth ? "<" + scalar_ + ">(" : "(");
  for (std::size_t k = 0; k < arguments.size(); ++k) {
    if (k > 0) text += ", ";
    text += arguments[k].is_plain && !is_smooth ? fmt::format("{}({})", scalar_, arguments[k].text) : arguments[k].text;
  }
  return {text + ")", atom, false};
}

std::string cpp_number(double value) {
  std::string text = fmt::format("{}", value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string cpp_text(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\')
      quoted += {'\\', c};
    else
      quoted += code < 32 || code == 127 ? ' ' : c;
  }
  return quoted + "\"";
}

std::string cpp_comment(std::string_view text) {
  std::string line;
  for (const char c : text) line += static_cast<unsigned char>(c) < 32 ? ' ' : c;
  while (!line.empty() && (line.back() == '\\' || line.back() == ' ')) line.pop_back();  // would go on in the next line
  return line;
}

std::string cpp_wrapped(const std::string& text, const std::string& more) {
  constexpr std::size_t widest = 120;
  const bool is_comment = text.find_first_not_of(' ') == text.find("//");
  std::string all, line = text;
  while (line.size() > widest) {
    const std::size_t least = std::max(line.find_first_not_of(" /"), more.size());
    // The last blank, and whether it stands within a literal, which then goes on as another one.
    std::size_t at = std::string::npos;
    bool is_open = false, splits = false;
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (!is_comment && line[k] == '"' && (k == 0 || line[k - 1] != '\\')) is_open = !is_open;
      const bool fits = k + (is_open ? 2 : 0) <= widest;
      if (line[k] != ' ' || k <= least || (!fits && at != std::string::npos)) continue;
      if (!fits && is_open) continue;
      // An operator ends a line; what follows it begins the next one.
      const bool is_good =
          is_comment || is_open || std::string_view("+-*/,=").find(line[k - 1]) != std::string_view::npos;
      if (!is_good && fits && at != std::string::npos) continue;
      at = k;
      splits = is_open;
      if (!fits) break;
    }
    if (at == std::string::npos) break;
    all += line.substr(0, at) + (splits ? " \"\n" : "\n");
    line = fmt::format("{}{}{}", more, splits ? "\"" : "", line.substr(at + 1));
  }
  return all + line;
}

bool cpp_mentions(std::string_view text, std::string_view word) {
  const auto is_part = [&](std::size_t at) {
    return at < text.size() && (std::isalnum(static_cast<unsigned char>(text[at])) || text[at] == '_');
  };
  for (std::size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1))
    if ((at == 0 || !is_part(at - 1)) && !is_part(at + word.size()) &&
        std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '"') % 2 == 0)
      return true;
  return false;
}

std::string cpp_aligned(const std::vector<std::pair<std::string, std::string>>& lines, const char* mark) {
  std::size_t widest = 0;
  for (const auto& [code, comment] : lines) widest = std::max(widest, code.size());
  std::string all;
  for (const auto& [code, comment] : lines)
    all += comment.empty() ? code + "\n" : fmt::format("{:<{}}  {} {}\n", code, widest, mark, comment);
  return all;
}

}  // namespace rhec::equations
