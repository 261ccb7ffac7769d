#include "crash_report.hpp"

#include <dlfcn.h>
#include <execinfo.h>
#include <link.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "commands.hpp"

namespace rhec::apps {
namespace {

// Sanitizers tell of faults by themselves, and of more.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool is_sanitized = true;
#else
constexpr bool is_sanitized = false;
#endif

/// A plugin as a signal handler can name it, without memory of its own.
struct NamedPlugin {
  std::array<char, 512> path{};
  std::array<char, 256> title{};
};

std::array<NamedPlugin, 256> plugins;
std::atomic<std::size_t> plugin_count = 0;
std::atomic<bool> is_done = false;

template <std::size_t size>
void copy(const std::string& text, std::array<char, size>& to) {
  const std::size_t count = std::min(text.size(), size - 1);
  std::copy_n(text.begin(), count, to.begin());
  to[count] = '\0';
}

// All that follows is called in a signal handler.

void say(const char* text) {
  const ssize_t written = write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(written);  // there is nothing left to do about it
}

/// The file of the library that an address lies in; null if there is none.
const char* file_of(void* address) {
#if defined(DLFO_STRUCT_HAS_EH_DBASE)
  dl_find_object object{};
  return _dl_find_object(address, &object) == 0 ? object.dlfo_link_map->l_name : nullptr;
#else
  Dl_info info{};
  return dladdr(address, &info) != 0 ? info.dli_fname : nullptr;
#endif
}

const NamedPlugin* plugin_at(void* address) {
  const char* file = file_of(address);
  if (file == nullptr) return nullptr;
  for (std::size_t i = 0; i < plugin_count; ++i)
    if (std::strcmp(plugins[i].path.data(), file) == 0) return &plugins[i];
  return nullptr;
}

/// The plugin whose code runs at `place`, or that has called what runs there; null if there is none.
const NamedPlugin* plugin_running(void* place) {
  if (const NamedPlugin* plugin = place != nullptr ? plugin_at(place) : nullptr) return plugin;
  std::array<void*, 128> frames{};
  const int count = backtrace(frames.data(), static_cast<int>(frames.size()));
  for (int i = 0; i < count; ++i)
    if (const NamedPlugin* plugin = plugin_at(frames[static_cast<std::size_t>(i)])) return plugin;
  return nullptr;
}

void say_where(const NamedPlugin* plugin) {
  if (plugin == nullptr) return say(", in no plugin\n");
  say(" in the ");
  say(plugin->title.data());
  say(", or in what it called: ");
  say(plugin->path.data());
  say("\nrhec: leave this plugin out, or tell its author\n");
}

void* instruction_of(const void* context) {
#if defined(__x86_64__)
  return std::bit_cast<void*>(static_cast<const ucontext_t*>(context)->uc_mcontext.gregs[REG_RIP]);
#elif defined(__aarch64__)
  return std::bit_cast<void*>(static_cast<const ucontext_t*>(context)->uc_mcontext.pc);
#else
  static_cast<void>(context);
  return nullptr;
#endif
}

void tell_crash(int number, siginfo_t*, void* context) {
  std::signal(number, SIG_DFL);
  const char* name = sigabbrev_np(number);
  say("rhec: error: crashed (SIG");
  say(name != nullptr ? name : "?");
  say(")");
  say_where(plugin_running(instruction_of(context)));
  std::raise(number);
}

void tell_exit() {
  if (is_done) return;
  std::fflush(stdout);
  say("rhec: error: the program was ended before the command was done,");
  say_where(plugin_running(nullptr));
  _exit(exit_error);
}

}  // namespace

void install_crash_report() {
  std::atexit(&tell_exit);
  if (is_sanitized) return;
  std::array<void*, 1> frames{};
  backtrace(frames.data(), 1);                          // loads now what it needs
  static std::array<char, std::size_t{1} << 16> stack;  // for an overflow of the usual one
  stack_t other{};
  other.ss_sp = stack.data();
  other.ss_size = stack.size();
  sigaltstack(&other, nullptr);
  struct sigaction action {};
  action.sa_sigaction = &tell_crash;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) sigaction(number, &action, nullptr);
}

void name_in_crash_report(const Host& host) {
  for (const PluginRecord& plugin : host.discover()) {
    const std::size_t index = plugin_count;
    if (!plugin.accepted() || index == plugins.size()) continue;
    copy(plugin.path.string(), plugins[index].path);
    copy(plugin.title(), plugins[index].title);
    plugin_count = index + 1;
  }
}

void end_crash_report() { is_done = true; }

Host examined_host(const std::vector<std::filesystem::path>& plugin_path, bool anew) {
  Host host(plugin_path, {.apart = true, .anew = anew});
  name_in_crash_report(host);
  return host;
}

}  // namespace rhec::apps
