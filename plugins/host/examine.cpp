#include "examine.hpp"

#include <algorithm>
#include <atomic>
#include <system_error>
#include <thread>

#include "examiner_process.hpp"
#include "examiner_words.hpp"
#include "library.hpp"
#include "verdict_cache.hpp"

namespace rhec {
namespace {

Verdict refused(const std::filesystem::path& file, const Refusal& refusal) {
  Verdict verdict;
  verdict.record.path = file;
  verdict.record.refusal = refusal.reason;
  verdict.record.remedy = refusal.remedy;
  return verdict;
}

Verdict examine(const std::filesystem::path& program, const std::filesystem::path& file, const Examination& examination,
                const VerdictCache& cache) {
  const Refusal refusal = why_not_to_load(file);
  if (!refusal.empty()) return refused(file, refusal);
  const auto stamp = stamp_of(file);
  const ExaminerEnd end = run_examiner(program, file, examination.time_limit, examination.memory_limit);
  Verdict verdict = verdict_of(file, end, examination.time_limit, examination.memory_limit);
  // What the loader refuses depends on what else is installed, and is looked at again.
  if (stamp && (verdict.harmful || !verdict.libraries.empty())) cache.keep(verdict, *stamp);
  return verdict;
}

/// Calls `work` with each number below `count`, in some threads at once: most of the time they wait for a process.
template <class Work>
void for_each_at_once(std::size_t count, const Work& work) {
  constexpr std::size_t most_threads = 8;
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> threads;
  for (std::size_t i = 1; i < std::min(count, most_threads); ++i) {
    try {
      threads.emplace_back(run);
    } catch (const std::system_error&) {  // there are limits of threads; this one does the work, too
      break;
    }
  }
  run();
}

}  // namespace

std::vector<Verdict> examine_apart(const std::vector<std::filesystem::path>& files, const Examination& examination,
                                   const std::filesystem::path& program) {
  VerdictCache cache(examination.verdicts);
  std::vector<Verdict> verdicts(files.size());
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::optional<Verdict> kept;
    if (!examination.anew && writable_by_all(files[i]).empty()) kept = cache.find(files[i]);
    if (kept) {
      verdicts[i] = std::move(*kept);
    } else {
      left.push_back(i);
    }
  }
  for_each_at_once(left.size(),
                   [&](std::size_t i) { verdicts[left[i]] = examine(program, files[left[i]], examination, cache); });
  return verdicts;
}

}  // namespace rhec
