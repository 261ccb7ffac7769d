#pragma once

#include <fcntl.h>
#include <sys/file.h>
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
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "apps/ros/wire/participant.hpp"
#include "rhec/core/base/clock.hpp"

// A participant of eProsima's Fast DDS, which most nodes of ROS 2 use, on the loopback interface.
namespace rhec::apps::ros {

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

/// A domain that no other test uses meanwhile: participants of another one that come and go make Fast DDS fail an
/// assertion of its own. tests/cli/ros.py has the domains below, and Linux hands out the ports of those above.
class Domain {
 public:
  Domain() {
    constexpr std::uint32_t first = 70, count = 32;
    const auto start = static_cast<std::uint32_t>(getpid());
    for (std::uint32_t i = 0; file_ < 0 && i < count; ++i) {
      number_ = first + (start + i) % count;
      const std::string name = "rhec_test_domain_" + std::to_string(getuid()) + "_" + std::to_string(number_);
      const std::filesystem::path path = std::filesystem::temp_directory_path() / name;
      file_ = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
      if (file_ < 0 || flock(file_, LOCK_EX | LOCK_NB) == 0) continue;
      close(file_);
      file_ = -1;
    }
    if (file_ < 0) throw std::runtime_error("no domain is free, or the folder for temporary files is not writable");
  }
  ~Domain() { close(file_); }
  Domain(const Domain&) = delete;
  Domain& operator=(const Domain&) = delete;
  std::uint32_t number() const noexcept { return number_; }

 private:
  std::uint32_t number_ = 0;
  int file_ = -1;
};

class StrangerTest : public testing::Test {
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

  const Domain leased_;
  const std::uint32_t domain_ = leased_.number();
  Discovery discovery_;
  dds::DomainParticipant* stranger_ = nullptr;
};

}  // namespace rhec::apps::ros
