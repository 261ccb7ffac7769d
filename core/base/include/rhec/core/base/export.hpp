#pragma once

/// Marks the exported symbols of a rhec library; all others are hidden.
#define RHEC_EXPORT __attribute__((visibility("default")))
