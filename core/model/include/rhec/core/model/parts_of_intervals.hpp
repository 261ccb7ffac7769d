#pragma once

#include "rhec/core/base/export.hpp"

namespace rhec {

/// What a model with data of intervals (Model::data_count) also is, if these depend on where an interval ends. Of other
/// models, the data of a part are those of the whole.
class RHEC_EXPORT PartsOfIntervals {
 public:
  virtual ~PartsOfIntervals() = default;
  /// The data of the part of an interval from its start to a share (0 to 1) of its duration: with these, integration
  /// over that part leads to the vehicle's state there.
  virtual void data_of_part(const double* data, double share, double* part) const noexcept = 0;
};

}  // namespace rhec
