#include "rhec/logs/cdr/message_definitions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <set>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t most_structures = 1000;
constexpr int deepest = 30;

/// Collects a structure and what it contains.
class Linker {
 public:
  Linker(const Definitions& definitions, MessageType& type) : definitions_(definitions), type_(type) {}

  int add(const std::string& name, const std::string& owner, int depth) {
    if (const auto known = indices_.find(name); known != indices_.end()) {
      if (known->second < 0) throw Error(fmt::format("the type {} contains itself", name));
      return known->second;
    }
    const auto found = definitions_.find(name);
    if (found == definitions_.end())
      throw Error(fmt::format("the type {}{} is not defined; give the folder of its package by --msg-path", name,
                              owner.empty() ? "" : " in " + owner));
    if (depth > deepest || type_.structures.size() >= most_structures)
      throw Error(fmt::format("the type {} contains more structures than a message has", type_.name));
    indices_[name] = -1;
    const auto index = type_.structures.size();
    type_.structures.push_back(found->second);
    for (std::size_t i = 0; i < type_.structures[index].fields.size(); ++i) {
      const FieldDefinition field = type_.structures[index].fields[i];  // the vector grows
      if (field.shape == Shape::array && field.length == 0)
        throw Error(fmt::format("the type {} has an array '{}' of no length", name, field.name));
      if (field.kind == Kind::structure) type_.structures[index].fields[i].structure = add(field.type, name, depth + 1);
    }
    return indices_[name] = static_cast<int>(index);
  }

 private:
  const Definitions& definitions_;
  MessageType& type_;
  std::map<std::string, int> indices_;
};

const char* word_of(Kind kind) {
  constexpr std::array words{"bool",  "uint8",   "int8",    "uint16", "int16",   "uint32",      "int32", "uint64",
                             "int64", "float32", "float64", "string", "wstring", "long double", ""};
  return words[static_cast<std::size_t>(kind)];
}

std::string short_name(const std::string& type) {
  const std::size_t first = type.find('/'), last = type.rfind('/');
  return type.substr(0, first) + type.substr(last);
}

void append_fields(const StructureDefinition& structure, std::string& text) {
  for (const FieldDefinition& field : structure.fields) {
    text += field.kind == Kind::structure ? short_name(field.type) : field.is_octet ? "byte" : word_of(field.kind);
    if (field.shape == Shape::array) text += fmt::format("[{}]", field.length);
    if (field.shape == Shape::sequence) text += "[]";
    text += fmt::format(" {}\n", field.name);
  }
}

}  // namespace

std::string full_type_name(std::string_view name) {
  std::vector<std::string> parts(1);
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool is_colons = name.substr(i, 2) == "::";
    if (name[i] == '/' || is_colons) {
      parts.emplace_back();
      i += is_colons ? 1 : 0;
    } else {
      parts.back() += name[i];
    }
  }
  std::erase(parts, "");
  const bool is_of_dds = std::erase(parts, "dds_") > 0;
  if (parts.empty()) return {};
  if (is_of_dds && parts.back().ends_with('_')) parts.back().pop_back();
  if (parts.size() == 2) parts.insert(parts.begin() + 1, "msg");
  return fmt::format("{}", fmt::join(parts, "/"));
}

MessageType link_message(const std::string& type, const Definitions& definitions) {
  MessageType result{.name = type, .structures = {}};
  Linker(definitions, result).add(type, "", 0);
  return result;
}

std::string ros2msg_text(const std::string& type, const Definitions& definitions) {
  const MessageType message = link_message(type, definitions);
  std::string text;
  for (const StructureDefinition& structure : message.structures) {
    if (!text.empty()) text += fmt::format("{:=<80}\nMSG: {}\n", "", short_name(structure.name));
    append_fields(structure, text);
  }
  return text;
}

}  // namespace rhec::logs
