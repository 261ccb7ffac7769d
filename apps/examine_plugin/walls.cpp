#include "walls.hpp"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace rhec::apps {
namespace {

// Sanitizers map more memory than there is, start a process to look for leaks, and tell of faults by themselves.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool is_sanitized = true;
#else
constexpr bool is_sanitized = false;
#endif

#if defined(__x86_64__)
constexpr unsigned machine = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr unsigned machine = AUDIT_ARCH_AARCH64;
#else
constexpr unsigned machine = 0;  // no filter
#endif

void limit(int resource, rlim_t most) {
  struct rlimit now {};
  if (getrlimit(resource, &now) != 0) return;
  now.rlim_max = std::min(now.rlim_max, most);
  now.rlim_cur = std::min(now.rlim_cur, now.rlim_max);
  setrlimit(resource, &now);
}

/// Tells of a forbidden call in the report. Async-signal-safe.
void tell_of_call(int, siginfo_t* info, void*) {
  const char* line = "forbidden it made a system call that is not allowed here\n";
  switch (info->si_syscall) {
    case SYS_clone:
#if defined(SYS_fork)
    case SYS_fork:
    case SYS_vfork:
#endif
      line = "forbidden it started another process\n";
      break;
    case SYS_execve:
    case SYS_execveat:
      line = "forbidden it ran another program in the place of this one\n";
      break;
    case SYS_kill:
    case SYS_tgkill:
      line = "forbidden it sent a signal to another process\n";
      break;
    default:
      break;
  }
  const ssize_t written = write(report_descriptor, line, std::strlen(line));
  _exit(written > 0 ? 1 : 2);
}

/// Calls of the system that a plugin has no reason for while it is looked at.
class Filter {
 public:
  Filter() {
    load(offsetof(seccomp_data, arch));
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, machine, 1, 0));
    allow();
    load(offsetof(seccomp_data, nr));
#if defined(SYS_fork)
    forbid(SYS_fork);
    forbid(SYS_vfork);
#endif
    forbid(SYS_execve);
    forbid(SYS_execveat);
    refuse(SYS_clone3);                          // its flags are in memory; what wants a thread tries clone then
    forbid_without_flag(SYS_clone, 0x00010000);  // CLONE_THREAD
    forbid_to_others(SYS_kill);
    forbid_to_others(SYS_tgkill);
    allow();
  }

  bool install() {
    sock_fprog program{static_cast<unsigned short>(code_.size()), code_.data()};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
  }

 private:
  void add(sock_filter step) { code_.push_back(step); }
  void load(std::size_t offset) { add(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<unsigned>(offset))); }
  void load_argument(int number) {
    load(offsetof(seccomp_data, args) + static_cast<std::size_t>(number) * sizeof(std::uint64_t));
  }
  void allow() { add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)); }
  void forbid(unsigned call) {
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1));
    add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
  }
  void refuse(unsigned call) {
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1));
    add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS));
  }
  void forbid_without_flag(unsigned call, unsigned flag) {
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 4));
    load_argument(0);
    add(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, flag, 1, 0));
    add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
    allow();
  }
  /// Only to this process and its group, which is its own.
  void forbid_to_others(unsigned call) {
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 5));
    load_argument(0);
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(getpid()), 2, 0));
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, 0, 1, 0));
    add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
    allow();
  }

  std::vector<sock_filter> code_;
};

void watch_forbidden_calls() {
  struct sigaction action {};
  action.sa_sigaction = &tell_of_call;
  action.sa_flags = SA_SIGINFO;
  sigemptyset(&action.sa_mask);
  sigaction(SIGSYS, &action, nullptr);
}

}  // namespace

void build_walls(std::chrono::seconds time, std::size_t memory) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<rlim_t>(time.count()));
  limit(RLIMIT_FSIZE, rlim_t{64} << 20);
  if (is_sanitized) return;
  limit(RLIMIT_DATA, memory);
  limit(RLIMIT_AS, 4 * static_cast<rlim_t>(memory));  // also what is mapped of files
  if (machine == 0) return;
  watch_forbidden_calls();
  // Without a filter the other walls stand, and a process that is left over is still noticed.
  static_cast<void>(Filter().install());
}

}  // namespace rhec::apps
