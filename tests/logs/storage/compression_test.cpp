#include "rhec/logs/storage/compression.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace rhec::logs {
namespace compression_test {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

TEST(Compression, ReadsWhatItHasCompressed) {
  std::string text;
  for (int i = 0; i < 20000; ++i) text += std::to_string(i * i);
  std::vector<std::byte> block, bytes;
  compress_zstd(bytes_of(text), block);
  EXPECT_LT(block.size(), text.size() / 2);
  EXPECT_TRUE(is_zstd(block));
  EXPECT_EQ(decompress(Compression::zstd, block, text.size(), bytes), "");
  EXPECT_EQ(bytes, bytes_of(text));
  ZstdStream stream;
  std::vector<std::byte> all;
  for (std::size_t i = 0; i < block.size(); i += 1000) {
    EXPECT_EQ(stream.decompress(std::span(block).subspan(i, std::min<std::size_t>(1000, block.size() - i)), bytes), "");
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  EXPECT_EQ(all, bytes_of(text));
}

TEST(Compression, NeverTakesMoreThanWasAnnounced) {
  std::vector<std::byte> block, bytes;
  compress_zstd(std::vector<std::byte>(std::size_t{1} << 26), block);  // zeros: a small block of 64 MiB
  EXPECT_THAT(decompress(Compression::zstd, block, 1000, bytes), testing::HasSubstr("more than the 1000 bytes"));
  EXPECT_LE(bytes.capacity(), std::size_t{1} << 20);
}

TEST(Compression, KeepsWhatIsBeforeACut) {
  std::string text;
  for (int i = 0; i < 200000; ++i) text += std::to_string(i * 7919 % 104729);
  std::vector<std::byte> block, bytes;
  compress_zstd(bytes_of(text), block);
  block.resize(block.size() / 2);
  EXPECT_THAT(decompress(Compression::zstd, block, text.size(), bytes), testing::HasSubstr("ends within a frame"));
  EXPECT_GT(bytes.size(), text.size() / 4);
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), bytes_of(text).begin()));
}

TEST(Compression, RefusesWhatIsNone) {
  std::vector<std::byte> bytes;
  for (const Compression compression : {Compression::lz4, Compression::zstd})
    EXPECT_NE(decompress(compression, bytes_of("this is no frame of either"), 1000, bytes), "");
  Compression found = Compression::none;
  EXPECT_TRUE(compression_of("lz4", found));
  EXPECT_EQ(found, Compression::lz4);
  EXPECT_FALSE(compression_of("bz2", found));
}

TEST(Compression, ChecksumsAreThoseOfThePublishedCheckValue) {
  EXPECT_EQ(crc32(bytes_of("123456789")), 0xCBF43926u);
  EXPECT_EQ(crc32(bytes_of("56789"), crc32(bytes_of("1234"))), 0xCBF43926u);
}

}  // namespace compression_test
}  // namespace rhec::logs
