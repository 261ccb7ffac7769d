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
Json drive_report(const std::filesystem::path& folder, const Json& summary);
Json sweep_report(const std::filesystem::path& file);
Json comparison_report(const std::filesystem::path& file);
Json faults_report(const std::filesystem::path& file);
Json map_report(const std::filesystem::path& file);

constexpr const char* run_maker = "rhec run";
constexpr const char* log_maker = "rhec estimate";

/// horizons.jsonl as it was written.
struct HorizonFile {
  struct Variant {
    Json nodes;
    std::vector<Json> records;
    std::size_t bytes = 0;  ///< size of the records in the file
  };
  Json head;
  std::vector<Variant> variants;
};
/// Throws Error, naming file and line, for a file of another format or version, or a truncated one.
HorizonFile read_horizons(const std::filesystem::path& file, const std::string& maker, const char* kind);

/// Windows and plans for the page, for a run or variant with `samples` samples, in about `most_bytes` bytes. Those with
/// unusable solver results are always kept. Null if there are none. `truth` has the true parameters at each node, one
/// column per parameter; none if unknown.
Json horizons_of(const HorizonFile::Variant& variant, std::size_t samples, std::size_t most_bytes,
                 const std::vector<std::vector<double>>& truth, Json& notes);

/// How rows were thinned, in words.
std::string thinning_words(const Thinned& thinned, std::size_t total, const char* what);

// Limits on what a page shows of a long run.
constexpr std::size_t most_rows = 3000;                ///< samples of a curve
constexpr std::size_t most_values = 60000;             ///< rows of all curves together
constexpr std::size_t most_track_points = 24000;       ///< of all tracks together; more, since details matter
constexpr std::size_t most_horizon_bytes = 1'700'000;  ///< as in the file
constexpr std::size_t most_status_changes = 3000;

}  // namespace rhec::sim
