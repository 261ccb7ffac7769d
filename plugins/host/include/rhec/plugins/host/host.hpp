#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/examination.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace rhec {

class Model;
class Blocking;
class Solver;
class Prior;
class Term;

/// A directory that is searched for plugins.
struct PluginPlace {
  std::filesystem::path directory;
  std::string origin;   ///< "given", "RHEC_PLUGIN_PATH" or "installed"
  std::string skipped;  ///< why it was not searched; empty if it was
  std::string warning;  ///< what is better changed although it is searched; empty if nothing
};

/// A candidate file, and whether it is used as a plugin.
struct RHEC_EXPORT PluginRecord {
  std::filesystem::path path;
  std::string refusal;  ///< why it is not used: what was found and what was expected; empty if it is used
  std::string remedy;   ///< how to fix that
  /// The plugin of the same kind and name that is used instead of this one, if this one is valid; otherwise empty.
  std::filesystem::path used_instead;
  // From the manifest; empty if it could not be read.
  PluginKind kind{};
  std::string name, version, licence, source, backend, backend_version, capabilities;

  bool accepted() const noexcept { return refusal.empty(); }
  std::string explanation() const;  ///< refusal and remedy in one text
  std::string title() const;        ///< "blocking 'structured' 0.1.0"; "the plugin" if it has no name
};

/// The result of making an object of an accepted plugin without options.
struct PluginTrial {
  enum class Outcome {
    made,
    needs_options,  ///< not made: the plugin reports that an option without a default is missing
    failed
  };
  Outcome outcome = Outcome::made;
  std::string text;  ///< the plugin's error if no object was made; for a model, its numbers of variables
};

/// Finds plugins, loads them, and makes objects of them.
///
/// It searches, in this order: the directories given; those of the environment variable RHEC_PLUGIN_PATH (absolute,
/// separated by colons; empty and relative entries are skipped, since they would refer to the working directory); and
/// `rhec/plugins` next to the library that contains this class. Of two plugins of the same kind and name, the first one
/// found is used.
///
/// A directory, or a file, that every user may write to is refused: anybody could put code there that then runs as the
/// user of this program. One that its group may write to is searched, with a warning.
///
/// A candidate is any entry whose name ends in `.so`. It is passed to the loader only if it is a complete shared
/// library for this machine that exports a manifest. Loading runs the constructors of a library and of its dependencies
/// before anything in it can be checked, so list only directories whose files you trust. Everything else is checked
/// after loading and before any function of the plugin is called. Accepted libraries stay loaded until the process
/// ends, since their objects, texts and types may still be in use; refused ones are unloaded. With `Examination::apart`
/// all of this happens in another process first, and what does harm there is not loaded into this one:
///
///     const rhec::Host host({}, {.apart = true});
///
/// The search runs once, on first use. All calls are const and thread-safe; copies share one search.
class RHEC_EXPORT Host {
 public:
  explicit Host(const std::vector<std::filesystem::path>& given = {}, const Examination& examination = {});

  const std::vector<PluginPlace>& places() const;
  /// All candidates, accepted or not, in search order.
  const std::vector<PluginRecord>& discover() const;
  /// The candidates of one place.
  std::vector<PluginRecord> found_in(const PluginPlace& place) const;
  /// The accepted plugins of a kind, in search order.
  std::vector<std::string> names(PluginKind kind) const;

  /// A new object of the plugin `name`, with the options in `settings` (a map whose key "name" is ignored, or null for
  /// defaults). Throws Error if there is no such plugin, with every place searched, why files there were refused and
  /// which plugins exist; if options are wrong, with the place of the mistake; if the plugin failed, with its message.
  /// A model's name may also be that of a file with its equations (rhec/plugins/equations/equations.hpp), and of no
  /// account where the settings have a map of equations themselves.
  std::shared_ptr<Model> make_model(std::string_view name, const Settings& settings = {}) const;
  std::shared_ptr<Blocking> make_blocking(std::string_view name, const Settings& settings = {}) const;
  std::shared_ptr<Solver> make_solver(std::string_view name, const Settings& settings = {}) const;
  /// To be set up for a parameter.
  std::shared_ptr<Prior> make_prior(std::string_view name, const Settings& settings = {}) const;
  /// The name is of no account where the settings have a map of equations (rhec/plugins/equations/equation_term.hpp).
  std::shared_ptr<Term> make_term(std::string_view name, const Settings& settings = {}) const;

  /// The options of a plugin. Throws Error as above.
  std::vector<OptionRow> options(PluginKind kind, std::string_view name) const;

  /// Reads the options of an accepted plugin, and makes an object with their defaults; with `Examination::apart`, what
  /// that came to in the examination. An option has no default if its default is an empty text or list; it counts as
  /// missing if the error names it as a key ("lengths: ..."). Throws Error for a plugin that is not accepted, without
  /// calling it.
  PluginTrial try_out(const PluginRecord& plugin) const;

  /// Every place and what was found there, as human-readable lines.
  std::string diagnosis() const;

 private:
  struct Search;
  std::shared_ptr<Search> search_;
};

/// "model", "blocking", "solver", "prior" or "term".
RHEC_EXPORT std::string_view word_of(PluginKind kind);

}  // namespace rhec
