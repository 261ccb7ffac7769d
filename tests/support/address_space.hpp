#pragma once

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <fstream>

namespace rhec {

/// Address space for this many more bytes, while it lives: so few threads can be started, whose stacks take 8 MB each.
/// Sanitizers take more than there is; then it sets no limit.
class AddressSpace {
 public:
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  static constexpr bool is_limited = false;
#else
  static constexpr bool is_limited = true;
#endif

  explicit AddressSpace(std::size_t more) {
    getrlimit(RLIMIT_AS, &before_);
    if (!is_limited) return;
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    struct rlimit less = before_;
    less.rlim_cur = std::min<rlim_t>(before_.rlim_max, pages * static_cast<std::size_t>(getpagesize()) + more);
    setrlimit(RLIMIT_AS, &less);
  }
  ~AddressSpace() { setrlimit(RLIMIT_AS, &before_); }
  AddressSpace(const AddressSpace&) = delete;
  AddressSpace& operator=(const AddressSpace&) = delete;

 private:
  struct rlimit before_ {};
};

}  // namespace rhec
