// A plugin that harms the program which looks at it or uses it, in a way chosen by the name of its file. Its manifest
// is right.
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

/// Whether the file of this library is called `name`.so.
bool is_called(std::string_view name) {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&is_called), &info) == 0) std::abort();
  const std::string path = info.dli_fname;
  return path.substr(path.rfind('/') + 1) == std::string(name) + ".so";
}

[[noreturn]] void crash() {
  volatile int* volatile nowhere = nullptr;
  *nowhere = 1;
  std::abort();
}
void wait_forever() {
  while (true) std::this_thread::sleep_for(std::chrono::hours(1));
}
int recurse(volatile int* depth) {
  volatile int here[1000] = {*depth + 1};
  return here[0] > 0 ? recurse(here) + here[1] : 0;
}
void throw_anything() { throw 42; }
void overflow() {
  volatile int depth = 0;
  recurse(&depth);
}
void compute_forever() {
  volatile bool goes_on = true;
  while (goes_on) continue;
}
void start_processes_forever() {
  while (true) static_cast<void>(fork());
}
void close_all() {
  for (int descriptor = 0; descriptor < 100; ++descriptor) close(descriptor);
}
void allocate_forever() {
  while (true) std::memset(std::malloc(1 << 20), 1, 1 << 20);
}
void write_beyond() {
  volatile std::size_t size = 4;
  auto* const bytes = new volatile char[size];
  bytes[size] = 'x';  // one too many
  delete[] bytes;
}
void allocate_much() {
  std::vector<char> large(std::size_t{10} << 30);
  large.back() = 1;
}

/// Runs when the library is loaded, and when the program ends.
struct Constructed {
  Constructed() {
    if (is_called("constructor_crashes")) crash();
    if (is_called("constructor_hangs")) wait_forever();
    if (is_called("constructor_computes")) compute_forever();
    if (is_called("constructor_exits")) std::exit(0);
    if (is_called("constructor_leaves")) _exit(0);
    if (is_called("constructor_throws")) throw 42;
    if (is_called("constructor_recurses")) overflow();
    if (is_called("forks") && fork() == 0) wait_forever();
    if (is_called("forks_forever")) start_processes_forever();
    if (is_called("runs_program")) execl("/bin/true", "true", nullptr);
    if (is_called("kills_parent")) kill(getppid(), SIGKILL);
    if (is_called("closes_stdout")) close(STDOUT_FILENO);
    if (is_called("replaces_stdout")) dup2(open("/dev/null", O_WRONLY | O_CLOEXEC), STDOUT_FILENO);
    if (is_called("closes_all")) close_all();
    if (is_called("changes_folder") && chdir("/") != 0) crash();
    if (is_called("stops")) raise(SIGSTOP);
    if (is_called("prints")) std::puts("hello");
  }
  ~Constructed() {
    if (is_called("destructor_crashes")) crash();
  }
};
const Constructed constructed;

class Harmful : public rhec::Blocking {
 public:
  using Options = rhec::NoOptions;
  explicit Harmful(const Options&) {
    if (is_called("factory_crashes")) crash();
    if (is_called("factory_hangs")) wait_forever();
    if (is_called("factory_exits")) std::exit(0);
    if (is_called("factory_overruns")) write_beyond();
    if (is_called("factory_allocates")) allocate_much();
    if (is_called("factory_allocates_forever")) allocate_forever();
  }
  ~Harmful() override {
    if (is_called("destroy_crashes")) crash();
  }
  std::int64_t starts(const rhec::Window& window, std::uint8_t* begins) const noexcept override {
    if (is_called("use_crashes")) crash();
    if (is_called("use_exits")) std::exit(0);
    if (is_called("use_overflows")) overflow();
    for (int i = 0; i < window.intervals; ++i) begins[i] = 1;
    return window.first;
  }
};

constexpr rhec::PluginInfo info{.name = "harmful", .version = "1"};
using Usual = rhec::PluginFunctions<rhec::PluginKind::blocking, Harmful, info>;

constexpr rhec::Manifest manifest() {
  auto all = rhec::make_manifest<rhec::PluginKind::blocking, Harmful, info>();
  all.schema = [](std::vector<rhec::OptionRow>* rows, char* error, std::size_t size) noexcept {
    if (is_called("options_crash")) crash();
    return Usual::schema(rows, error, size);
  };
  all.create = [](const rhec::Settings* settings, char* error, std::size_t size) noexcept -> void* {
    if (is_called("factory_throws")) throw_anything();
    return Usual::create(settings, error, size);
  };
  return all;
}

}  // namespace

extern "C" {
extern RHEC_EXPORT const rhec::Manifest rhec_plugin_manifest;
constinit const rhec::Manifest rhec_plugin_manifest = manifest();
}
