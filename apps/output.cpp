#include "output.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "rhec/sim/files/json.hpp"

namespace rhec::apps {

namespace fs = std::filesystem;

void add_out(Command& command, std::string& out, const std::string& type, const std::string& meaning) {
  command.add("--out", out, meaning).value(type);
}

void add_json(Command& command, bool& json) {
  command.add_flag("--json", json, "print the results as JSON instead of tables");
}

fs::path out_of(const std::string& given, const fs::path& source, const std::string& suffix) {
  if (!given.empty()) return given;
  const fs::path name = source.has_stem() ? source.stem() : source.parent_path().stem();
  return fs::path("out") / (name.string() + suffix);
}

void print_json(const std::string& document, const fs::path& out) {
  sim::Json all = sim::Json::parse(document);
  all["out"] = out.string();
  fmt::print("{}\n", all.dump(2));
}

void tell_notes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes) fmt::print(stderr, "rhec: note: {}\n", note);
}

}  // namespace rhec::apps
