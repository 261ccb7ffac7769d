// Plugins whose manifest is right and whose factory fails, in a way chosen by a macro.
#include <stdexcept>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

class Failing : public rhec::Blocking {
 public:
  using Options = rhec::NoOptions;
  explicit Failing(const Options&) {
#if defined(THROWS_EXCEPTION)
    throw std::runtime_error("out of tea");
#elif defined(THROWS_LONG)
    throw std::runtime_error(std::string(100000, 'x'));
#else
    throw 42;
#endif
  }
  std::int64_t starts(const rhec::Window& window, std::uint8_t*) const noexcept override { return window.first; }
};

#if defined(RETURNS_NULL)
constexpr rhec::PluginInfo info{.name = "failing", .version = "1"};
constexpr rhec::Manifest silent() {
  auto manifest = rhec::make_manifest<rhec::PluginKind::blocking, Failing, info>();
  manifest.create = [](const rhec::Settings*, char*, std::size_t) noexcept -> void* { return nullptr; };
  manifest.schema = [](std::vector<rhec::OptionRow>*, char*, std::size_t) noexcept { return false; };
  return manifest;
}
#endif

}  // namespace

#if defined(RETURNS_NULL)
extern "C" {
extern RHEC_EXPORT const rhec::Manifest rhec_plugin_manifest;
constinit const rhec::Manifest rhec_plugin_manifest = silent();
}
#else
RHEC_PLUGIN(rhec::PluginKind::blocking, Failing, {.name = "failing", .version = "1"});
#endif
