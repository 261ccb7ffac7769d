#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rhec/logs/mapping/local_plane.hpp"
#include "rhec/logs/mapping/signal_map.hpp"

namespace rhec::logs {

/// The fields that a signal needs: of a form that takes a topic as a whole, those that it stands for. `type` is the
/// topic's.
std::vector<SignalName> fields_of(const MappedSignal& signal, const std::string& type);

/// The value of a signal, given those of its fields; NaN if it has none. The first good place becomes the origin of the
/// local plane where there is none.
double value_of(const MappedSignal& signal, std::span<const double> fields, std::optional<LocalPlane>& plane);

/// The standard deviation of a signal's value from what a record states; NaN where that says nothing.
double stated_sigma(const MappedSignal& signal, double stated) noexcept;
/// The field that is 0 in records whose stated accuracy means nothing; empty where there is none.
std::string kind_of_accuracy(const MappedSignal& signal, const std::string& type);

}  // namespace rhec::logs
