// How quickly a log is read, and in how much memory: a gigabyte of MCAP is written, listed and mapped.
//
//     logs [FOLDER [GIGABYTES]]
#include <sys/resource.h>

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/logs/mcap/mcap_log.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/logs/signals/survey.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace {

using rhec::Clock;

/// Noise that no compression shrinks, as of a camera's compressed images.
class Noise {
 public:
  void fill(std::string& text) {
    for (char& each : text)
      each = static_cast<char>((state_ = state_ * 6364136223846793005u + 1442695040888963407u) >> 56);
  }

 private:
  std::uint64_t state_ = 1;
};

std::uint16_t add(rhec::logs::McapWriter& writer, const char* topic, const std::string& type) {
  return writer.add_channel(topic, type, rhec::logs::ros2msg_text(type, rhec::logs::builtin_definitions()));
}

void write_odometry(rhec::logs::Stamp now, double x, rhec::logs::CdrWriter& message) {
  message.clear();
  message.header(now, "odom");
  message.text("base_link");
  message.numbers(std::vector<double>{x, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0});
  message.numbers(std::vector<double>(36, 0.01));
  message.numbers(std::vector<double>{1.5, 0.0, 0.0, 0.0, 0.0, 0.1});
  message.numbers(std::vector<double>(36, 0.01));
}

/// A robot with odometry and wheels at 1 kHz, and texts that fill the rest of `bytes`.
void write_log(const std::filesystem::path& file, std::uintmax_t bytes, std::size_t filling) {
  rhec::logs::McapWriter writer(file);
  const auto odometry = add(writer, "/odom", "nav_msgs/msg/Odometry"),
             camera = add(writer, "/camera", "std_msgs/msg/String");
  rhec::logs::CdrWriter message;
  Noise noise;
  std::string image(filling, ' ');
  std::uintmax_t written = 0;
  for (std::int64_t i = 0; written < bytes; ++i) {
    const rhec::logs::Stamp now = 1'700'000'000'000'000'000 + 1'000'000 * i;
    write_odometry(now, 1e-3 * static_cast<double>(i), message);
    writer.write(odometry, now, message.bytes());
    written += message.bytes().size();
    if (filling == 0) continue;
    noise.fill(image);
    message.clear();
    message.text(image);
    writer.write(camera, now, message.bytes());
    written += message.bytes().size();
  }
  writer.close();
}

rhec::ModelDescription description() {
  rhec::ModelDescription about;
  about.outputs = {{.name = "x", .unit = "m", .meaning = ""}};
  about.inputs = {{.name = "v", .unit = "m/s", .meaning = ""}};
  return about;
}

long peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

template <class Work>
void measure(const char* what, std::uintmax_t bytes, const Work& work) {
  const auto start = Clock::now();
  const std::int64_t count = work();
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  fmt::print("  {:<34} {:>9} records {:>7.2f} s {:>8.0f} MB/s, peak memory {} MB\n", what, count, seconds,
             1e-6 * static_cast<double>(bytes) / seconds, peak_megabytes());
}

void measure_log(const char* name, const std::filesystem::path& file, std::uintmax_t bytes, std::size_t filling) {
  write_log(file, bytes, filling);
  const std::uintmax_t size = std::filesystem::file_size(file);
  fmt::print("{}: {:.0f} MB of messages in a file of {:.0f} MB; rates are those of the messages\n", name,
             1e-6 * static_cast<double>(bytes), 1e-6 * static_cast<double>(size));
  const auto log = rhec::logs::open_mcap(file);
  measure("every record", bytes, [&] {
    std::int64_t count = 0;
    const auto take = [&](const rhec::logs::Record&) { return ++count > 0; };
    static_cast<void>(log->read(std::vector<bool>(log->topics().size(), true), take));
    return count;
  });
  measure("survey (rhec log)", bytes, [&] {
    std::int64_t count = 0;
    for (const auto& topic : rhec::logs::survey(*log).topics) count += topic.count;
    return count;
  });
  measure("drive of two signals", bytes, [&] {
    const rhec::Settings signals = rhec::parse_yaml(
        "{outputs: {x: /odom:pose.pose.position.x}, inputs: {v: /odom:twist.twist.linear.x}}", "benchmark");
    return std::ssize(rhec::logs::read_drive(*log, rhec::logs::SignalMap(signals, description())).events);
  });
  std::filesystem::remove(file);
}

}  // namespace

int main(int count, char** words) try {
  const std::filesystem::path folder = count > 1 ? words[1] : std::filesystem::temp_directory_path();
  const double gigabytes = count > 2 ? std::stod(words[2]) : 1.0;
  const auto bytes = static_cast<std::uintmax_t>(1e9 * gigabytes);
  const std::filesystem::path file = folder / "rhec_benchmark.mcap";
  measure_log("camera and odometry", file, bytes, 40000);
  measure_log("odometry alone", file, bytes / 4, 0);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "{}\n", error.what());
  return 1;
}
