// The ranks of a sweep on Open MPI. Only the main thread of a process calls MPI.
#include <mpi.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <exception>
#include <iterator>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "rhec/core/base/error.hpp"
#include "sweep_ranks.hpp"

namespace rhec::apps {
namespace {

using Json = nlohmann::json;
using Bytes = std::vector<std::uint8_t>;
using Steady = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Message tags. Rank 0 sends begin (with true or false), runs, withdraw and over; it receives all others.
enum Tag : int { tag_ready = 1, tag_begin, tag_runs, tag_rows, tag_withdraw, tag_withdrawn, tag_failure, tag_over };

struct Message {
  int from = 0;
  int tag = 0;
  Bytes bytes;
  Json json() const { return Json::from_msgpack(bytes); }
};

void send(int to, Tag tag, const Json& content) {
  const Bytes bytes = Json::to_msgpack(content);
  MPI_Send(bytes.data(), static_cast<int>(bytes.size()), MPI_BYTE, to, tag, MPI_COMM_WORLD);
}

Message receive(const MPI_Status& announced) {
  Message message{announced.MPI_SOURCE, announced.MPI_TAG, {}};
  int size = 0;
  MPI_Get_count(&announced, MPI_BYTE, &size);
  message.bytes.resize(static_cast<std::size_t>(size));
  MPI_Recv(message.bytes.data(), size, MPI_BYTE, message.from, message.tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return message;
}

/// The next message, if there is one.
std::optional<Message> next_message(int from = MPI_ANY_SOURCE, int tag = MPI_ANY_TAG) {
  int is_there = 0;
  MPI_Status status;
  MPI_Iprobe(from, tag, MPI_COMM_WORLD, &is_there, &status);
  if (!is_there) return std::nullopt;
  return receive(status);
}

/// Waits for the next message by polling: MPI's own blocking calls would keep the processor busy.
Message wait_for_message(int from = MPI_ANY_SOURCE, int tag = MPI_ANY_TAG) {
  for (;;) {
    if (auto message = next_message(from, tag)) return std::move(*message);
    std::this_thread::sleep_for(milliseconds(1));
  }
}

Json json_of(const sim::SweepRow& row) {
  return {row.identity.high,
          row.identity.low,
          row.configuration,
          row.seed ? Json(*row.seed) : Json(),
          static_cast<int>(row.status),
          row.reason,
          row.steps,
          row.solves,
          row.fallbacks,
          row.nees,
          row.mae,
          row.rmse,
          row.mae_after_start,
          row.statuses,
          row.solve_time_us,
          row.seconds};
}

sim::SweepRow row_of(const Json& json) {
  sim::SweepRow row;
  row.identity = {json[0].get<std::uint64_t>(), json[1].get<std::uint64_t>()};
  row.configuration = json[2];
  if (!json[3].is_null()) row.seed = json[3].get<int>();
  row.status = static_cast<sim::RunStatus>(json[4].get<int>());
  row.reason = json[5];
  row.steps = json[6];
  row.solves = json[7];
  row.fallbacks = json[8];
  row.nees = json[9];
  row.mae = json[10];
  row.rmse = json[11];
  row.mae_after_start = json[12];
  row.statuses = json[13];
  row.solve_time_us = json[14];
  row.seconds = json[15];
  return row;
}

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "an unknown host";
}

/// All ranks, as rank 0 sees them: its own threads, and the other ranks.
class RankWorkers final : public sim::SweepWorkers {
 public:
  RankWorkers(const Host& host, const sim::Sweep& sweep, int threads, int ranks)
      : own_(host, sweep, threads), threads_(threads), others_(static_cast<std::size_t>(ranks)) {}
  ~RankWorkers() override {
    for (int rank = 1; rank < rank_count(); ++rank) send(rank, tag_over, {});
  }
  RankWorkers(const RankWorkers&) = delete;
  RankWorkers& operator=(const RankWorkers&) = delete;

  std::int64_t room() override {
    std::int64_t sum = own_.room();
    for (int rank = 1; rank < rank_count(); ++rank) sum += room_of(rank);
    return sum;
  }

  void give(std::int64_t run) override {
    int to = 0;
    std::int64_t most = own_.room();
    for (int rank = 1; rank < rank_count(); ++rank)
      if (const std::int64_t room = room_of(rank); room > most) most = room, to = rank;
    if (to == 0) return own_.give(run);
    others_[to].outbox.push_back(run);
  }

  std::vector<sim::SweepRow> take(milliseconds patience) override {
    send_batches();
    const Steady::time_point end = Steady::now() + patience;
    std::vector<sim::SweepRow> rows = std::exchange(backlog_, {});
    for (milliseconds pause(0);; pause = milliseconds(1)) {
      if (!rows.empty()) pause = milliseconds(0);
      std::vector<sim::SweepRow> own = own_.take(pause);
      std::move(own.begin(), own.end(), std::back_inserter(rows));
      while (const auto message = next_message()) read(*message, rows);
      if (!rows.empty()) break;
      if (!failure_.empty()) throw Error(failure_);
      if (Steady::now() >= end) break;
    }
    for (const sim::SweepRow& row : rows) seconds_ = seconds_ > 0.0 ? 0.9 * seconds_ + 0.1 * row.seconds : row.seconds;
    return rows;
  }

  std::int64_t withdraw() override {
    std::int64_t count = own_.withdraw();
    for (int rank = 1; rank < rank_count(); ++rank) {
      count += std::ssize(std::exchange(others_[rank].outbox, {}));
      send(rank, tag_withdraw, {});
    }
    for (int answers = 1; answers < rank_count();) {
      const Message message = wait_for_message();
      if (message.tag == tag_withdrawn) {
        const auto withdrawn = message.json().get<std::int64_t>();
        others_[message.from].under_way -= withdrawn;
        count += withdrawn;
        ++answers;
      } else {
        read(message, backlog_);
      }
    }
    return count;
  }

 private:
  struct Other {
    std::int64_t under_way = 0;  // runs sent but not finished
    std::vector<std::int64_t> outbox;
  };
  int rank_count() const { return static_cast<int>(others_.size()); }

  /// A rank gets runs for about a fifth of a second, and more once half of them are done.
  std::int64_t room_of(int rank) const {
    constexpr double batch_seconds = 0.2;
    const double batch = seconds_ > 0.0 ? std::clamp(std::ceil(batch_seconds / seconds_), 1.0, 64.0) : 1.0;
    const auto most = static_cast<std::int64_t>(threads_ * (1.0 + batch));
    const Other& other = others_[rank];
    if (other.outbox.empty() && 2 * other.under_way > most) return 0;
    return most - other.under_way - std::ssize(other.outbox);
  }

  void send_batches() {
    for (int rank = 1; rank < rank_count(); ++rank) {
      Other& other = others_[rank];
      if (other.outbox.empty()) continue;
      other.under_way += std::ssize(other.outbox);
      send(rank, tag_runs, std::exchange(other.outbox, {}));
    }
  }

  void read(const Message& message, std::vector<sim::SweepRow>& rows) {
    if (message.tag == tag_failure) failure_ = message.json().get<std::string>();
    if (message.tag != tag_rows) return;
    for (const Json& row : message.json()) {
      rows.push_back(row_of(row));
      --others_[message.from].under_way;
    }
  }

  sim::ThreadWorkers own_;
  int threads_;
  std::vector<Other> others_;  // by rank; the first is unused
  std::vector<sim::SweepRow> backlog_;
  std::string failure_;
  double seconds_ = 0.0;  // moving average of the time of a run
};

class MpiRanks final : public SweepRanks {
 public:
  MpiRanks() {
    int provided = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &count_);
  }
  ~MpiRanks() override {
    if (rank_ == 0) begin(false);
    MPI_Finalize();
  }
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;

  int rank() const override { return rank_; }
  int count() const override { return count_; }

  std::unique_ptr<sim::SweepWorkers> workers(const Host& host, const sim::Sweep& sweep, int threads) override {
    for (int rank = 1; rank < count_; ++rank) {
      const Json ready = wait_for_message(rank, tag_ready).json();
      const std::string name = fmt::format("rank {} on {}", rank, ready.at("host").get<std::string>());
      if (const std::string problem = ready.at("problem"); !problem.empty())
        throw Error(fmt::format("{}: {}", name, problem));
      if (ready.at("sweep") != sweep.fingerprint().text())
        throw Error(
            fmt::format("{}: reads another sweep, or other scenarios, than rank 0 on {} under the same names; "
                        "give all of them the same files",
                        name, host_name()));
    }
    begin(true);
    return std::make_unique<RankWorkers>(host, sweep, threads, count_);
  }

  void serve(const Host& host, const std::optional<sim::Sweep>& sweep, const std::string& problem,
             int threads) override {
    // Rank 0 handles the request to stop, and lets the other ranks finish the runs they have begun.
    std::signal(SIGINT, SIG_IGN);
    std::signal(SIGTERM, SIG_IGN);
    send(0, tag_ready,
         {{"host", host_name()}, {"problem", problem}, {"sweep", sweep ? sweep->fingerprint().text() : ""}});
    if (!wait_for_message(0, tag_begin).json().get<bool>()) return;
    try {
      make_runs(host, *sweep, threads);
    } catch (const std::exception& failure) {  // rank 0 throws it again
      send(0, tag_failure, fmt::format("rank {} on {}: {}", rank_, host_name(), failure.what()));
      for (;;) {
        const int tag = wait_for_message(0).tag;
        if (tag == tag_over) return;
        if (tag == tag_withdraw) send(0, tag_withdrawn, std::int64_t{0});
      }
    }
  }

 private:
  void begin(bool really) {
    if (std::exchange(begun_, true)) return;
    for (int rank = 1; rank < count_; ++rank) send(rank, tag_begin, really);
  }

  static void make_runs(const Host& host, const sim::Sweep& sweep, int threads) {
    sim::ThreadWorkers own(host, sweep, threads);
    for (;;) {
      while (const auto message = next_message(0)) {
        if (message->tag == tag_over) return;
        if (message->tag == tag_withdraw) send(0, tag_withdrawn, own.withdraw());
        if (message->tag == tag_runs)
          for (const Json& run : message->json()) own.give(run.get<std::int64_t>());
      }
      Json rows = Json::array();
      for (const sim::SweepRow& row : own.take(milliseconds(2))) rows.push_back(json_of(row));
      if (!rows.empty()) send(0, tag_rows, rows);
    }
  }

  int rank_ = 0, count_ = 1;
  bool begun_ = false;
};

}  // namespace
}  // namespace rhec::apps

extern "C" __attribute__((visibility("default"))) rhec::apps::SweepRanks* rhec_start_sweep_ranks() {
  return new rhec::apps::MpiRanks();
}
