#include "rhec/sim/problems/problem_format.hpp"

#include <fmt/format.h>

#include <array>

#include "format_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

std::array<const ProblemFormat*, 2> all_formats() noexcept { return {&rhe_format(), &rhc_format()}; }

}  // namespace

ProblemFormat::ProblemFormat(Traits traits) : traits_(std::move(traits)) {}
ProblemFormat::~ProblemFormat() = default;

const ProblemFormat* find_problem_format(std::string_view kind) noexcept {
  for (const ProblemFormat* format : all_formats())
    if (format->traits().kind == kind) return format;
  return nullptr;
}

const ProblemFormat& problem_format(std::string_view kind) {
  if (const ProblemFormat* format = find_problem_format(kind)) return *format;
  throw Error(fmt::format("problems of kind '{}' cannot be kept; there are formats for {} alone", kind,
                          fmt::join(problem_kinds(), ", ")));
}

std::vector<std::string> problem_kinds() {
  std::vector<std::string> kinds;
  for (const ProblemFormat* format : all_formats()) kinds.emplace_back(format->traits().kind);
  return kinds;
}

}  // namespace rhec::sim
