#include "rhec/plugins/host/host.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>

#include "examine.hpp"
#include "examiner_process.hpp"
#include "factory.hpp"
#include "library.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/prior/prior.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/plugins/equations/equation_term.hpp"
#include "rhec/plugins/equations/equations.hpp"

namespace rhec {
namespace {

namespace fs = std::filesystem;

/// `rhec/plugins` next to the library that contains this function; empty if the loader does not know it.
fs::path installed_directory() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&installed_directory), &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code problem;
  const fs::path library = fs::canonical(info.dli_fname, problem);
  return problem ? fs::path() : library.parent_path() / "rhec" / "plugins";
}

class PlaceList {
 public:
  void add(const fs::path& directory, const std::string& origin) {
    std::error_code problem;
    const fs::path canonical = fs::canonical(directory, problem);
    if (problem == std::errc::no_such_file_or_directory) return skip(directory, origin, "no such directory");
    if (problem) return skip(directory, origin, problem.message());
    const fs::file_status status = fs::status(canonical, problem);
    if (!fs::is_directory(status)) return skip(canonical, origin, "a file, not a directory");
    if (all_may_write(status.permissions()))
      return skip(canonical, origin,
                  fmt::format("every user may write to it, and so have their code run here; run 'chmod o-w {}', and "
                              "look at what is in it",
                              canonical.string()));
    const fs::directory_iterator readable(canonical, problem);
    if (problem) return skip(canonical, origin, problem.message());
    const bool seen = std::any_of(places_.begin(), places_.end(), [&](const PluginPlace& place) {
      return place.skipped.empty() && place.directory == canonical;
    });
    if (seen) return skip(canonical, origin, "searched already");
    std::string warning;
    if ((status.permissions() & fs::perms::group_write) != fs::perms::none)
      warning = fmt::format("its group may write to it; if these are not all trusted, run 'chmod g-w {}'",
                            canonical.string());
    places_.push_back({canonical, origin, {}, std::move(warning)});
  }

  void skip(const fs::path& directory, const std::string& origin, const std::string& reason) {
    places_.push_back({directory, origin, reason, {}});
  }

  std::vector<PluginPlace> take() { return std::move(places_); }

 private:
  std::vector<PluginPlace> places_;
};

std::vector<PluginPlace> places_of(const std::vector<fs::path>& given) {
  PlaceList places;
  for (const fs::path& directory : given) {
    if (directory.empty()) {
      places.skip(directory, "given", "an empty name");
    } else {
      places.add(directory, "given");
    }
  }
  const std::string variable = "RHEC_PLUGIN_PATH";
  if (const char* value = secure_getenv(variable.c_str())) {
    std::string_view rest = value;
    while (true) {
      const std::size_t colon = rest.find(':');
      const fs::path directory(rest.substr(0, colon));
      if (directory.is_absolute()) {
        places.add(directory, variable);
      } else {
        places.skip(directory, variable,
                    directory.empty() ? "an empty entry, which would mean the working directory; remove it"
                                      : "a relative entry, which would mean the working directory; make it absolute");
      }
      if (colon == std::string_view::npos) break;
      rest.remove_prefix(colon + 1);
    }
  }
  const fs::path installed = installed_directory();
  if (!installed.empty()) places.add(installed, "installed");
  return places.take();
}

std::vector<fs::path> libraries_in(const fs::path& directory) {
  std::vector<fs::path> files;
  std::error_code problem;
  for (fs::directory_iterator entry(directory, problem), end; !problem && entry != end; entry.increment(problem)) {
    if (entry->path().extension() == ".so") files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());  // directory entries come in no particular order
  return files;
}

/// Indents all lines after the first.
std::string indented(const std::string& text, std::size_t indent) {
  std::string result;
  for (const char c : text) {
    result += c;
    if (c == '\n') result.append(indent, ' ');
  }
  return result;
}

}  // namespace

struct Host::Search {
  std::vector<PluginPlace> places;
  Examination examination;

  const std::vector<PluginRecord>& records() {
    std::call_once(done_, [this] { run(); });
    return records_;
  }

  /// The library of a plugin; throws Error with the whole diagnosis if there is none.
  const Library& require(PluginKind kind, std::string_view name, const Settings& settings, const Host& host) {
    for (std::size_t i = 0; i < records().size(); ++i) {
      const PluginRecord& record = records_[i];
      if (record.accepted() && record.kind == kind && record.name == name) return loaded(i, settings);
    }
    const std::vector<std::string> known = host.names(kind);
    const std::string near = nearest(name, known);
    std::string text = fmt::format("there is no {} plugin '{}'", word_of(kind), name);
    if (!near.empty()) text += fmt::format("; did you mean '{}'?", near);
    text +=
        fmt::format("\navailable: {}\nsearched:\n  {}",
                    known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", ")), indented(host.diagnosis(), 2));
    text.erase(text.find_last_not_of(" \n") + 1);
    throw plugin_error(settings, text);
  }

  template <class Interface>
  std::shared_ptr<Interface> make(PluginKind kind, std::string_view name, const Settings& settings, const Host& host) {
    return std::static_pointer_cast<Interface>(make_object(require(kind, name, settings, host), settings));
  }

  /// The result of a trial: of the examination if there was one.
  PluginTrial trial_of(const PluginRecord& plugin) {
    for (std::size_t i = 0; i < records().size(); ++i) {
      if (records_[i].path != plugin.path) continue;
      return examination.apart ? trials_[i] : try_library(loaded(i, {}), ignore_stage);
    }
    throw Error(fmt::format("{}: this host has not found it", plugin.path.string()));
  }

 private:
  static void ignore_stage(std::string_view) {}

  void run() {
    std::vector<fs::path> files;
    for (const PluginPlace& place : places) {
      if (!place.skipped.empty()) continue;
      for (fs::path& file : libraries_in(place.directory)) files.push_back(std::move(file));
    }
    libraries_.resize(files.size());
    if (examination.apart) {
      for (Verdict& verdict : examine_apart(files, examination, examiner_program())) {
        trials_.push_back(std::move(verdict.trial));
        add(std::move(verdict.record));
      }
    } else {
      for (std::size_t i = 0; i < files.size(); ++i) {
        libraries_[i] = load_library(files[i], ignore_stage);
        add(libraries_[i].record);
      }
    }
  }

  void add(PluginRecord record) {
    shadow(record);
    records_.push_back(std::move(record));
  }

  /// The library of an accepted plugin. One that was examined apart is loaded when it is first needed.
  const Library& loaded(std::size_t index, const Settings& settings) {
    const std::scoped_lock lock(loading_);
    Library& library = libraries_[index];
    if (library.manifest) return library;
    library = load_library(records_[index].path, ignore_stage);
    const PluginRecord& found = library.record;
    if (library.manifest && found.kind == records_[index].kind && found.name == records_[index].name) return library;
    library.manifest = nullptr;
    throw plugin_error(settings, fmt::format("{}: {}", found.path.string(),
                                             found.accepted() ? "it is not the plugin any more that was examined"
                                                              : found.explanation()));
  }

  void shadow(PluginRecord& record) const {
    if (!record.accepted()) return;
    for (const PluginRecord& before : records_) {
      if (!before.accepted() || before.kind != record.kind || before.name != record.name) continue;
      const bool together = before.path.parent_path() == record.path.parent_path();
      record.used_instead = before.path;
      record.refusal =
          fmt::format("shadowed: {} is {} too and was found first, since {}", before.path.string(), before.title(),
                      together ? "its file name sorts before" : "its directory is searched before");
      record.remedy = fmt::format("remove one of the two files, or give one of the plugins another name{}",
                                  together ? "" : ", or have the other directory searched first (--plugin-path)");
      return;
    }
  }

  std::once_flag done_;
  std::mutex loading_;
  std::vector<PluginRecord> records_;
  std::vector<Library> libraries_;   ///< one per record
  std::vector<PluginTrial> trials_;  ///< one per record, if they were examined apart
};

std::string PluginRecord::explanation() const { return remedy.empty() ? refusal : refusal + "; " + remedy; }

std::string PluginRecord::title() const {
  if (name.empty()) return "the plugin";
  return fmt::format("{} '{}'{}{}", word_of(kind), name, version.empty() ? "" : " ", version);
}

Host::Host(const std::vector<fs::path>& given, const Examination& examination) : search_(std::make_shared<Search>()) {
  search_->places = places_of(given);
  search_->examination = examination;
}

const std::vector<PluginPlace>& Host::places() const { return search_->places; }

const std::vector<PluginRecord>& Host::discover() const { return search_->records(); }

std::vector<PluginRecord> Host::found_in(const PluginPlace& place) const {
  std::vector<PluginRecord> found;
  if (!place.skipped.empty()) return found;
  for (const PluginRecord& record : discover()) {
    if (record.path.parent_path() == place.directory) found.push_back(record);
  }
  return found;
}

std::vector<std::string> Host::names(PluginKind kind) const {
  std::vector<std::string> all;
  for (const PluginRecord& record : discover()) {
    if (record.accepted() && record.kind == kind) all.push_back(record.name);
  }
  return all;
}

std::string Host::diagnosis() const {
  std::string text;
  for (const PluginPlace& place : places()) {
    text += fmt::format("{} ({}){}\n", place.directory.empty() ? "''" : place.directory.string(), place.origin,
                        place.skipped.empty() ? "" : ": " + place.skipped);
    if (!place.warning.empty()) text += fmt::format("  warning: {}\n", place.warning);
    if (!place.skipped.empty()) continue;
    const std::vector<PluginRecord> found = found_in(place);
    for (const PluginRecord& record : found) {
      const std::string file = record.path.filename().string();
      text += record.accepted()
                  ? fmt::format("  {}: {} '{}' {}\n", file, word_of(record.kind), record.name, record.version)
                  : fmt::format("  {}: refused: {}\n", file, indented(record.explanation(), 4));
    }
    if (found.empty()) text += "  no file that ends in .so\n";
  }
  return text;
}

std::vector<OptionRow> Host::options(PluginKind kind, std::string_view name) const {
  if (kind == PluginKind::model && is_equations_file(name)) return vehicle_options(name);
  return options_of(search_->require(kind, name, {}, *this));
}

PluginTrial Host::try_out(const PluginRecord& plugin) const {
  if (!plugin.accepted()) throw Error(fmt::format("{}: {}", plugin.path.string(), plugin.explanation()));
  return search_->trial_of(plugin);
}

std::shared_ptr<Model> Host::make_model(std::string_view name, const Settings& settings) const {
  const Settings* equations = settings.find("equations");
  if (equations && equations->kind() == Settings::Kind::map)
    return choose_outputs(load_inline_vehicle(settings), settings);
  if (is_equations_file(name)) return choose_outputs(load_vehicle(name, settings), settings);
  return choose_outputs(search_->make<Model>(PluginKind::model, name, settings, *this), settings);
}

std::shared_ptr<Blocking> Host::make_blocking(std::string_view name, const Settings& settings) const {
  return search_->make<Blocking>(PluginKind::blocking, name, settings, *this);
}

std::shared_ptr<Solver> Host::make_solver(std::string_view name, const Settings& settings) const {
  return search_->make<Solver>(PluginKind::solver, name, settings, *this);
}

std::shared_ptr<Prior> Host::make_prior(std::string_view name, const Settings& settings) const {
  return search_->make<Prior>(PluginKind::prior, name, settings, *this);
}

std::shared_ptr<Term> Host::make_term(std::string_view name, const Settings& settings) const {
  const Settings* equations = settings.find("equations");
  if (equations && equations->kind() == Settings::Kind::map) return load_inline_term(settings);
  return search_->make<Term>(PluginKind::term, name, settings, *this);
}

std::string_view word_of(PluginKind kind) {
  switch (kind) {
    case PluginKind::model:
      return "model";
    case PluginKind::blocking:
      return "blocking";
    case PluginKind::solver:
      return "solver";
    case PluginKind::prior:
      return "prior";
    case PluginKind::term:
      return "term";
  }
  return "plugin of an unknown kind";
}

}  // namespace rhec
