// The wire against another implementation of DDS, eProsima's Fast DDS, which most nodes of ROS 2 use: both ways, on the
// loopback interface.
#include <unistd.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <gtest/gtest.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/ros/messages/type_hash.hpp"
#include "apps/ros/node/lever_arms.hpp"
#include "apps/ros/wire/participant.hpp"
#include "rhec/logs/cdr/cdr_cursor.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::apps::ros::participant_strangers_test {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using Bytes = std::vector<std::byte>;

/// A type whose messages are their bytes, for Fast DDS.
class RawType final : public dds::TopicDataType {
 public:
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 100000;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const Bytes& bytes = *static_cast<Bytes*>(data);
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<std::byte*>(payload->data));
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    const auto* begin = reinterpret_cast<const std::byte*>(payload->data);
    static_cast<Bytes*>(data)->assign(begin, begin + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

/// What Fast DDS finds out about others.
class Discovery final : public dds::DomainParticipantListener {
 public:
  void on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& info) override {
    const std::lock_guard lock(mutex_);
    participants_.emplace_back(info.info.m_userData.begin(), info.info.m_userData.end());
  }
  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override {
    const std::lock_guard lock(mutex_);
    const auto& data = info.info.m_qos.m_userData;
    writers_[info.info.topicName().c_str()] = {info.info.typeName().c_str(), std::string(data.begin(), data.end())};
  }
  std::vector<std::string> participants() const {
    const std::lock_guard lock(mutex_);
    return participants_;
  }
  std::pair<std::string, std::string> writer(const std::string& topic) const {
    const std::lock_guard lock(mutex_);
    const auto found = writers_.find(topic);
    return found == writers_.end() ? std::pair<std::string, std::string>() : found->second;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> participants_;
  std::map<std::string, std::pair<std::string, std::string>> writers_;  ///< type and user data, by topic
};

WireTopic topic_of(const std::string& name, const std::string& type) {
  return {name, type, type_hash(type, logs::builtin_definitions())};
}

/// Until something is so, 20 s at most.
template <class Condition>
bool becomes(const Condition& condition) {
  const auto end = Clock::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

class StrangersTest : public testing::Test {
 protected:
  void SetUp() override {
    dds::DomainParticipantQos qos;
    const auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.emplace_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(loopback);
    rtps::Locator_t peer;
    rtps::IPLocator::setIPv4(peer, 127, 0, 0, 1);
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
    stranger_ = dds::DomainParticipantFactory::get_instance()->create_participant(domain_, qos, &discovery_,
                                                                                  dds::StatusMask::none());
    ASSERT_NE(stranger_, nullptr);
  }
  void TearDown() override {
    stranger_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(stranger_);
  }
  dds::Topic* topic(const std::string& name, const std::string& type) {
    if (dds::TopicDescription* const known = stranger_->lookup_topicdescription(name))
      return dynamic_cast<dds::Topic*>(known);
    dds::TypeSupport support(new RawType(dds_type_name(type)));
    support.register_type(stranger_);
    return stranger_->create_topic(name, support.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  }
  dds::DataReader* reader(const std::string& name, const std::string& type, bool is_reliable, bool is_kept) {
    dds::DataReaderQos qos;
    qos.reliability().kind = is_reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = is_kept ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
    return stranger_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic(name, type), qos);
  }
  dds::DataWriter* writer(const std::string& name, const std::string& type, bool is_reliable, bool is_kept = false) {
    dds::DataWriterQos qos;
    qos.reliability().kind = is_reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = is_kept ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
    qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    return stranger_->create_publisher(dds::PUBLISHER_QOS_DEFAULT)->create_datawriter(topic(name, type), qos);
  }
  static Bytes take(dds::DataReader* reader) {
    Bytes bytes;
    dds::SampleInfo info;
    if (reader->take_next_sample(&bytes, &info) != ReturnCode_t::RETCODE_OK || !info.valid_data) bytes.clear();
    return bytes;
  }

  // Tests run at the same time; tests/cli/ros.py has the domains below.
  const std::uint32_t domain_ = 200 + static_cast<std::uint32_t>(getpid()) % 32;
  Discovery discovery_;
  dds::DomainParticipant* stranger_ = nullptr;
};

TEST_F(StrangersTest, HearWhatIsSent) {
  Participant wire({.domain = domain_, .node = "rhec"});
  const std::string type = "nav_msgs/msg/Odometry";
  const int writer = wire.add_writer(topic_of("/rhec/odometry", type), Delivery::sure);
  wire.announce();
  const std::array readers{reader("rt/rhec/odometry", type, true, false),
                           reader("rt/rhec/odometry", type, false, false)};
  ASSERT_TRUE(becomes([&] { return wire.matched_readers(writer) == 2; }));
  logs::CdrWriter message;
  sim::write_odometry(5, {}, {1.0, 2.0, 3.0}, Eigen::Matrix3d::Identity(), 0.5, 0.25, message);
  const Bytes sent(message.bytes().begin(), message.bytes().end());
  for (dds::DataReader* reader : readers) {
    Bytes heard;
    EXPECT_TRUE(becomes([&] {
      wire.write(writer, message.bytes());
      heard = take(reader);
      return !heard.empty();
    }));
    ASSERT_GE(heard.size(), sent.size());
    heard.resize(sent.size());  // what is behind fills up to a multiple of four
    EXPECT_EQ(heard, sent);
  }
}

TEST_F(StrangersTest, AreHeardReliableOrNot) {
  Participant wire({.domain = domain_, .node = "rhec"});
  const std::string type = "sensor_msgs/msg/Imu";
  const int reader = wire.add_reader(topic_of("/imu", type), Delivery::latest);
  wire.announce();
  logs::CdrWriter message;
  message.header(7, "imu_link");
  message.numbers(std::vector<double>(37, 0.5));
  Bytes sent(message.bytes().begin(), message.bytes().end());
  int expected = 0;
  for (const bool is_reliable : {true, false}) {
    dds::DataWriter* const writer = this->writer("rt/imu", type, is_reliable);
    ASSERT_TRUE(becomes([&] { return wire.matched_writers(reader) == expected + 1; }));
    ++expected;
    Bytes heard;
    EXPECT_TRUE(becomes([&] {
      writer->write(&sent);
      if (wire.wait(Clock::now() + std::chrono::milliseconds(50)))
        wire.take([&](const Arrival& arrival) { heard.assign(arrival.cdr.begin(), arrival.cdr.end()); });
      return !heard.empty();
    }));
    EXPECT_EQ(heard, sent);
  }
}

TEST_F(StrangersTest, LearnWhatNodesOfRosTellOfThemselves) {
  Participant wire({.domain = domain_, .node = "my_node"});
  const WireTopic topic = topic_of("/cmd_vel", "geometry_msgs/msg/TwistStamped");
  wire.add_writer(topic, Delivery::sure);
  wire.announce();
  EXPECT_TRUE(becomes([&] { return !discovery_.writer("rt/cmd_vel").first.empty(); }));
  EXPECT_EQ(discovery_.writer("rt/cmd_vel").first, "geometry_msgs::msg::dds_::TwistStamped_");
  EXPECT_EQ(discovery_.writer("rt/cmd_vel").second, "typehash=" + topic.hash + ";");
  const std::vector<std::string> participants = discovery_.participants();
  EXPECT_NE(std::find(participants.begin(), participants.end(), "enclave=/;"), participants.end());
  // Who comes later hears which endpoints are the node's.
  dds::DataReader* const reader =
      this->reader("ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo", true, true);
  Bytes heard;
  ASSERT_TRUE(becomes([&] {
    heard = take(reader);
    return !heard.empty();
  }));
  logs::CdrCursor cursor(heard);
  cursor.skip_numbers(logs::Kind::u8, 16);
  EXPECT_EQ(cursor.length(8), 1u);
  EXPECT_EQ(cursor.text(), "/");
  EXPECT_EQ(cursor.text(), "my_node");
  EXPECT_EQ(cursor.length(16), 0u);  // readers
  EXPECT_EQ(cursor.length(16), 1u);  // writers
}

TEST_F(StrangersTest, TellWhereSensorsAre) {
  Participant wire({.domain = domain_, .node = "rhec"});
  RosOptions options;
  options.patience = 20.0;
  options.lever_arms = parse_yaml("{antenna_x: gps_link.x, antenna_y: -gps_link.y}", "robot.yaml");
  // The mast stands 1 m ahead and is turned to the left; the antenna is 0.5 m along its own x, so to the vehicle's
  // left.
  dds::DataWriter* const writer = this->writer("rt/tf_static", "tf2_msgs/msg/TFMessage", true, true);
  logs::CdrWriter message;
  message.length(2);
  message.header(0, "base_link");
  message.text("mast");
  message.numbers(std::array{1.0, 0.0, 0.0, 0.0, 0.0, std::sqrt(0.5), std::sqrt(0.5)});
  message.header(0, "mast");
  message.text("gps_link");
  message.numbers(std::array{0.5, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0});
  Bytes sent(message.bytes().begin(), message.bytes().end());
  ASSERT_TRUE(writer->write(&sent));
  Settings settings = parse_yaml("model: {name: skid_steer}", "robot.yaml");
  set_lever_arms(wire, options, settings);
  EXPECT_NEAR(settings.find_path("model.antenna_x")->as_number(), 1.0, 1e-12);
  EXPECT_NEAR(settings.find_path("model.antenna_y")->as_number(), -0.5, 1e-12);
}

}  // namespace
}  // namespace rhec::apps::ros::participant_strangers_test
