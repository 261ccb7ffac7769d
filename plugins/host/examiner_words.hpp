#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>

#include "examiner_process.hpp"
#include "verdict.hpp"

namespace rhec {

/// The verdict of an examination that has ended: what the examiner has told of the plugin, or what the plugin did.
Verdict verdict_of(const std::filesystem::path& plugin, const ExaminerEnd& end, std::chrono::milliseconds time_limit,
                   std::size_t memory_limit);

}  // namespace rhec
