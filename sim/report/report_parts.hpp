#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "report_files.hpp"

namespace rhec::sim {

// The parts of report_document, one for each kind of source.
Json run_report(const std::filesystem::path& folder, const Json& summary);
Json log_report(const std::filesystem::path& folder, const Json& summary);
Json sweep_report(const std::filesystem::path& file);
Json comparison_report(const std::filesystem::path& file);

constexpr const char* run_maker = "rhec run";
constexpr const char* log_maker = "rhec estimate";

/// horizons.jsonl as it was written.
struct HorizonFile {
  struct Variant {
    Json nodes;
    std::vector<Json> records;
    std::size_t bytes = 0;  ///< of the records in the file
  };
  Json head;
  std::vector<Variant> variants;
};
/// Throws Error, naming file and line, for a file of another form or version, or one that is cut off.
HorizonFile read_horizons(const std::filesystem::path& file, const std::string& maker, const char* kind);

/// Windows and plans for the page: of a run or a variant with so many samples, in about so many bytes. Those whose
/// solver's result could not be used stay. Null where there are none. `truth` has what the ground was like at each
/// node, a column for each parameter; none where nobody knows.
Json horizons_of(const HorizonFile::Variant& variant, std::size_t samples, std::size_t most_bytes,
                 const std::vector<std::vector<double>>& truth, Json& notes);

/// How rows were thinned, in words.
std::string thinning_words(const Thinned& thinned, std::size_t total, const char* what);

// How much of a long run a page shows.
constexpr std::size_t most_rows = 3000;                ///< samples of a curve
constexpr std::size_t most_values = 60000;             ///< rows of all curves together
constexpr std::size_t most_track_points = 24000;       ///< of all tracks together, which are looked at closely
constexpr std::size_t most_horizon_bytes = 1'700'000;  ///< as they are in the file
constexpr std::size_t most_status_changes = 3000;

}  // namespace rhec::sim
