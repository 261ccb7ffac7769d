#pragma once

#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "rhec/core/config/options.hpp"
#include "rhec/plugins/kit/fingerprint.hpp"
#include "rhec/plugins/kit/manifest.hpp"

/// Everything a plugin author needs. A plugin is a class and one line:
///
///     class EveryOther : public rhec::Blocking {
///      public:
///       using Options = EveryOtherOptions;                  // has static const OptionTable<Options>& table()
///       explicit EveryOther(const Options& options);
///       ...
///     };
///     RHEC_PLUGIN(rhec::PluginKind::blocking, EveryOther,
///                 {.name = "every_other", .version = "1.0.0", .licence = "MIT"})
///
/// compiled into a shared library with hidden visibility (-fvisibility=hidden: otherwise plugins that use the same
/// names would share statics of inline functions), linked to rhec::core, and placed in a directory that the host
/// searches. A class whose name contains a comma needs an alias. A plugin without options declares `using Options =
/// rhec::NoOptions`. The constructor throws rhec::Error if its options are inconsistent; destructors do not throw. The
/// file with this line includes the interface that the plugin implements (rhec/core/model/model.hpp, blocking.hpp,
/// solver.hpp, prior.hpp, or rhec/core/term/term.hpp).
namespace rhec {

class Model;
class Blocking;
class Solver;
class Prior;
class Term;

/// The author's description of a plugin; see Manifest for the meaning. `name` and `version` are required.
struct PluginInfo {
  const char* name;
  const char* version;
  const char* licence = "";
  const char* source = "";
  const char* backend = "";
  const char* backend_version = "";
  const char* capabilities = "";
};

/// For plugins without options.
struct NoOptions {
  static const OptionTable<NoOptions>& table() {
    static const OptionTable<NoOptions> empty;
    return empty;
  }
};

template <PluginKind kind>
struct PluginInterface;
template <>
struct PluginInterface<PluginKind::model> {
  using Type = Model;
  static constexpr const char* word = "model";
};
template <>
struct PluginInterface<PluginKind::blocking> {
  using Type = Blocking;
  static constexpr const char* word = "blocking";
};
template <>
struct PluginInterface<PluginKind::solver> {
  using Type = Solver;
  static constexpr const char* word = "solver";
};
template <>
struct PluginInterface<PluginKind::prior> {
  using Type = Prior;
  static constexpr const char* word = "prior";
};
template <>
struct PluginInterface<PluginKind::term> {
  using Type = Term;
  static constexpr const char* word = "term";
};

/// The functions of a manifest for a class `Product`; they turn every exception into a message.
template <PluginKind kind, class Product, const PluginInfo& info>
struct PluginFunctions {
  using Interface = typename PluginInterface<kind>::Type;
  using Options = typename Product::Options;
  static_assert(std::is_base_of_v<Interface, Product>, "the class does not derive from the interface of its kind");
  static_assert(std::is_constructible_v<Product, const Options&>, "the class has no constructor from its Options");

  static std::string title() { return std::string(PluginInterface<kind>::word) + " '" + info.name + "'"; }

  static bool schema(std::vector<OptionRow>* rows, char* error, std::size_t error_size) noexcept {
    return guarded(error, error_size, [&] {
      for (OptionRow& row : Options::table().schema()) rows->push_back(std::move(row));
    });
  }

  static void* create(const Settings* settings, char* error, std::size_t error_size) noexcept {
    void* made = nullptr;
    guarded(error, error_size, [&] {
      // The host handles "outputs": it selects among the outputs of any model.
      const Options options = kind == PluginKind::model
                                  ? Options::table().parse(*settings, title(), {"name", "outputs"})
                                  : Options::table().parse(*settings, title(), {"name"});
      made = static_cast<Interface*>(std::make_unique<Product>(options).release());
    });
    return made;
  }

  static void destroy(void* object) noexcept { delete static_cast<Interface*>(object); }

 private:
  template <class Work>
  static bool guarded(char* error, std::size_t error_size, Work work) noexcept {
    try {
      work();
      return true;
    } catch (const Error& mistake) {  // its message is complete
      std::snprintf(error, error_size, "%s", mistake.what());
    } catch (const std::exception& failure) {
      std::snprintf(error, error_size, "%s '%s' failed: %s", PluginInterface<kind>::word, info.name, failure.what());
    } catch (...) {
      std::snprintf(error, error_size, "%s '%s' failed: it threw something that is no std::exception",
                    PluginInterface<kind>::word, info.name);
    }
    return false;
  }
};

template <PluginKind kind, class Product, const PluginInfo& info>
constexpr Manifest make_manifest() {
  using Functions = PluginFunctions<kind, Product, info>;
  Manifest manifest;
  manifest.kind = kind;
  manifest.fingerprint = RHEC_BUILD_FINGERPRINT;
  manifest.name = info.name;
  manifest.version = info.version;
  manifest.licence = info.licence;
  manifest.source = info.source;
  manifest.backend = info.backend;
  manifest.backend_version = info.backend_version;
  manifest.capabilities = info.capabilities;
  manifest.schema = &Functions::schema;
  manifest.create = &Functions::create;
  manifest.destroy = &Functions::destroy;
  return manifest;
}

}  // namespace rhec

/// Makes the library that contains it a plugin: RHEC_PLUGIN(kind, class, {PluginInfo}), once, at namespace scope. The
/// manifest is constant data: it can be read before any code of the plugin has run.
#define RHEC_PLUGIN(KIND, CLASS, ...)                                                                             \
  static constexpr ::rhec::PluginInfo rhec_plugin_info = __VA_ARGS__;                                             \
  extern "C" {                                                                                                    \
  extern RHEC_EXPORT const ::rhec::Manifest rhec_plugin_manifest;                                                 \
  constinit const ::rhec::Manifest rhec_plugin_manifest = ::rhec::make_manifest<KIND, CLASS, rhec_plugin_info>(); \
  }                                                                                                               \
  static_assert(rhec_plugin_info.name != nullptr && rhec_plugin_info.version != nullptr, "a plugin has both")
