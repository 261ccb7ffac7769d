#include "rhec/logs/signals/survey.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/logs/csv/csv_log.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace survey_test {

using SurveyTest = FolderTest;

TEST_F(SurveyTest, CountsRatesGapsAndRanges) {
  std::string text = "time,speed,label,rare\n";
  for (int i = 0; i < 100; ++i)
    text += std::to_string(i < 50 ? 0.1 * i : 0.1 * i + 7.0) + "," + std::to_string(i) + ",word," +
            (i == 7 ? "3" : "") + "\n";
  const auto log = open_csv(put("drive.csv", text));
  const Survey found = survey(*log);
  ASSERT_EQ(found.topics.size(), 1u);
  const TopicSurvey& table = found.topics.front();
  EXPECT_EQ(table.count, 100);
  EXPECT_NEAR(table.usual_interval, 0.1, 1e-4);
  EXPECT_NEAR(table.longest_gap, 7.1, 1e-6);
  EXPECT_NEAR(table.gap_start, 4.9, 1e-6);
  EXPECT_EQ(table.backwards, 0);
  ASSERT_EQ(table.fields.size(), 2u);
  EXPECT_EQ(table.fields[0].name, "speed");
  EXPECT_EQ(table.fields[0].least, 0.0);
  EXPECT_EQ(table.fields[0].most, 99.0);
  EXPECT_EQ(table.fields[1].name, "rare");
  EXPECT_EQ(table.fields[1].count, 1);
  EXPECT_FALSE(found.damage);
}

TEST_F(SurveyTest, TellsDamageAndWhatWasBeforeIt) {
  const auto log = open_csv(put("drive.csv", "time,speed\n0,1\n1,2\n2\n3,4\n"));
  const Survey found = survey(*log);
  EXPECT_EQ(found.topics.front().count, 2);
  ASSERT_TRUE(found.damage);
  EXPECT_THAT(found.damage->what, testing::HasSubstr("drive.csv:4: found 1 cells, expected 2"));
}

/// A topic whose second record is broken, beside one that is whole.
class TwoTopics final : public Log {
 public:
  TwoTopics() : Log("bag") { topics_ = {{"/a", "A", 3}, {"/b", "B", 3}}; }
  std::unique_ptr<FieldReader> reader(int, const FieldRequest&) const override { return std::make_unique<Reader>(); }
  std::vector<std::string> fields_of(const Record&) const override { return {"x"}; }
  std::optional<Damage> read(const std::vector<bool>&, const Take& take) const override {
    for (int i = 0; i < 6; ++i)
      if (!take({.topic = i % 2, .received = i, .place = i, .bytes = {}})) break;
    return std::nullopt;
  }
  Damage damage_at(const Record& record, const RecordError& error) const override {
    return {"bag: byte " + std::to_string(record.place) + ": " + error.what()};
  }

 private:
  struct Reader final : FieldReader {
    Stamp read(const Record& record, double* values) override {
      if (record.place == 2) throw RecordError("it is short");
      values[0] = static_cast<double>(record.place);
      return record.received;
    }
  };
};

TEST_F(SurveyTest, ABrokenMessageIsItsTopicsAffair) {
  const Survey found = survey(TwoTopics());
  EXPECT_FALSE(found.damage);
  EXPECT_EQ(found.topics[0].count, 3);
  EXPECT_EQ(found.topics[0].broken, 1);
  EXPECT_EQ(found.topics[0].first_broken, "bag: byte 2: it is short");
  EXPECT_EQ(found.topics[0].fields[0].count, 2);
  EXPECT_EQ(found.topics[0].fields[0].most, 4.0);
  EXPECT_EQ(found.topics[1].broken, 0);
  EXPECT_EQ(found.topics[1].fields[0].count, 3);
}

TEST_F(SurveyTest, SaysWhyItKnowsNothingOfATopic) {
  const auto log = open_csv(put("drive.csv", "when,speed\n0,1\n"));
  const TopicSurvey found = survey(*log).topics.front();
  EXPECT_THAT(found.unreadable, testing::HasSubstr("no column 'time'"));
  ASSERT_EQ(found.fields.size(), 2u) << "which numbers there are is known, all the same";
  EXPECT_EQ(found.fields[1].name, "speed");
  EXPECT_EQ(found.fields[1].most, 1.0);
}

}  // namespace survey_test
}  // namespace rhec::logs
