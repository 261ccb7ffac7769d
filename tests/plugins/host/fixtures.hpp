#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "support/temporary_folder.hpp"

// The plugins that tests of the host are made with, and what it says of them.
namespace rhec {

namespace fs = std::filesystem;

inline fs::path fixture(const std::string& name) { return fs::path(FIXTURES) / name; }

/// What the host says of the files in its first place.
inline std::vector<PluginRecord> records_in(const fs::path& directory) {
  const Host host({directory});
  std::vector<PluginRecord> records;
  for (const PluginRecord& record : host.discover()) {
    if (record.path.parent_path() == fs::canonical(directory)) records.push_back(record);
  }
  return records;
}

inline std::string refusal_of(const std::string& name) {
  const auto records = records_in(fixture(name));
  return records.size() == 1 ? records[0].refusal : "not one file";
}

}  // namespace rhec
