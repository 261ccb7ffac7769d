#include "statements.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/config/option_values.hpp"

namespace rhec::equations {
namespace {

constexpr int most_levels = 100;

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

struct Token {
  enum class Kind { number, name, sign, end_of_line, end };
  Kind kind = Kind::end;
  std::string_view text;
  Place place;
};

/// What others write for what this notation writes otherwise, or does not have.
struct Remedy {
  const char *found, *advice;
};
constexpr Remedy remedies[] = {
    {"**", "write a power as x^2"},
    {"<", "values are not compared; use smooth_min, smooth_max or smooth_abs, with a width"},
    {">", "values are not compared; use smooth_min, smooth_max or smooth_abs, with a width"},
    {"==", "an equation has one sign '='; values are not compared"},
    {"if", "there are no cases; use smooth_min, smooth_max or smooth_abs, with a width"},
    {"abs", "it has no derivative at 0; use smooth_abs(x, width)"},
    {"min", "it has no derivative where both are equal; use smooth_min(a, b, width)"},
    {"max", "it has no derivative where both are equal; use smooth_max(a, b, width)"},
    {"sign", "it jumps at 0; use tanh(x / width)"},
    {"pow", "write a power as x^2"},
    {"ln", "the natural logarithm is log(x)"},
    {"arctan", "it is called atan here"},
    {"arctan2", "it is called atan2 here"},
    {"fmod",
     "angles never wrap in equations; give the variable 'angle: true', and differences are taken on the circle"},
    {"mod", "angles never wrap in equations; give the variable 'angle: true', and differences are taken on the circle"},
    {"%", "angles never wrap in equations; give the variable 'angle: true', and differences are taken on the circle"},
    {"?", "there are no cases; use smooth_min, smooth_max or smooth_abs, with a width"},
    {"|", "the absolute value is smooth_abs(x, width)"},
    {";", "an equation ends with its line"},
    {":", "an equation is written name = term"},
    {"[", "there are no vectors; each component has a name of its own"},
    {"'", "a second derivative is the first one of another state: x' = v, v' = ..."},
    {"\u2212", "minus is written '-'"},
    {"\u2013", "minus is written '-'"},
    {"\u00b7", "a product is written with '*'"},
    {"\u22c5", "a product is written with '*'"},
    {"\u00d7", "a product is written with '*'"},
    {"\u00f7", "a quotient is written with '/'"},
    {"\u00b2", "a power is written x^2"},
    {"\u00b3", "a power is written x^3"},
    {"\u00a0", "this blank is another character than the usual one; type it anew"},
};
std::string advice_for(std::string_view found) {
  for (const Remedy& remedy : remedies)
    if (found == remedy.found) return std::string("; ") + remedy.advice;
  return {};
}

/// Splits a text into tokens. Within parentheses the ends of lines do not count; a comment runs from # to the end.
class Lexer {
 public:
  explicit Lexer(const SourceText& source) : source_(source) {
    int row = 0;
    for (const SourceText::Line& line : source.lines) split(line, ++row);
    tokens_.push_back({Token::Kind::end, {}, end_});
  }
  std::vector<Token> take() { return std::move(tokens_); }

 private:
  void split(const SourceText::Line& line, int row) {
    const std::string_view text = line.text;
    if (open_ == 0) target_ = target_of(text);
    const auto written = std::make_shared<const WrittenLine>(
        WrittenLine{.text = std::string(text), .target = target_, .where = source_.where, .row = row});
    const auto place = [&](std::size_t at) {
      return Place{line.number, line.column ? line.column + static_cast<int>(at) : 0, written, static_cast<int>(at)};
    };
    const auto add = [&](Token::Kind kind, std::size_t from, std::size_t to) {
      tokens_.push_back({kind, text.substr(from, to - from), place(from)});
    };
    std::size_t at = 0;
    while (at < text.size() && text[at] != '#') {
      const std::size_t from = at;
      const char c = text[at];
      if (c == ' ' || c == '\t' || c == '\r') {
        ++at;
      } else if (is_letter(c)) {
        while (at < text.size() && (is_letter(text[at]) || is_digit(text[at]))) ++at;
        if (at < text.size() && text[at] == '\'') ++at;
        add(Token::Kind::name, from, at);
      } else if (is_digit(c) || (c == '.' && at + 1 < text.size() && is_digit(text[at + 1]))) {
        at = number_end(text, at);
        add(Token::Kind::number, from, at);
      } else {
        at += text.substr(at, 2) == "**" || text.substr(at, 2) == "==" ? 2 : 1;
        if (c == '(') ++open_;
        if (c == ')') --open_;
        if (std::string_view("+-*/^(),=<>").find(c) == std::string_view::npos)
          throw unknown_character(text.substr(from), place(from));
        add(Token::Kind::sign, from, at);
      }
    }
    end_ = place(at);
    if (open_ <= 0) {
      open_ = 0;
      tokens_.push_back({Token::Kind::end_of_line, {}, end_});
    }
  }

  /// The name that the line is an equation for, if it is one.
  static std::string target_of(std::string_view line) {
    const std::string_view left = line.substr(0, line.find_first_of("=#"));
    if (left.size() == line.size() || line[left.size()] == '#') return {};
    const std::size_t from = left.find_first_not_of(" \t\r"), to = left.find_last_not_of(" \t\r");
    if (from == std::string_view::npos) return {};
    std::string_view name = left.substr(from, to + 1 - from);
    const std::string_view plain = name.ends_with('\'') ? name.substr(0, name.size() - 1) : name;
    return is_name(plain) ? std::string(name) : std::string();
  }

  Error unknown_character(std::string_view rest, const Place& at) const {
    const std::string found = printable(rest);
    std::string advice = advice_for(found);
    if (advice.empty() && (static_cast<unsigned char>(rest[0]) & 0x80))
      advice = "; names have the letters a to z and A to Z, e.g. mu";
    if (advice.empty()) advice = "; expected a number, a name, an operator + - * / ^, or a parenthesis";
    return error_at(source_.file, at, fmt::format("found '{}', which means nothing here{}", found, advice));
  }
  /// The first character, of one byte or, in UTF-8, of several.
  static std::string printable(std::string_view text) {
    const auto code = static_cast<unsigned char>(text[0]);
    const std::size_t bytes = code >= 0xf0 ? 4 : code >= 0xe0 ? 3 : code >= 0xc2 ? 2 : 1;
    const auto goes_on = [&](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; };
    const bool is_whole = bytes > 1 && text.size() >= bytes &&
                          std::all_of(text.begin() + 1, text.begin() + static_cast<std::ptrdiff_t>(bytes), goes_on);
    if (is_whole) return std::string(text.substr(0, bytes));
    return code < 32 || code > 126 ? fmt::format("\\x{:02x}", code) : std::string(1, text[0]);
  }
  static std::size_t number_end(std::string_view text, std::size_t at) {
    const auto skip_digits = [&] {
      while (at < text.size() && is_digit(text[at])) ++at;
    };
    skip_digits();
    if (at < text.size() && text[at] == '.') ++at;
    skip_digits();
    if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
      std::size_t exponent = at + 1;
      if (exponent < text.size() && (text[exponent] == '+' || text[exponent] == '-')) ++exponent;
      if (exponent < text.size() && is_digit(text[exponent])) {
        at = exponent;
        skip_digits();
      }
    }
    return at;
  }

  const SourceText& source_;
  std::vector<Token> tokens_;
  int open_ = 0;
  std::string target_;
  Place end_;
};

/// Recursive descent; a term comes out as items, operands first, so that what reads it needs no recursion.
class Parser {
 public:
  explicit Parser(const SourceText& source, Functions functions = Functions::smooth)
      : file_(source.file), functions_(functions), tokens_(Lexer(source).take()) {}

  std::vector<Statement> statements() {
    std::vector<Statement> all;
    while (true) {
      while (next().kind == Token::Kind::end_of_line) ++at_;
      if (next().kind == Token::Kind::end) return all;
      all.push_back(statement());
    }
  }

  std::vector<Item> term() {
    while (next().kind == Token::Kind::end_of_line) ++at_;
    sum();
    while (next().kind == Token::Kind::end_of_line) ++at_;
    if (next().kind != Token::Kind::end) throw unexpected("an operator or the end");
    return std::move(items_);
  }

 private:
  Statement statement() {
    if (next().kind != Token::Kind::name) throw unexpected("an equation: a name, '=' and a term");
    Statement made{std::string(next().text), next().place, {}};
    if (is_reserved(made.target))
      throw error_at(file_, made.place,
                     fmt::format("'{}' is a function or a constant; choose another name", made.target));
    ++at_;
    expect('=', "'=' after the name that the equation is for");
    items_.clear();
    sum();
    if (next().kind != Token::Kind::end_of_line && next().kind != Token::Kind::end)
      throw unexpected("an operator or the end of the line");
    made.term = std::move(items_);
    return made;
  }

  void sum() {
    const Level level(*this);
    product();
    while (is_sign('+') || is_sign('-')) {
      const Token token = take();
      product();
      add(token, token.text == "+" ? Item::Kind::add : Item::Kind::subtract);
    }
  }
  void product() {
    signed_power();
    while (is_sign('*') || is_sign('/')) {
      const Token token = take();
      signed_power();
      add(token, token.text == "*" ? Item::Kind::multiply : Item::Kind::divide);
    }
  }
  void signed_power() {
    const Level level(*this);
    if (is_sign('-')) {
      const Token token = take();
      signed_power();
      add(token, Item::Kind::negate);
    } else if (is_sign('+')) {
      ++at_;
      signed_power();
    } else {
      power();
    }
  }
  void power() {
    atom();
    if (!is_sign('^')) return;
    const Token token = take();
    signed_power();
    add(token, Item::Kind::power);
  }
  void atom() {
    if (next().kind == Token::Kind::number) return number(take());
    if (next().kind == Token::Kind::name) return name(take());
    if (!is_sign('(')) throw unexpected("a number, a name or '('");
    const Token opened = take();
    sum();
    close(opened);
  }
  void close(const Token& opened) {
    if (is_sign(')')) {
      ++at_;
      return;
    }
    const Token& found = next();
    if (opened.place.shown_line() == found.place.shown_line()) throw unexpected("an operator or ')'");
    // What was found is far from the mistake, often in the next equation.
    throw error_at(file_, opened.place,
                   found.kind == Token::Kind::end
                       ? "this '(' is not closed: found the end, expected an operator or ')'"
                       : fmt::format("this '(' is not closed: found '{}' in line {}, expected an operator or ')'",
                                     found.text, found.place.shown_line()));
  }
  void number(const Token& token) {
    double value = 0.0;
    const char* const end = token.text.data() + token.text.size();
    const auto [stop, problem] = std::from_chars(token.text.data(), end, value);
    if (problem != std::errc() || stop != end)
      throw error_at(file_, token.place, fmt::format("found '{}', which is no number in range", token.text));
    items_.push_back({Item::Kind::number, token.place, value});
  }
  void name(const Token& token) {
    if (!is_sign('(') && is_reserved(token.text, functions_) && token.text != "pi")
      throw error_at(file_, token.place,
                     fmt::format("'{0}' is a function; expected its argument in parentheses, {0}(...)", token.text));
    if (!is_sign('(')) {
      items_.push_back({Item::Kind::name, token.place, 0.0, std::string(token.text)});
      return;
    }
    const auto& functions = known_functions(functions_);
    const auto found =
        std::find_if(functions.begin(), functions.end(), [&](const auto& known) { return known.name == token.text; });
    if (found == functions.end()) throw unknown_function(token);
    const Token opened = take();
    for (int k = 0; k < found->arguments; ++k) {
      if (k > 0) expect(',', fmt::format("',': {} has {} arguments", found->name, found->arguments));
      sum();
    }
    if (is_sign(','))
      throw error_at(file_, next().place,
                     fmt::format("found ',', expected ')': {} has {} argument{}", found->name, found->arguments,
                                 found->arguments == 1 ? "" : "s"));
    close(opened);
    items_.push_back({Item::Kind::function, token.place, 0.0, std::string(token.text)});
  }
  Error unknown_function(const Token& token) const {
    std::vector<std::string> names;
    for (const FunctionInfo& known : known_functions(functions_)) names.emplace_back(known.name);
    std::string advice = advice_for(token.text);
    if (advice.empty()) {
      const std::string near = nearest(token.text, names);
      advice = near.empty() ? fmt::format("; known: {}; a product is written with '*'", fmt::join(names, ", "))
                            : fmt::format("; did you mean '{}'?", near);
    }
    return error_at(file_, token.place, fmt::format("there is no function '{}'{}", token.text, advice));
  }

  /// Deep terms would take the stack.
  struct Level {
    explicit Level(Parser& of) : parser(of) {
      if (++parser.levels_ > most_levels)
        throw error_at(
            parser.file_, parser.next().place,
            fmt::format("a term is nested deeper than {} levels; give its parts names of their own", most_levels));
    }
    ~Level() { --parser.levels_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;
    Parser& parser;
  };

  const Token& next() const { return tokens_[at_]; }
  Token take() { return tokens_[at_++]; }
  bool is_sign(char sign) const {
    return next().kind == Token::Kind::sign && next().text.size() == 1 && next().text[0] == sign;
  }
  void add(const Token& token, Item::Kind kind) { items_.push_back({kind, token.place}); }
  void expect(char sign, const std::string& expected) {
    if (!is_sign(sign)) throw unexpected(expected);
    ++at_;
  }
  Error unexpected(const std::string& expected) const {
    const Token& token = next();
    std::string found = fmt::format("'{}'", token.text);
    if (token.kind == Token::Kind::end_of_line) found = "the end of the line";
    if (token.kind == Token::Kind::end) found = "the end";
    std::string advice = advice_for(token.text);
    if (advice.empty() && is_sign(')') && expected.starts_with("an operator")) advice = "; there is no '(' for it";
    if (advice.empty() && is_sign(',')) advice = "; decimals have a point, as 0.5";
    const bool is_factor = token.kind == Token::Kind::name || token.kind == Token::Kind::number || is_sign('(');
    if (advice.empty() && is_factor && expected.starts_with("an operator")) advice = "; a product is written with '*'";
    return error_at(file_, token.place, fmt::format("found {}, expected {}{}", found, expected, advice));
  }

  std::string file_;
  Functions functions_;
  std::vector<Token> tokens_;
  std::size_t at_ = 0;
  std::vector<Item> items_;
  int levels_ = 0;
};

/// A line and a caret under one of its places, each on a line of its own. Of a long line what is near.
std::string shown(std::string_view text, int place) {
  constexpr std::size_t before = 60, after = 40;
  const auto is_inside = [&](std::size_t at) {
    return at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80;
  };
  const std::size_t at = std::min(static_cast<std::size_t>(place), text.size());
  std::size_t from = at > before ? at - before : 0, to = std::min(at + after, text.size());
  while (is_inside(from)) ++from;
  while (is_inside(to)) ++to;
  std::string line = from > 0 ? "..." : "", caret(line.size(), ' ');
  for (std::size_t k = from; k < to; ++k) {
    line += static_cast<unsigned char>(text[k]) < 32 ? ' ' : text[k];
    if (k < at && !is_inside(k)) caret += ' ';  // a letter of several bytes is one wide
  }
  return fmt::format("\n    {}{}\n    {}^", line, to < text.size() ? "..." : "", caret);
}

}  // namespace

Error error_at(const std::string& file, const Place& place, const std::string& text) {
  const WrittenLine* const written = place.written.get();
  std::string where = file;
  if (place.column > 0)
    where = fmt::format("{}:{}:{}", file, place.line, place.column);
  else if (written && !written->where.empty())
    where = fmt::format("{}: line {}, column {}", written->where, written->row, place.at + 1);
  else if (place.line > 0)
    where = fmt::format("{}:{}", file, place.line);
  if (!written) return Error(fmt::format("{}: {}", where, text));
  const std::string in = written->target.empty() ? "" : fmt::format(" (in the equation of {})", written->target);
  return Error(fmt::format("{}: {}{}{}", where, text, in, shown(written->text, place.at)));
}

const std::vector<FunctionInfo>& known_functions(Functions which) {
  static const std::vector<FunctionInfo> functions = {
      {"sqrt", 1},  {"exp", 1},   {"log", 1},        {"sin", 1},        {"cos", 1},
      {"tan", 1},   {"asin", 1},  {"acos", 1},       {"atan", 1},       {"tanh", 1},
      {"atan2", 2}, {"hypot", 2}, {"smooth_abs", 2}, {"smooth_min", 3}, {"smooth_max", 3}};
  static const std::vector<FunctionInfo> cornered = [] {
    std::vector<FunctionInfo> all = functions;
    all.insert(all.end(), {{"abs", 1}, {"min", 2}, {"max", 2}, {"where", 3}});
    return all;
  }();
  return which == Functions::smooth ? functions : cornered;
}

int operands_of(const Item& item) {
  switch (item.kind) {
    case Item::Kind::number:
    case Item::Kind::name:
      return 0;
    case Item::Kind::negate:
      return 1;
    case Item::Kind::function:
      for (const FunctionInfo& known : known_functions(Functions::with_corners))
        if (item.name == known.name) return known.arguments;
      return 1;
    default:
      return 2;
  }
}

bool is_reserved(std::string_view name, Functions which) {
  const auto& functions = known_functions(which);
  return name == "pi" ||
         std::any_of(functions.begin(), functions.end(), [&](const auto& known) { return known.name == name; });
}

bool is_name(std::string_view text) {
  return !text.empty() && is_letter(text[0]) &&
         std::all_of(text.begin(), text.end(), [](char c) { return is_letter(c) || is_digit(c); });
}

std::vector<Statement> parse_statements(const SourceText& source) { return Parser(source).statements(); }

std::vector<Item> parse_term(const SourceText& source, Functions functions) { return Parser(source, functions).term(); }

}  // namespace rhec::equations
