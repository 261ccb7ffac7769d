#include "rhec/core/model/write_model_code.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "models/bicycle_slip/bicycle_slip.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec {
namespace write_model_code_test {

namespace fs = std::filesystem;

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(in), {});
}

TEST(WriteModelCodeTo, LeavesFilesAloneThatAreAsTheyWouldBeWritten) {
  const TemporaryFolder folder;
  const auto write = [&](const char* set) {
    write_model_code_to(trace<BicycleSlip>(), "bicycle", "rhec::BicycleSlip", {folder.path().string(), "generic", set});
  };
  write("avx2");
  const fs::path kernels = folder / "kernels.cpp", table = folder / "table.cpp";
  const std::string kernels_text = content(kernels), table_text = content(table);
  ASSERT_FALSE(kernels_text.empty());
  ASSERT_FALSE(table_text.empty());

  const fs::file_time_type before = fs::file_time_type::clock::now() - std::chrono::hours(1);
  const auto age = [&] {
    fs::last_write_time(kernels, before);
    fs::last_write_time(table, before);
  };
  age();
  write("avx2");
  EXPECT_EQ(fs::last_write_time(kernels), before);
  EXPECT_EQ(fs::last_write_time(table), before);

  // Another set stands in the table alone.
  write("avx512");
  EXPECT_EQ(fs::last_write_time(kernels), before);
  EXPECT_GT(fs::last_write_time(table), before);
  EXPECT_NE(content(table), table_text);

  // A file that was cut short is written again, and so is one that has grown.
  age();
  fs::resize_file(kernels, kernels_text.size() / 2);
  std::ofstream(table, std::ios::app) << "// more\n";
  write("avx2");
  EXPECT_EQ(content(kernels), kernels_text);
  EXPECT_EQ(content(table), table_text);
}

TEST(WriteModelCodeTo, SaysWhatIsMissing) {
  EXPECT_CONTAINS(
      error_of([] { write_model_code_to(trace<BicycleSlip>(), "bicycle", "rhec::BicycleSlip", {"folder"}); }),
      "expected a folder and instruction sets");
}

}  // namespace write_model_code_test
}  // namespace rhec
