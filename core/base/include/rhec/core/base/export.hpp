#pragma once

/// Marks what a library of rhec shows to others; everything else is hidden.
#define RHEC_EXPORT __attribute__((visibility("default")))
