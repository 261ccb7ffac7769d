// Every input of the corpus, seeds and what fuzzers have found: each is answered, within a gigabyte.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "fuzz/targets.hpp"

namespace rhec::fuzz {
namespace corpus_test {

namespace fs = std::filesystem;

std::vector<fs::path> inputs_of(const std::string& target) {
  std::vector<fs::path> inputs;
  for (const auto& entry : fs::directory_iterator(fs::path(CORPUS) / target)) inputs.push_back(entry.path());
  std::sort(inputs.begin(), inputs.end());
  return inputs;
}

std::string content_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// No more memory than fuzzers allow, while it lives. Sanitizers map more than there is.
class MemoryLimit {
 public:
  MemoryLimit() {
    getrlimit(RLIMIT_DATA, &before_);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    struct rlimit less = before_;
    less.rlim_cur = std::min(before_.rlim_max, rlim_t{1} << 30);
    setrlimit(RLIMIT_DATA, &less);
#endif
  }
  ~MemoryLimit() { setrlimit(RLIMIT_DATA, &before_); }
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  struct rlimit before_ {};
};

class Corpus : public testing::TestWithParam<Target> {};

TEST_P(Corpus, IsAnswered) {
  const std::vector<fs::path> inputs = inputs_of(GetParam().name);
  ASSERT_FALSE(inputs.empty());
  GetParam().run("");  // what is made once is not counted
  for (const fs::path& input : inputs) {
    SCOPED_TRACE(input);
    const std::string content = content_of(input);
    const MemoryLimit limit;
    EXPECT_NO_THROW(GetParam().run(content));
  }
}

INSTANTIATE_TEST_SUITE_P(All, Corpus, testing::ValuesIn(targets()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace corpus_test
}  // namespace rhec::fuzz
