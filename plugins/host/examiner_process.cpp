#include "examiner_process.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace rhec {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMostOutput = 4096, kMostReport = std::size_t{1} << 20;

/// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { close(); }
  void close() {
    if (number_ >= 0) ::close(std::exchange(number_, -1));
  }
  int number() const { return number_; }

 private:
  int number_;
};

/// A pipe that no other process inherits. Its ends are above the numbers that an examiner has for its own.
struct Pipe {
  Descriptor read, write;

  static Pipe open() {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    const Descriptor low_read(ends[0]), low_write(ends[1]);
    constexpr int lowest = 10;
    Pipe pipe{Descriptor(fcntl(ends[0], F_DUPFD_CLOEXEC, lowest)), Descriptor(fcntl(ends[1], F_DUPFD_CLOEXEC, lowest))};
    if (pipe.read.number() < 0 || pipe.write.number() < 0)
      throw std::system_error(errno, std::generic_category(), "pipe");
    return pipe;
  }
};

/// The environment of the examiner: this one, with a heap that is checked and no threads of numerical libraries.
class ExaminerEnvironment {
 public:
  ExaminerEnvironment() {
    for (char** variable = environ; *variable != nullptr; ++variable) texts_.emplace_back(*variable);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    if (std::getenv("LD_PRELOAD") == nullptr) {
      texts_.emplace_back("LD_PRELOAD=libc_malloc_debug.so.0");
      texts_.emplace_back("MALLOC_CHECK_=3");
    }
#endif
    for (const char* name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"}) {
      const std::string start = std::string(name) + "=";
      std::erase_if(texts_, [&](const std::string& text) { return text.starts_with(start); });
      texts_.push_back(start + "1");
    }
    for (std::string& text : texts_) pointers_.push_back(text.data());
    pointers_.push_back(nullptr);
  }
  char** get() { return pointers_.data(); }

 private:
  std::vector<std::string> texts_;
  std::vector<char*> pointers_;
};

/// What posix_spawn is to do: standard input from nowhere, both outputs into one pipe, the report as descriptor 3; a
/// process group of its own, and signals as at the start of a program.
class SpawnPlan {
 public:
  SpawnPlan(const Pipe& output, const Pipe& report) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_addopen(&actions_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
      posix_spawn_file_actions_adddup2(&actions_, output.write.number(), stream);
    posix_spawn_file_actions_adddup2(&actions_, report.write.number(), 3);
    posix_spawnattr_init(&attributes_);
    posix_spawnattr_setpgroup(&attributes_, 0);
    sigset_t signals;
    sigemptyset(&signals);
    posix_spawnattr_setsigmask(&attributes_, &signals);
    sigfillset(&signals);
    posix_spawnattr_setsigdefault(&attributes_, &signals);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  int start(pid_t& process, std::vector<std::string> words, ExaminerEnvironment environment) const {
    std::vector<char*> pointers;
    pointers.reserve(words.size() + 1);
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    return posix_spawn(&process, pointers[0], &actions_, &attributes_, pointers.data(), environment.get());
  }

 private:
  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

/// Reads what is there; closes the descriptor at its end. What is beyond `most` is dropped.
void read_some(Descriptor& from, std::string& to, std::size_t most) {
  std::array<char, 4096> part{};
  const ssize_t count = read(from.number(), part.data(), part.size());
  if (count < 0 && errno == EINTR) return;
  if (count <= 0) return from.close();
  to.append(part.data(), std::min(static_cast<std::size_t>(count), most - std::min(most, to.size())));
}

/// Whether the process has ended; it can still be waited for.
bool has_ended(pid_t process) {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(process), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == process;
}

/// Reads both streams until the process has ended and they are empty, or the time is over.
void follow(pid_t process, Pipe& output, Pipe& report, Clock::time_point deadline, ExaminerEnd& end) {
  bool ended = false;
  while (true) {
    std::array<pollfd, 2> streams{{{output.read.number(), POLLIN, 0}, {report.read.number(), POLLIN, 0}}};
    const bool is_open = streams[0].fd >= 0 || streams[1].fd >= 0;
    // Processes that were started by it may hold the streams open: what is left is read without waiting.
    constexpr int look_again = 20;  // [ms]
    const int wait = ended ? 0 : is_open ? look_again : 1;
    const int ready = poll(streams.data(), streams.size(), wait);
    if (ready > 0 && streams[0].revents != 0) read_some(output.read, end.output, kMostOutput);
    if (ready > 0 && streams[1].revents != 0) read_some(report.read, end.report, kMostReport);
    if (ended && ready <= 0) return;
    ended = ended || has_ended(process);
    if (!is_open && ended) return;
    if (Clock::now() < deadline) continue;
    end.timed_out = !ended;
    return;
  }
}

}  // namespace

std::filesystem::path examiner_program() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&examiner_program), &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code problem;
  const std::filesystem::path library = std::filesystem::canonical(info.dli_fname, problem);
  return problem ? std::filesystem::path() : library.parent_path() / "rhec" / "examine_plugin";
}

ExaminerEnd run_examiner(const std::filesystem::path& program, const std::filesystem::path& plugin,
                         std::chrono::milliseconds time_limit, std::size_t memory_limit) {
  ExaminerEnd end;
  try {
    Pipe output = Pipe::open(), report = Pipe::open();
    pid_t process = 0;
    const auto seconds = std::chrono::ceil<std::chrono::seconds>(time_limit).count();
    const int problem =
        SpawnPlan(output, report)
            .start(process,
                   {program.string(), plugin.string(), fmt::format("{}", seconds), fmt::format("{}", memory_limit)},
                   ExaminerEnvironment());
    if (problem != 0) {
      end.problem = fmt::format("{} cannot be started: {}", program.string(), std::strerror(problem));
      return end;
    }
    output.write.close();
    report.write.close();
    follow(process, output, report, Clock::now() + time_limit, end);
    kill(-process, SIGKILL);  // also what it has started
    while (waitpid(process, &end.status, 0) < 0 && errno == EINTR) continue;
  } catch (const std::system_error& failure) {
    end.problem = failure.what();
  }
  return end;
}

}  // namespace rhec
