#include "rhec/plugins/yaml/yaml.hpp"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string_view>

namespace rhec {
namespace {

/// Where the text came from, and whether its line numbers mean anything to the user.
struct Source {
  std::string name;
  bool has_lines;

  Origin at(const YAML::Mark& mark) const { return {name, has_lines && !mark.is_null() ? mark.line + 1 : 0}; }
  std::string column_of(const YAML::Mark& mark) const {
    return has_lines && !mark.is_null() ? fmt::format(" in column {}", mark.column + 1) : std::string();
  }
  Error error(const YAML::Mark& mark, const std::string& what) const { return Settings::null(at(mark)).error(what); }
};

/// Turns yaml-cpp's graph into a tree. Aliases can turn a small graph into a huge or infinite tree, so depth and size
/// are limited.
class Converter {
 public:
  explicit Converter(const Source& source) : source_(source) {}

  Settings convert(const YAML::Node& node, const YAML::Mark& mark) {
    constexpr int most_nodes = 100000, most_levels = 100;
    if (++nodes_ > most_nodes || levels_ >= most_levels) {
      throw source_.error(mark, fmt::format("more than {} nodes or {} levels; does an alias (*) stand within its own "
                                            "anchor (&)?",
                                            most_nodes, most_levels));
    }
    refuse_tags(node);
    ++levels_;
    Settings result = convert_inner(node, source_.at(mark));
    --levels_;
    return result;
  }

 private:
  Settings convert_inner(const YAML::Node& node, const Origin& origin) {
    if (node.IsScalar()) return Settings::scalar(node.Scalar(), origin);
    if (node.IsSequence()) {
      Settings list = Settings::list(origin);
      for (const YAML::Node& item : node) list.append(convert(item, item.Mark()));
      return list;
    }
    if (node.IsMap()) return convert_map(node, origin);
    return Settings::null(origin);
  }

  Settings convert_map(const YAML::Node& node, const Origin& origin) {
    // Each key is looked for among those before it.
    constexpr std::size_t most_keys = 10000;
    if (node.size() > most_keys)
      throw source_.error(node.Mark(), fmt::format("a map of {} keys, expected at most {}; is this a configuration?",
                                                   node.size(), most_keys));
    Settings map = Settings::map(origin);
    for (const auto& member : node) {
      const YAML::Node& key = member.first;
      if (!key.IsScalar() || key.Scalar().empty()) throw source_.error(key.Mark(), "a key must be a plain text");
      // The origin of a member is that of its key: the value may start lines below, or be an alias of something far
      // away.
      if (key.Scalar() != "<<") map.add(key.Scalar(), convert(member.second, key.Mark()));
    }
    // Keys written here take precedence over merged ones, and earlier merges over later ones.
    for (const auto& member : node) {
      if (member.first.Scalar() == "<<") merge(map, member.second, member.first.Mark());
    }
    return map;
  }

  void merge(Settings& into, const YAML::Node& from, const YAML::Mark& mark) {
    if (from.IsSequence()) {
      for (const YAML::Node& each : from) merge_one(into, each, mark);
    } else {
      merge_one(into, from, mark);
    }
  }

  void merge_one(Settings& into, const YAML::Node& from, const YAML::Mark& mark) {
    if (!from.IsMap()) throw source_.error(mark, "'<<' merges maps; write an alias of a map, or a list of them");
    const Settings merged = convert(from, mark);
    for (const auto& [key, value] : merged.members()) {
      if (into.find(key) == nullptr) into.add(key, value);
    }
  }

  void refuse_tags(const YAML::Node& node) const {
    const std::string& tag = node.Tag();
    const bool is_yamls_own = tag.empty() || tag == "?" || tag == "!" || tag.rfind("tag:yaml.org,2002:", 0) == 0;
    if (!is_yamls_own) throw source_.error(node.Mark(), fmt::format("the tag '{}' means nothing here; remove it", tag));
  }

  const Source& source_;
  int nodes_ = 0;
  int levels_ = 0;
};

/// What to do about a mistake that yaml-cpp finds; it names the place where it gives up, often a line too late.
std::string remedy_for(const std::string& text, const YAML::Exception& problem) {
  std::string_view line = text;
  for (int k = 0; k < problem.mark.line && !line.empty(); ++k)
    line.remove_prefix(std::min(line.find('\n'), line.size() - 1) + 1);
  line = line.substr(0, line.find('\n'));
  if (line.substr(0, line.find_first_not_of(" \t")).find('\t') != std::string_view::npos)
    return "; indent with blanks, not with tabs";
  const std::string& what = problem.msg;
  if (what.find("end of map flow") != std::string::npos) return "; a '{' is not closed, here or above";
  if (what.find("end of sequence flow") != std::string::npos) return "; a '[' is not closed, here or above";
  if (what.find("end of map") != std::string::npos || what.find("end of sequence") != std::string::npos)
    return "; expected a key and ':', as far from the left as the keys beside it";
  if (what.find("bad file") != std::string::npos) return "; it is nested too deep";
  return {};
}

/// Refuses a text of which yaml-cpp makes documents without end: what can begin nothing, such as a comma, it leaves
/// where it is, and takes it for an empty document again and again.
class ProgressCheck final : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark& mark) override {
    if (last_ && last_->pos == mark.pos)
      throw YAML::ParserException(mark, "what stands here can begin nothing; expected a key and ':'");
    last_ = mark;
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}

 private:
  std::optional<YAML::Mark> last_;
};

std::vector<YAML::Node> documents_of(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  ProgressCheck check;
  while (parser.HandleNextDocument(check)) continue;
  return YAML::LoadAll(text);
}

Settings parse(const std::string& text, const Source& source) {
  std::vector<YAML::Node> documents;
  try {
    documents = documents_of(text);
  } catch (const YAML::Exception& problem) {
    throw source.error(problem.mark, fmt::format("not valid YAML{}: {}{}", source.column_of(problem.mark), problem.msg,
                                                 remedy_for(text, problem)));
  }
  if (documents.size() > 1) {
    throw source.error(documents[1].Mark(),
                       fmt::format("found {} documents, expected one; remove the lines '---'", documents.size()));
  }
  if (documents.empty()) return Settings::null({source.name, source.has_lines ? 1 : 0});
  return Converter(source).convert(documents[0], documents[0].Mark());
}

}  // namespace

namespace {
constexpr std::size_t most_bytes = 50'000'000;
}

Settings load_yaml(const std::filesystem::path& file) {
  std::error_code problem;
  const std::filesystem::file_status status = std::filesystem::status(file, problem);
  if (!std::filesystem::exists(status)) {
    throw Error(fmt::format("{}: no such file; give the path of a YAML file", file.empty() ? "''" : file.string()));
  }
  if (std::filesystem::is_directory(status)) {
    throw Error(fmt::format("{}: is a directory; give the path of a YAML file in it", file.string()));
  }
  std::ifstream stream(file, std::ios::binary);
  std::string text;
  for (std::istreambuf_iterator<char> next(stream), end; next != end; ++next) {
    if (text.size() == most_bytes)  // a device gives as much as is read
      throw Error(fmt::format("{}: more than {} MB; expected a configuration in YAML; is it another file?",
                              file.string(), most_bytes / 1'000'000));
    text += *next;
  }
  if (!stream) throw Error(fmt::format("{}: cannot be read; check its permissions", file.string()));
  Settings read = parse_yaml(text, file.string());
  if (read.is_null())
    throw Error(
        fmt::format("{}: there is nothing in it; expected keys and values; is the file cut off?", file.string()));
  return read;
}

Settings parse_yaml(const std::string& text, const std::string& name) { return parse(text, {name, true}); }

void apply_assignment(Settings& settings, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  const Source source{fmt::format("--set {}", assignment), false};
  if (equals == std::string_view::npos || equals == 0) {
    throw source.error(YAML::Mark::null_mark(), "expected key.path=value, e.g. horizon.length=25");
  }
  Settings value = parse(std::string(assignment.substr(equals + 1)), source);
  settings.set(assignment.substr(0, equals), std::move(value));
}

}  // namespace rhec
