#pragma once

#include <filesystem>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// What a report shows, as one JSON object: of the folder of a run (`rhec run`) or of an estimation (`rhec estimate`),
/// of the database of a sweep, or of a comparison (`compare.json` or its folder). docs/report.md says what it keeps of
/// long runs; its notes say so, too. Numbers that are not finite are null. `program` made it, e.g. "rhec 0.1.0".
///
/// Throws Error, naming file and line and what to do, for what is none of these, or is not whole.
RHEC_EXPORT std::string report_document(const std::filesystem::path& source, const std::string& program);

}  // namespace rhec::sim
