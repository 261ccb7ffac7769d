// Examines one plugin, for rhec::Examination: examine_plugin FILE SECONDS BYTES. It is not meant to be called by hand.
// What it finds goes to descriptor 3; what the plugin does to this process is seen by the one that started it.
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "rhec/plugins/host/examination.hpp"
#include "walls.hpp"

namespace rhec::apps {
namespace {

constexpr int exit_examined = 0, exit_not_told = kExaminationNotTold, exit_usage = 71;

/// Async-signal-safe, and does not come back where there is nobody to tell.
void tell(std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = write(report_descriptor, text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) _exit(exit_not_told);
    text.remove_prefix(static_cast<std::size_t>(count));
  }
}

/// What a plugin must leave as it was.
class Surroundings {
 public:
  Surroundings() : folder_(std::filesystem::current_path()) {
    for (int stream = 0; stream < static_cast<int>(streams_.size()); ++stream)
      fstat(stream, &streams_[static_cast<std::size_t>(stream)]);
  }

  /// What has changed; empty if nothing has.
  std::string change() const {
    constexpr std::array names{"standard input", "standard output", "standard error"};
    for (std::size_t stream = 0; stream < streams_.size(); ++stream) {
      struct stat now {};
      if (fstat(static_cast<int>(stream), &now) != 0) return std::string("it closed ") + names[stream];
      const struct stat& before = streams_[stream];
      if (now.st_dev != before.st_dev || now.st_ino != before.st_ino)
        return std::string("it replaced ") + names[stream];
    }
    std::error_code problem;
    if (std::filesystem::current_path(problem) != folder_ || problem) return "it changed the working directory";
    if (waitpid(-1, nullptr, WNOHANG) >= 0 || errno != ECHILD) return "it started another process";
    return {};
  }

 private:
  std::array<struct stat, 3> streams_{};
  std::filesystem::path folder_;
};

/// Reads the number that a word is; false if it is none.
bool read(const char* word, std::size_t& number) {
  const char* end = word + std::strlen(word);
  return std::from_chars(word, end, number).ptr == end;
}

int examine(int count, char** words) {
  std::size_t seconds = 0, bytes = 0;
  if (count != 4 || !read(words[2], seconds) || !read(words[3], bytes)) return exit_usage;
  if (close_range(report_descriptor + 1, ~0u, 0) != 0) errno = 0;  // an old kernel: what was inherited stays open
  build_walls(std::chrono::seconds(seconds), bytes);
  std::set_new_handler([] {
    std::set_new_handler(nullptr);
    tell("memory exceeded\n");
  });
  const Surroundings before;
  const pid_t own = getpid();
  examine_in_this_process(words[1], [&](std::string_view lines) {
    // A copy of this process that the plugin has made must not tell anything.
    if (getpid() != own) _exit(exit_not_told);
    tell(lines);
  });
  if (getpid() != own) _exit(exit_not_told);
  const std::string change = before.change();
  if (!change.empty()) tell("left " + change + "\n");
  tell("complete yes\n");
  if (change.empty()) tell("stage end\n");
  return exit_examined;
}

}  // namespace
}  // namespace rhec::apps

int main(int count, char** words) {
  try {
    return rhec::apps::examine(count, words);
  } catch (const std::exception& failure) {  // of the examination itself, such as a folder that is gone
    std::fprintf(stderr, "%s\n", failure.what());
  }
  return rhec::kExaminationNotTold;
}
