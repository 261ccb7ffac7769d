// OMG's IDL, as far as rosidl writes it.
#include <fmt/format.h>

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "definition_text.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {
namespace {

/// Words, punctuation and texts in quotes; comments, preprocessor lines and separators of files are passed over.
class Tokens {
 public:
  explicit Tokens(std::string_view text) : text_(text) { advance(); }
  const std::string& now() const noexcept { return token_; }  ///< empty at the end
  int line() const noexcept { return line_; }
  std::string take() {
    std::string taken = token_;
    advance();
    return taken;
  }
  bool take_if(std::string_view token) {
    if (token_ != token) return false;
    advance();
    return true;
  }
  void expect(std::string_view token) {
    if (!take_if(token)) throw error(fmt::format("'{}'", token));
  }
  Error error(std::string_view expected) const {
    return Error(fmt::format("IDL, line {}: found {}, expected {}", line_,
                             token_.empty() ? std::string("the end") : in_quotes(token_), expected));
  }

 private:
  static bool is_word(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
  }
  void skip_line() {
    while (!text_.empty() && text_.front() != '\n') text_.remove_prefix(1);
  }
  void skip(std::size_t count) {
    for (std::size_t i = 0; i < count && !text_.empty(); ++i) {
      line_ += text_.front() == '\n';
      text_.remove_prefix(1);
    }
  }
  /// What is no token.
  bool skip_blank() {
    if (text_.empty()) return false;
    const char c = text_.front();
    if (c == ' ' || c == '\t' || c == '\r' || c == '\n') {
      skip(1);
    } else if (text_.starts_with("//") || c == '#' || text_.starts_with("====") || text_.starts_with("IDL:")) {
      skip_line();
    } else if (text_.starts_with("/*")) {
      const std::size_t end = text_.find("*/", 2);
      skip(end == std::string_view::npos ? text_.size() : end + 2);
    } else {
      return false;
    }
    return true;
  }
  void advance() {
    while (skip_blank()) {
    }
    token_.clear();
    if (text_.empty()) return;
    std::size_t size = 1;
    if (is_word(text_.front())) {
      while (size < text_.size() && is_word(text_[size])) ++size;
    } else if (text_.starts_with("::")) {
      size = 2;
    } else if (text_.front() == '"' || text_.front() == '\'') {
      while (size < text_.size() && text_[size] != text_.front()) size += text_[size] == '\\' ? 2 : 1;
      size = std::min(size + 1, text_.size());
    }
    token_ = std::string(text_.substr(0, size));
    skip(size);
  }

  std::string_view text_;
  std::string token_;
  int line_ = 1;
};

class IdlParser {
 public:
  IdlParser(std::string_view text, Definitions& definitions) : tokens_(text), definitions_(definitions) {}

  void parse() {
    while (!tokens_.now().empty()) definition(0);
  }

 private:
  void definition(int depth) {
    constexpr int deepest = 20;
    if (depth > deepest) throw tokens_.error("modules that are less nested");
    annotations();
    if (tokens_.take_if("module")) {
      modules_.push_back(tokens_.take());
      tokens_.expect("{");
      while (!tokens_.take_if("}")) {
        if (tokens_.now().empty()) throw tokens_.error("'}'");
        definition(depth + 1);
      }
      modules_.pop_back();
    } else if (tokens_.take_if("struct")) {
      structure();
    } else if (tokens_.take_if("typedef")) {
      FieldDefinition field = type();
      declarator(field);
      const std::string name = field.name;
      typedefs_[scoped(name)] = std::move(field);
    } else if (tokens_.take_if("enum")) {
      typedefs_[scoped(tokens_.take())] = {.name = "", .kind = Kind::u32};
      tokens_.expect("{");
      while (!tokens_.now().empty() && !tokens_.take_if("}")) tokens_.take();
    } else if (tokens_.take_if("const")) {
      while (!tokens_.now().empty() && tokens_.now() != ";") tokens_.take();
    } else {
      throw tokens_.error("module, struct, typedef, enum or const");
    }
    tokens_.take_if(";");
  }

  void structure() {
    StructureDefinition made{.name = scoped(tokens_.take()), .fields = {}};
    tokens_.expect("{");
    while (!tokens_.take_if("}")) {
      annotations();
      FieldDefinition field = type();
      declarator(field);
      // An empty message has a member in IDL that it does not have in ROS's language; both are one byte.
      if (field.name != "structure_needs_at_least_one_member") made.fields.push_back(std::move(field));
      tokens_.expect(";");
    }
    const std::string name = made.name;
    definitions_[name] = std::move(made);
  }

  void annotations() {
    while (tokens_.take_if("@")) {
      tokens_.take();
      if (!tokens_.take_if("(")) continue;
      for (int open = 1; open > 0 && !tokens_.now().empty();) {
        const std::string token = tokens_.take();
        open += token == "(" ? 1 : token == ")" ? -1 : 0;
      }
    }
  }

  /// A type, without a name yet.
  FieldDefinition type() {
    if (tokens_.take_if("sequence")) {
      tokens_.expect("<");
      if (tokens_.now() == "sequence") throw tokens_.error("a sequence of single values");
      FieldDefinition field = type();
      if (field.shape != Shape::single) throw tokens_.error("a sequence of single values");
      field.shape = Shape::sequence;
      if (tokens_.take_if(",")) tokens_.take();
      tokens_.expect(">");
      return field;
    }
    std::string word = name_of_type();
    if (word == "string" || word == "wstring")
      if (tokens_.take_if("<")) {
        tokens_.take();
        tokens_.expect(">");
      }
    if (const auto kind = kind_of(word)) return {.name = "", .kind = *kind, .is_octet = word == "octet"};
    for (const std::string& candidate : {scoped(word), word})
      if (const auto found = typedefs_.find(candidate); found != typedefs_.end()) {
        FieldDefinition field = found->second;
        field.name.clear();
        return field;
      }
    if (word.find('/') == std::string::npos) word = scoped(word);
    return {.name = "", .kind = Kind::structure, .type = word};
  }

  std::string name_of_type() {
    std::string word = tokens_.take();
    if (word.empty()) throw tokens_.error("a type");
    const auto is_more = [&] {
      return tokens_.now() == "long" || tokens_.now() == "short" || tokens_.now() == "double";
    };
    if (word == "unsigned" || word == "long")
      while (is_more()) word += " " + tokens_.take();
    if (word == "::") word = tokens_.take();
    while (tokens_.take_if("::")) word += "/" + tokens_.take();
    return word;
  }

  void declarator(FieldDefinition& field) {
    field.name = tokens_.take();
    std::uint64_t length = 0;
    if (!tokens_.take_if("[")) return;
    if (field.shape != Shape::single || !read_length(tokens_.take(), length)) throw tokens_.error("a length");
    field.shape = Shape::array;
    field.length = length;
    tokens_.expect("]");
  }

  /// In the modules that are open.
  std::string scoped(const std::string& name) const {
    return modules_.empty() ? name : fmt::format("{}/{}", fmt::join(modules_, "/"), name);
  }

  Tokens tokens_;
  Definitions& definitions_;
  std::vector<std::string> modules_;
  std::map<std::string, FieldDefinition> typedefs_;
};

}  // namespace

void parse_ros2idl(const std::string& type, std::string_view text, Definitions& definitions) {
  IdlParser(text, definitions).parse();
  if (!definitions.contains(type)) throw Error(fmt::format("IDL: does not define {}", type));
}

}  // namespace rhec::logs
