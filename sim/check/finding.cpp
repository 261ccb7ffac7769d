#include "rhec/sim/check/finding.hpp"

#include <algorithm>

namespace rhec::sim {

std::string_view word_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::pass:
      return "pass";
    case Verdict::skip:
      return "skip";
    case Verdict::warn:
      return "warn";
    case Verdict::fail:
      return "fail";
  }
  return "";
}

int count_of(const std::vector<Finding>& findings, Verdict verdict) {
  return static_cast<int>(
      std::ranges::count_if(findings, [&](const Finding& finding) { return finding.verdict == verdict; }));
}

Verdict verdict_of(const std::vector<Finding>& findings) {
  if (count_of(findings, Verdict::fail) > 0) return Verdict::fail;
  return count_of(findings, Verdict::warn) > 0 ? Verdict::warn : Verdict::pass;
}

}  // namespace rhec::sim
