#include "signal_value.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace rhec::logs {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr const char* type_of_fix = "sensor_msgs/msg/NavSatFix";

double place_in_plane(SignalForm form, std::span<const double> fields, std::optional<LocalPlane>& plane) {
  const bool has_status = fields.size() == 4;
  if (has_status && !(fields[3] >= 0.0)) return missing;  // a receiver without a fix
  GeodeticPoint point{fields[0], fields[1], fields.size() > 2 && std::isfinite(fields[2]) ? fields[2] : 0.0};
  if (!is_valid(point)) return missing;
  if (!plane) plane.emplace(point);
  if (fields.size() < 3 || !std::isfinite(fields[2])) point.height = plane->origin().height;
  return plane->forward(point)[form == SignalForm::east ? 0 : form == SignalForm::north ? 1 : 2];
}

/// The rotation from a sensor's axes to the vehicle's, by rows.
std::array<std::array<double, 3>, 3> rotation_of(const std::vector<double>& rpy) {
  if (rpy.empty()) return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const double cr = std::cos(rpy[0]), sr = std::sin(rpy[0]), cp = std::cos(rpy[1]), sp = std::sin(rpy[1]);
  const double cy = std::cos(rpy[2]), sy = std::sin(rpy[2]);
  return {{{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
           {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
           {-sp, cp * sr, cp * cr}}};
}

/// Of the vehicle's longitudinal axis, which the sensor sees as `axis`.
double heading_of(std::span<const double> q, const std::array<double, 3>& axis) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double norm = x * x + y * y + z * z + w * w;
  if (!(std::abs(norm - 1.0) < 0.1)) return missing;  // zeros stand for an orientation that is not known
  const double east =
      (norm - 2.0 * (y * y + z * z)) * axis[0] + 2.0 * (x * y - w * z) * axis[1] + 2.0 * (x * z + w * y) * axis[2];
  const double north =
      2.0 * (w * z + x * y) * axis[0] + (norm - 2.0 * (x * x + z * z)) * axis[1] + 2.0 * (y * z - w * x) * axis[2];
  return std::atan2(north, east);
}

double direction_of(double east, double north) {
  constexpr double shortest = 1e-3;  // [m], or what the vector is in
  return std::hypot(east, north) > shortest ? std::atan2(north, east) : missing;
}

/// From the first fix to the second: each a latitude and a longitude, and a height and a status where it has them.
double direction_of_fixes(std::span<const double> fields, std::optional<LocalPlane>& plane) {
  const std::size_t each = fields.size() / 2;
  const std::span<const double> from = fields.first(each), to = fields.last(each);
  return direction_of(place_in_plane(SignalForm::east, to, plane) - place_in_plane(SignalForm::east, from, plane),
                      place_in_plane(SignalForm::north, to, plane) - place_in_plane(SignalForm::north, from, plane));
}

}  // namespace

std::vector<SignalName> fields_of(const MappedSignal& signal, const std::string& type) {
  const SignalForm form = signal.options.form;
  if (form == SignalForm::direction && signal.from.front().field.empty()) {
    std::vector<SignalName> fields;
    for (const SignalName& fix : signal.from)
      for (const char* part : {"latitude", "longitude", "altitude", "status.status"})
        if (part != std::string_view("status.status") || type == type_of_fix) fields.push_back({fix.topic, part});
    return fields;
  }
  if (signal.from.size() != 1 || signal.from.front().topic.empty()) return signal.from;
  const auto& [topic, field] = signal.from.front();
  const std::string prefix = field.empty() ? "" : field + ".";
  std::vector<std::string> parts;
  if (form == SignalForm::heading) {
    parts = {"x", "y", "z", "w"};
  } else if (form == SignalForm::yaw_rate) {
    parts = {"x", "y", "z"};
  } else if (form == SignalForm::east || form == SignalForm::north || form == SignalForm::up) {
    parts = {"latitude", "longitude", "altitude"};
    if (type == type_of_fix) parts.emplace_back("status.status");
  } else {
    return signal.from;
  }
  std::vector<SignalName> fields;
  fields.reserve(parts.size());
  for (const std::string& part : parts) fields.push_back({topic, prefix + part});
  return fields;
}

double value_of(const MappedSignal& signal, std::span<const double> fields, std::optional<LocalPlane>& plane) {
  double value = fields.front();
  switch (signal.options.form) {
    case SignalForm::value:
      break;
    case SignalForm::mean:
      value = std::accumulate(fields.begin(), fields.end(), 0.0) / static_cast<double>(fields.size());
      break;
    case SignalForm::turn:
      value = fields[1] - fields[0];
      break;
    case SignalForm::heading:
      value = heading_of(fields, rotation_of(signal.options.rpy)[0]);
      break;
    case SignalForm::direction:
      value = fields.size() == 2 ? direction_of(fields[0], fields[1]) : direction_of_fixes(fields, plane);
      break;
    case SignalForm::yaw_rate: {
      const std::array<double, 3> up = rotation_of(signal.options.rpy)[2];
      value = up[0] * fields[0] + up[1] * fields[1] + up[2] * fields[2];
      break;
    }
    case SignalForm::east:
    case SignalForm::north:
    case SignalForm::up:
      value = place_in_plane(signal.options.form, fields, plane);
      break;
  }
  value *= signal.factor;
  if (!signal.options.derivative) value += signal.options.offset;
  return std::isfinite(value) ? value : missing;
}

double stated_sigma(const MappedSignal& signal, double stated) noexcept {
  if (!(stated > 0.0)) return missing;  // messages have 0 and -1 for what is not known
  const double sigma = signal.accuracy->is_variance ? std::sqrt(stated) : stated;
  return std::max(signal.sigma_factor * sigma, signal.options.least_sigma);
}

std::string kind_of_accuracy(const MappedSignal& signal, const std::string& type) {
  // 0: COVARIANCE_TYPE_UNKNOWN
  const bool is_of_fix = type == type_of_fix && signal.accuracy->of.field.starts_with("position_covariance[");
  return is_of_fix ? "position_covariance_type" : "";
}

}  // namespace rhec::logs
