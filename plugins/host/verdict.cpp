#include "verdict.hpp"

#include <array>

namespace rhec {
namespace {

constexpr std::array outcomes{std::pair("made", PluginTrial::Outcome::made),
                              std::pair("needs_options", PluginTrial::Outcome::needs_options),
                              std::pair("failed", PluginTrial::Outcome::failed)};
constexpr std::array kinds{PluginKind::model, PluginKind::blocking, PluginKind::solver, PluginKind::prior,
                           PluginKind::term};
constexpr std::array texts{std::pair("refusal", &PluginRecord::refusal),
                           std::pair("remedy", &PluginRecord::remedy),
                           std::pair("name", &PluginRecord::name),
                           std::pair("version", &PluginRecord::version),
                           std::pair("licence", &PluginRecord::licence),
                           std::pair("source", &PluginRecord::source),
                           std::pair("backend", &PluginRecord::backend),
                           std::pair("backend_version", &PluginRecord::backend_version),
                           std::pair("capabilities", &PluginRecord::capabilities)};

std::string restored(std::string_view value) {
  std::string text;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (value[i] != '\\' || i + 1 == value.size()) {
      text += value[i];
    } else {
      text += value[++i] == 'n' ? '\n' : value[i];
    }
  }
  return text;
}

bool take_kind(std::string_view value, PluginKind& kind) {
  for (const PluginKind each : kinds) {
    if (value != word_of(each)) continue;
    kind = each;
    return true;
  }
  return false;
}

bool take_outcome(std::string_view value, PluginTrial::Outcome& outcome) {
  for (const auto& [word, each] : outcomes) {
    if (value != word) continue;
    outcome = each;
    return true;
  }
  return false;
}

/// "stamp, path".
bool take_library(std::string_view value, std::vector<NeededLibrary>& libraries) {
  const std::size_t comma = value.find(", ");
  if (comma == std::string_view::npos) return false;
  const auto stamp = stamp_from(value.substr(0, comma));
  if (stamp) libraries.push_back({value.substr(comma + 2), *stamp});
  return stamp.has_value();
}

}  // namespace

std::string report_line(std::string_view key, std::string_view value) {
  std::string line(key);
  line += ' ';
  for (const char c : value) {
    if (c == '\\') line += '\\';
    line += c == '\n' ? std::string("\\n") : std::string(1, c);
  }
  return line + '\n';
}

std::vector<std::pair<std::string, std::string>> report_lines(std::string_view text) {
  std::vector<std::pair<std::string, std::string>> lines;
  for (std::size_t end = text.find('\n'); end != std::string_view::npos; end = text.find('\n')) {
    const std::string_view line = text.substr(0, end);
    const std::size_t space = line.find(' ');
    if (space != std::string_view::npos) lines.emplace_back(line.substr(0, space), restored(line.substr(space + 1)));
    text.remove_prefix(end + 1);
  }
  return lines;
}

bool take_line(std::string_view key, std::string_view value, Verdict& verdict) {
  if (key == "kind") return take_kind(value, verdict.record.kind);
  if (key == "outcome") return take_outcome(value, verdict.trial.outcome);
  if (key == "library") return take_library(value, verdict.libraries);
  if (key == "trial") {
    verdict.trial.text = value;
    return true;
  }
  if (key == "harmful") {
    verdict.harmful = value == "yes";
    return verdict.harmful || value == "no";
  }
  for (const auto& [name, text] : texts) {
    if (key != name) continue;
    verdict.record.*text = value;
    return true;
  }
  return false;
}

std::string lines_of(const Verdict& verdict) {
  std::string all = report_line("harmful", verdict.harmful ? "yes" : "no");
  for (const PluginKind kind : kinds) {
    if (verdict.record.kind == kind) all += report_line("kind", word_of(kind));
  }
  for (const auto& [name, text] : texts) all += report_line(name, verdict.record.*text);
  for (const auto& [word, outcome] : outcomes) {
    if (verdict.trial.outcome == outcome) all += report_line("outcome", word);
  }
  all += report_line("trial", verdict.trial.text);
  for (const NeededLibrary& library : verdict.libraries)
    all += report_line("library", text_of(library.stamp) + ", " + library.path.string());
  return all;
}

}  // namespace rhec
