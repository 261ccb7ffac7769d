#include "message_finder.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <optional>
#include <set>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {
namespace {

namespace fs = std::filesystem;

/// A text file of a package; empty if it is not there.
std::optional<std::string> text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || fs::is_directory(file)) return std::nullopt;
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

/// Looks for a type's file in a folder of packages, in an installation of ROS, and in a package itself.
bool add_from(const fs::path& folder, const std::string& type, Definitions& definitions) {
  const fs::path full(type), name = full.filename();
  for (const char* ending : {".msg", ".idl"}) {
    for (const fs::path& file :
         {folder / full, folder / "share" / full, folder / full.parent_path().filename() / name, folder / name}) {
      const std::optional<std::string> text = text_of(file.string() + ending);
      if (!text) continue;
      if (ending == std::string_view(".msg")) {
        parse_ros2msg(type, *text, definitions);
      } else {
        parse_ros2idl(type, *text, definitions);
      }
      return true;
    }
  }
  return false;
}

/// Adds what types contain and nobody has defined yet.
void complete(const std::string& root, const std::vector<fs::path>& folders, Definitions& definitions) {
  std::vector<std::string> waiting{root};
  std::set<std::string> seen;
  while (!waiting.empty()) {
    const std::string type = waiting.back();
    waiting.pop_back();
    if (!seen.insert(type).second) continue;
    for (std::size_t i = 0; i < folders.size() && !definitions.contains(type); ++i)
      add_from(folders[i], type, definitions);
    if (const auto known = builtin_definitions().find(type); known != builtin_definitions().end())
      definitions.insert(*known);  // unless it is there
    if (const auto found = definitions.find(type); found != definitions.end())
      for (const FieldDefinition& field : found->second.fields)
        if (field.kind == Kind::structure) waiting.push_back(field.type);
  }
}

}  // namespace

std::shared_ptr<const MessageType> find_message(const std::string& type, std::string_view encoding,
                                                std::string_view schema, const std::vector<fs::path>& folders) {
  Definitions definitions;
  if (encoding == "ros2msg") {
    parse_ros2msg(type, schema, definitions);
  } else if (encoding == "ros2idl") {
    parse_ros2idl(type, schema, definitions);
  } else if (!encoding.empty()) {
    throw Error(fmt::format("the type {} is defined in '{}'; expected ros2msg or ros2idl", type, encoding));
  }
  complete(type, folders, definitions);
  return std::make_shared<const MessageType>(link_message(type, definitions));
}

}  // namespace rhec::logs
