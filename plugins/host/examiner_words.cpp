#include "examiner_words.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <string_view>
#include <utility>

#include "rhec/plugins/host/examination.hpp"

namespace rhec {
namespace {

/// What an examiner has told, beside the verdict.
struct Told {
  Verdict verdict;
  std::string stage, forbidden, left;
  std::string memory_stage;  ///< in which it asked for too much; empty if it did not
  bool is_complete = false, is_damaged = false;
};

Told read_report(const std::string& report) {
  Told told;
  for (const auto& [key, value] : report_lines(report)) {
    if (key == "stage") {
      told.stage = value;
    } else if (key == "forbidden") {
      told.forbidden = value;
    } else if (key == "left") {
      told.left = value;
    } else if (key == "memory") {
      told.memory_stage = told.stage;
    } else if (key == "complete") {
      told.is_complete = true;
    } else if (!take_line(key, value, told.verdict)) {
      told.is_damaged = true;
    }
  }
  return told;
}

std::string_view words_of_stage(std::string_view stage) {
  constexpr std::array words{
      std::pair("load", "while it was loaded, when the constructors of its library run"),
      std::pair("manifest", "while its manifest was read"),
      std::pair("options", "while it was asked for its options"),
      std::pair("make", "while it made an object with its default options"),
      std::pair("destroy", "while it deleted an object that it had made"),
      std::pair("end", "at the end of the program, when the destructors of its library run"),
  };
  for (const auto& [name, text] : words) {
    if (stage == name) return text;
  }
  return "before it was loaded";
}

/// "segmentation fault, SIGSEGV".
std::string words_of_signal(int number) {
  const char* about = sigdescr_np(number);
  const char* name = sigabbrev_np(number);
  if (about == nullptr || name == nullptr) return fmt::format("signal {}", number);
  return fmt::format("{}, SIG{}", about, name);
}

/// The first line that was written to the standard streams, and is not the loader's; empty if there is none.
std::string first_line(std::string_view output) {
  constexpr std::size_t most = 200;
  while (!output.empty()) {
    const std::size_t end = std::min(output.find('\n'), output.size());
    std::string line(output.substr(0, std::min(end, most)));
    output.remove_prefix(std::min(end + 1, output.size()));
    std::erase_if(line, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    if (line.find_first_not_of(' ') != std::string::npos && !line.starts_with("ERROR: ld.so")) return line;
  }
  return {};
}

/// What the plugin did that ended its examination; empty if nothing.
std::string harm_of(const Told& told, const ExaminerEnd& end, std::chrono::milliseconds time_limit,
                    std::size_t memory_limit) {
  const auto seconds = static_cast<double>(time_limit.count()) / 1000.0;
  if (!told.forbidden.empty()) return told.forbidden;
  if (end.timed_out) return fmt::format("it had not returned after {:g} s", seconds);
  if (!told.memory_stage.empty())
    return fmt::format("it asked for more than the {} MiB of memory that it may have", memory_limit >> 20);
  if (WIFSIGNALED(end.status)) {
    const int number = WTERMSIG(end.status);
    if (number == SIGXCPU) return fmt::format("it had not returned after {:g} s of computing", seconds);
    return fmt::format("it crashed ({})", words_of_signal(number));
  }
  if (!told.is_complete && WEXITSTATUS(end.status) == kExaminationNotTold)
    return "it closed what its examination reports through";
  if (!told.is_complete || WEXITSTATUS(end.status) != 0)
    return fmt::format("it ended the program with exit code {}", WEXITSTATUS(end.status));
  return told.is_damaged ? "it wrote into the report of its examination" : "";
}

}  // namespace

Verdict verdict_of(const std::filesystem::path& plugin, const ExaminerEnd& end, std::chrono::milliseconds time_limit,
                   std::size_t memory_limit) {
  Told told = read_report(end.report);
  Verdict& verdict = told.verdict;
  verdict.record.path = plugin;
  if (!end.problem.empty()) {
    verdict.record.refusal = fmt::format("it could not be examined: {}", end.problem);
    verdict.record.remedy = "install rhec again, or free what the system lacks";
    return verdict;
  }
  std::string harm = harm_of(told, end, time_limit, memory_limit);
  if (!harm.empty()) {
    const std::string line = first_line(end.output);
    const std::string& stage = told.memory_stage.empty() ? told.stage : told.memory_stage;
    harm += fmt::format(" {}{}", words_of_stage(stage), line.empty() ? "" : fmt::format("; it wrote '{}'", line));
  } else if (!told.left.empty()) {
    harm = told.left + " while it was loaded and made an object";
  } else {
    return verdict;
  }
  verdict.record.refusal = harm;
  verdict.record.remedy =
      "remove it, or tell its author; once it is mended, or what it needs, 'rhec plugins --doctor' examines it anew";
  verdict.harmful = true;
  return verdict;
}

}  // namespace rhec
