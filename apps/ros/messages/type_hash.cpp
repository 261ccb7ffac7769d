#include "type_hash.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

/// Numbers of type_description_interfaces/msg/FieldType for a single value.
int number_of(const logs::FieldDefinition& field) {
  constexpr int octet = 16;
  constexpr std::array numbers{15, 3, 2, 5, 4, 7, 6, 9, 8, 10, 11, 17, 18, 12, 1};  // as logs::Kind
  static_assert(numbers.size() == static_cast<std::size_t>(logs::Kind::structure) + 1);
  return field.is_octet ? octet : numbers[static_cast<std::size_t>(field.kind)];
}

std::string description_of(const logs::FieldDefinition& field) {
  constexpr int of_array = 48, of_sequence = 144;
  int number = number_of(field);
  if (field.shape == logs::Shape::array) number += of_array;
  if (field.shape == logs::Shape::sequence) number += of_sequence;
  return fmt::format(
      R"({{"name": "{}", "type": {{"type_id": {}, "capacity": {}, "string_capacity": 0, "nested_type_name": "{}"}}}})",
      field.name, number, field.shape == logs::Shape::array ? field.length : 0, field.type);
}

std::string description_of(const logs::StructureDefinition& structure) {
  // IDL has no empty structures.
  const logs::FieldDefinition filler{.name = "structure_needs_at_least_one_member", .kind = logs::Kind::u8};
  std::string fields = structure.fields.empty() ? description_of(filler) : "";
  for (const logs::FieldDefinition& field : structure.fields)
    fields += (fields.empty() ? "" : ", ") + description_of(field);
  return fmt::format(R"({{"type_name": "{}", "fields": [{}]}})", structure.name, fields);
}

}  // namespace

std::string type_description(const std::string& type, const logs::Definitions& definitions) {
  logs::MessageType message = logs::link_message(type, definitions);
  std::sort(message.structures.begin() + 1, message.structures.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  std::string referenced;
  for (std::size_t i = 1; i < message.structures.size(); ++i)
    referenced += (referenced.empty() ? "" : ", ") + description_of(message.structures[i]);
  return fmt::format(R"({{"type_description": {}, "referenced_type_descriptions": [{}]}})",
                     description_of(message.structures.front()), referenced);
}

std::string type_hash(const std::string& type, const logs::Definitions& definitions) {
  const std::string text = type_description(type, definitions);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1)
    throw Error("SHA-256 failed; expected OpenSSL with it");
  std::string hash = "RIHS01_";
  for (unsigned i = 0; i < size; ++i) hash += fmt::format("{:02x}", digest[i]);
  return hash;
}

}  // namespace rhec::apps::ros
