#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace rhec {

class Model;
class Blocking;
class Solver;

/// A directory that plugins are looked for in.
struct PluginPlace {
  std::filesystem::path directory;
  std::string origin;   ///< "given", "RHEC_PLUGIN_PATH" or "installed"
  std::string skipped;  ///< why it was not searched; empty if it was
};

/// A file that could be a plugin, and what came of it.
struct RHEC_EXPORT PluginRecord {
  std::filesystem::path path;
  std::string refusal;  ///< why it is not used: what was found and what was expected; empty: it is used
  std::string remedy;   ///< what to do about that
  /// The plugin of the same kind and name that is used in the place of this one, which is fine in itself; else empty.
  std::filesystem::path used_instead;
  // What the manifest says; empty where it could not be read.
  PluginKind kind{};
  std::string name, version, licence, source, backend, backend_version, capabilities;

  bool accepted() const noexcept { return refusal.empty(); }
  std::string explanation() const;  ///< refusal and remedy in one
  std::string title() const;        ///< "blocking 'structured' 0.1.0"; "the plugin" where it has no name
};

/// What came of making an object of an accepted plugin with no options given.
struct PluginTrial {
  enum class Outcome {
    made,
    needs_options,  ///< not made for lack of an option without a default, as the plugin itself says
    failed
  };
  Outcome outcome = Outcome::made;
  std::string text;  ///< the plugin's words where none was made; the numbers of variables of a model
};

/// Finds plugins, loads them, and makes objects of them.
///
/// Searched are, in this order: the directories given; those of the environment variable RHEC_PLUGIN_PATH (absolute,
/// with colons between them; empty and relative entries are skipped, since they would mean the working directory); and
/// `rhec/plugins` beside the library that this class is in. Of two plugins of one kind and name the first one found is
/// used.
///
/// A candidate is whatever has a name that ends in `.so`. It is handed to the loader only if it is a whole shared
/// library for this machine that shows a manifest: loading runs the constructors of a library and of those it needs
/// before anything in it can be checked, so a directory on the search path must be one whose files are trusted to run.
/// All else is checked after loading and before any function of the plugin is called. Accepted libraries stay loaded
/// until the process ends, since objects, texts and types of theirs may be anywhere; refused ones are let go.
///
/// The search is done once, on first use. All calls are const and may come from several threads; copies share one
/// search.
class RHEC_EXPORT Host {
 public:
  explicit Host(const std::vector<std::filesystem::path>& given = {});

  const std::vector<PluginPlace>& places() const;
  /// All candidates, accepted or not, in search order.
  const std::vector<PluginRecord>& discover() const;
  /// Those of one place.
  std::vector<PluginRecord> found_in(const PluginPlace& place) const;
  /// The accepted plugins of a kind, in search order.
  std::vector<std::string> names(PluginKind kind) const;

  /// A new object of the plugin `name`, with the options in `settings` (a map whose key "name" is passed over, or null
  /// for defaults). Throws Error: where there is no such plugin, with every place searched, why files there were
  /// refused and what there is; where options are wrong, with the place of the mistake; where the plugin failed, with
  /// its words.
  std::shared_ptr<Model> make_model(std::string_view name, const Settings& settings = {}) const;
  std::shared_ptr<Blocking> make_blocking(std::string_view name, const Settings& settings = {}) const;
  std::shared_ptr<Solver> make_solver(std::string_view name, const Settings& settings = {}) const;

  /// The options of a plugin. Throws Error as above.
  std::vector<OptionRow> options(PluginKind kind, std::string_view name) const;

  /// Asks an accepted plugin for its options, and for an object with their defaults. An option counts as one without a
  /// default if that is an empty text or list, and its lack as told if the error names it as a key ("lengths: ...").
  /// Throws Error for a plugin that is not accepted: nothing of it is called.
  PluginTrial try_out(const PluginRecord& plugin) const;

  /// Every place and what was found there, for people, in lines.
  std::string diagnosis() const;

 private:
  struct Search;
  std::shared_ptr<Search> search_;
};

/// "model", "blocking" or "solver".
RHEC_EXPORT std::string_view word_of(PluginKind kind);

}  // namespace rhec
