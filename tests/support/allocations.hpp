#pragma once

namespace rhec {

/// How often this program has allocated so far: by operator new, aligned or not, and by malloc, which Eigen calls.
/// Under AddressSanitizer and ThreadSanitizer, which replace malloc, by operator new alone.
long allocation_count();

}  // namespace rhec
