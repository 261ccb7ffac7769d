#pragma once

#include <filesystem>
#include <vector>

#include "rhec/plugins/host/examination.hpp"
#include "verdict.hpp"

namespace rhec {

/// The verdict of each file: one that was kept, or of an examination in a process of its own, by `program`. Several run
/// at once.
std::vector<Verdict> examine_apart(const std::vector<std::filesystem::path>& files, const Examination& examination,
                                   const std::filesystem::path& program);

}  // namespace rhec
