#include "participant.hpp"

#include <arpa/inet.h>
#include <dds/dds.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ifaddrs.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <mutex>
#include <set>
#include <utility>

#include "confinement.hpp"
#include "raw_type.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"

namespace rhec::apps::ros {
namespace {

// DDS has ports for so many domains.
constexpr std::uint32_t most_domain = 232;
// Participants on one host that find each other without multicast.
constexpr int most_neighbours = 60;
// Messages that are taken at once.
constexpr std::size_t most_taken = 64;
constexpr const char* discovery_topic = "ros_discovery_info";
constexpr const char* discovery_type = "rmw_dds_common/msg/ParticipantEntitiesInfo";

/// What Cyclone says while something is set up, for the text of an error.
class Said {
 public:
  Said() { dds_set_log_sink(&Said::take, this); }
  ~Said() { dds_set_log_sink(nullptr, nullptr); }
  Said(const Said&) = delete;
  Said& operator=(const Said&) = delete;
  std::string text() const {
    const std::lock_guard lock(mutex_);
    return text_.empty() ? "" : ": " + text_.substr(0, text_.find_last_not_of('\n') + 1);
  }

 private:
  static void take(void* self, const dds_log_data_t* said) {
    Said& into = *static_cast<Said*>(self);
    const std::lock_guard lock(into.mutex_);
    into.text_ += said->message;
  }
  mutable std::mutex mutex_;
  std::string text_;
};

struct Interface {
  std::string name, address;
};

std::vector<Interface> interfaces() {
  std::vector<Interface> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  for (const ifaddrs* each = list; each; each = each->ifa_next) {
    if (!each->ifa_addr || each->ifa_addr->sa_family != AF_INET) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(each->ifa_addr)->sin_addr, text.data(), text.size());
    found.push_back({each->ifa_name, text.data()});
  }
  freeifaddrs(list);
  return found;
}

Interface find_interface(const std::string& word) {
  std::set<std::string> names;
  for (const Interface& each : interfaces()) {
    if (each.name == word || each.address == word) return each;
    names.insert(fmt::format("{} ({})", each.name, each.address));
  }
  throw Error(fmt::format("there is no network interface '{}'; expected one of {}", word, fmt::join(names, ", ")));
}

/// One interface, and no other. What the environment says to Cyclone (CYCLONEDDS_URI) does not count: it could name
/// more.
std::string configuration(const Interface& interface) {
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\">"
      "<General><Interfaces><NetworkInterface address=\"{0}\" multicast=\"true\"/></Interfaces></General>"
      "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{1}</MaxAutoParticipantIndex>"
      "<Peers><Peer address=\"{0}\"/></Peers></Discovery>"
      "</Domain></CycloneDDS>",
      interface.address, most_neighbours);
}

dds_entity_t checked(dds_entity_t entity, const Said& said, const std::string& what) {
  if (entity < 0) throw Error(fmt::format("{}: {}{}", what, dds_strretcode(-entity), said.text()));
  return entity;
}

struct QosRelease {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosRelease>;

Qos make_qos(Delivery delivery, bool is_reader, int depth, const std::string& hash) {
  Qos qos(dds_create_qos());
  const bool is_sure = !is_reader || delivery != Delivery::latest;
  // A writer never waits: what there is no room for is dropped.
  dds_qset_reliability(qos.get(), is_sure ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_durability(qos.get(), delivery == Delivery::kept ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &representation);
  if (!hash.empty()) {
    const std::string data = "typehash=" + hash + ";";
    dds_qset_userdata(qos.get(), data.data(), data.size());
  }
  return qos;
}

}  // namespace

struct Participant::Parts {
  WireOptions options;
  dds_entity_t domain = 0, participant = 0, waitset = 0, guard = 0;
  std::vector<dds_entity_t> readers, writers;
  std::vector<ddsi_sertype*> types;  ///< by writer; a reference of each topic keeps them
  dds_entity_t announcement = 0;
  ddsi_sertype* announcement_type = nullptr;
  std::vector<ddsi_serdata*> taken = std::vector<ddsi_serdata*>(most_taken);
  std::vector<dds_sample_info_t> infos = std::vector<dds_sample_info_t>(most_taken);
  std::vector<MessageReference> references;

  Parts() { references.reserve(most_taken); }
  ~Parts() {
    references.clear();
    if (domain > 0) dds_delete(domain);
  }

  struct Topic {
    dds_entity_t entity;
    ddsi_sertype* type;
  };
  Topic make_topic(const std::string& name, const std::string& type) const {
    const Said said;
    ddsi_sertype* raw = make_raw_type(dds_type_name(type));
    const dds_entity_t topic = dds_create_topic_sertype(participant, name.c_str(), &raw, nullptr, nullptr, nullptr);
    return {checked(topic, said, fmt::format("the topic {} of {}", name, type)), raw};
  }
  void write_id(dds_entity_t entity, logs::CdrWriter& message) const {
    dds_guid_t id{};
    dds_get_guid(entity, &id);
    for (std::size_t i = 0; i < options.id_bytes; ++i) message.u8(i < sizeof(id.v) ? id.v[i] : 0);
  }
};

Participant::Participant(const WireOptions& options) : parts_(std::make_unique<Parts>()) {
  Parts& parts = *parts_;
  parts.options = options;
  if (options.domain > most_domain)
    throw Error(fmt::format("found the domain {}, expected one from 0 to {}", options.domain, most_domain));
  const Interface interface = find_interface(options.interface);
  const Confinement confinement;
  const Said said;
  const std::string what = fmt::format("domain {} on {} ({})", options.domain, interface.name, interface.address);
  parts.domain = checked(dds_create_domain(options.domain, configuration(interface).c_str()), said, what);
  const Qos qos(dds_create_qos());
  const std::string enclave = "enclave=/;";
  dds_qset_userdata(qos.get(), enclave.data(), enclave.size());
  parts.participant = checked(dds_create_participant(options.domain, qos.get(), nullptr), said, what);
  confinement.apply(interface.name);
  parts.waitset = checked(dds_create_waitset(parts.participant), said, what);
  parts.guard = checked(dds_create_guardcondition(parts.participant), said, what);
  checked(dds_waitset_attach(parts.waitset, parts.guard, 0), said, what);
}

Participant::~Participant() = default;

int Participant::add_reader(const WireTopic& topic, Delivery delivery, int depth) {
  Parts& parts = *parts_;
  const Parts::Topic made = parts.make_topic("rt" + topic.name, topic.type);
  const Said said;
  const std::string what = fmt::format("a subscription of {}", topic.name);
  const Qos qos = make_qos(delivery, true, depth, topic.hash);
  const dds_entity_t reader =
      checked(dds_create_reader(parts.participant, made.entity, qos.get(), nullptr), said, what);
  const dds_entity_t condition = checked(dds_create_readcondition(reader, DDS_ANY_STATE), said, what);
  checked(dds_waitset_attach(parts.waitset, condition, 0), said, what);
  parts.readers.push_back(reader);
  return static_cast<int>(parts.readers.size()) - 1;
}

int Participant::add_writer(const WireTopic& topic, Delivery delivery) {
  Parts& parts = *parts_;
  const Parts::Topic made = parts.make_topic("rt" + topic.name, topic.type);
  const Said said;
  const Qos qos = make_qos(delivery, false, 1, topic.hash);
  parts.writers.push_back(checked(dds_create_writer(parts.participant, made.entity, qos.get(), nullptr), said,
                                  fmt::format("a publication of {}", topic.name)));
  parts.types.push_back(made.type);
  return static_cast<int>(parts.writers.size()) - 1;
}

void Participant::announce() {
  Parts& parts = *parts_;
  if (parts.announcement == 0) {
    const Parts::Topic made = parts.make_topic(discovery_topic, discovery_type);
    const Said said;
    const Qos qos = make_qos(Delivery::kept, false, 1, "");
    parts.announcement =
        checked(dds_create_writer(parts.participant, made.entity, qos.get(), nullptr), said, discovery_topic);
    parts.announcement_type = made.type;
  }
  logs::CdrWriter message;
  parts.write_id(parts.participant, message);
  message.length(1);
  message.text("/");
  message.text(parts.options.node);
  for (const auto* endpoints : {&parts.readers, &parts.writers}) {
    message.length(endpoints->size());
    for (const dds_entity_t endpoint : *endpoints) parts.write_id(endpoint, message);
  }
  dds_writecdr(parts.announcement, make_raw_message(parts.announcement_type, message.bytes()));
}

bool Participant::wait(Clock::time_point until) noexcept {
  const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(until - Clock::now()).count();
  const dds_return_t count = dds_waitset_wait(parts_->waitset, nullptr, 0, std::max<std::int64_t>(0, left));
  bool was_woken = false;
  dds_take_guardcondition(parts_->guard, &was_woken);
  return count > (was_woken ? 1 : 0);
}

void Participant::wake() noexcept { dds_set_guardcondition(parts_->guard, true); }

void Participant::take(const std::function<void(const Arrival&)>& use) {
  Parts& parts = *parts_;
  for (std::size_t reader = 0; reader < parts.readers.size(); ++reader) {
    const auto most = static_cast<std::uint32_t>(parts.taken.size());
    const dds_return_t count =
        dds_takecdr(parts.readers[reader], parts.taken.data(), most, parts.infos.data(), DDS_ANY_STATE);
    // References first: whatever `use` throws, none is lost.
    parts.references.clear();
    for (dds_return_t i = 0; i < count; ++i) parts.references.emplace_back(parts.taken[static_cast<std::size_t>(i)]);
    for (std::size_t i = 0; i < parts.references.size(); ++i) {
      if (!parts.infos[i].valid_data) continue;
      const RawMessage raw = look_into(parts.references[i].get());
      use({static_cast<int>(reader), raw.cdr, raw.received});
    }
    parts.references.clear();
  }
}

bool Participant::write(int writer, std::span<const std::byte> cdr) {
  const auto place = static_cast<std::size_t>(writer);
  return dds_writecdr(parts_->writers[place], make_raw_message(parts_->types[place], cdr)) == DDS_RETCODE_OK;
}

bool Participant::flush(int writer, Clock::duration most) {
  const auto nanoseconds = std::chrono::duration_cast<std::chrono::nanoseconds>(most).count();
  return dds_wait_for_acks(parts_->writers[static_cast<std::size_t>(writer)], nanoseconds) == DDS_RETCODE_OK;
}

int Participant::matched_readers(int writer) const noexcept {
  return std::max(0, dds_get_matched_subscriptions(parts_->writers[static_cast<std::size_t>(writer)], nullptr, 0));
}

int Participant::matched_writers(int reader) const noexcept {
  return std::max(0, dds_get_matched_publications(parts_->readers[static_cast<std::size_t>(reader)], nullptr, 0));
}

std::uint32_t domain_of_environment() {
  const char* const given = std::getenv("ROS_DOMAIN_ID");
  if (!given || *given == '\0') return 0;
  const std::string_view text(given);
  std::uint32_t domain = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), domain);
  if (failure != std::errc() || end != text.data() + text.size() || domain > most_domain)
    throw Error(fmt::format("ROS_DOMAIN_ID: found '{}', expected a number from 0 to {}", text, most_domain));
  return domain;
}

std::string dds_type_name(const std::string& type) {
  std::string name;
  const std::size_t last = type.rfind('/');
  for (const char c : type.substr(0, last)) name += c == '/' ? std::string("::") : std::string(1, c);
  return fmt::format("{}::dds_::{}_", name, type.substr(last + 1));
}

}  // namespace rhec::apps::ros
