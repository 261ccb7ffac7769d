#pragma once

#include <filesystem>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// The content of a report as one JSON object, for the folder of a run (`rhec run`) or an estimation (`rhec estimate`),
/// the database of a sweep, or a comparison (`compare.json` or its folder). docs/report.md describes what it keeps of
/// long runs; the report's notes do too. Non-finite numbers become null. `program` is the program that made it, e.g.
/// "rhec 0.1.0".
///
/// Throws Error, naming file, line and what to do, if the source is none of these or is incomplete.
RHEC_EXPORT std::string report_document(const std::filesystem::path& source, const std::string& program);

}  // namespace rhec::sim
