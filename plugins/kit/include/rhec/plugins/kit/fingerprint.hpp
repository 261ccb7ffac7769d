#pragma once

// Only Eigen's macros, in the way Eigen/Core includes them: all of Eigen would take most of a plugin's compile time.
#include <Eigen/src/Core/util/Macros.h>
//
#include <Eigen/src/Core/util/ConfigureVectorization.h>

#include <string>  // defines the macros of the standard library

/// What two libraries must have in common to exchange C++ objects, as one constant text. It is composed at compile
/// time, so a plugin carries its own and the host compares the two.
///
/// Eigen's alignment of allocated memory and of fixed-size objects ("static") depends on the compiler's flags (-march,
/// -mavx) and Eigen's macros (EIGEN_DONT_ALIGN, EIGEN_MAX_STATIC_ALIGN_BYTES). Compile the file with the plugin's
/// manifest with the same ones as rhec, and put kernels for wider registers into separate files.

#define RHEC_TEXT_OF_TOKEN(token) #token
#define RHEC_TEXT_OF(macro) RHEC_TEXT_OF_TOKEN(macro)

/// The version of rhec that these headers belong to.
#define RHEC_VERSION_TEXT "0.1.0"

#if defined(__clang__)
#define RHEC_COMPILER_TEXT "clang " RHEC_TEXT_OF(__clang_major__)
#elif defined(__GNUC__)
#define RHEC_COMPILER_TEXT "gcc " RHEC_TEXT_OF(__GNUC__)
#else
#error "rhec is built with gcc or clang"
#endif

#if defined(_GLIBCXX_DEBUG)
#define RHEC_CONTAINERS_TEXT " debug"  // changes the size of containers
#else
#define RHEC_CONTAINERS_TEXT ""
#endif

#if defined(_GLIBCXX_RELEASE)
#define RHEC_LIBRARY_TEXT "libstdc++ cxx11-abi " RHEC_TEXT_OF(_GLIBCXX_USE_CXX11_ABI) RHEC_CONTAINERS_TEXT
#else
#define RHEC_LIBRARY_TEXT "libc++ " RHEC_TEXT_OF(_LIBCPP_ABI_VERSION)
#endif

#define RHEC_EIGEN_TEXT \
  "Eigen " RHEC_TEXT_OF(EIGEN_WORLD_VERSION) "." RHEC_TEXT_OF(EIGEN_MAJOR_VERSION) "." RHEC_TEXT_OF(EIGEN_MINOR_VERSION)

#define RHEC_ALIGNMENT_TEXT \
  "Eigen alignment " RHEC_TEXT_OF(EIGEN_MAX_ALIGN_BYTES) " (static " RHEC_TEXT_OF(EIGEN_MAX_STATIC_ALIGN_BYTES) ")"

/// e.g. "rhec 0.1.0, gcc 12, libstdc++ cxx11-abi 1, Eigen 3.4.0, Eigen alignment 16 (static 16)"
#define RHEC_BUILD_FINGERPRINT                                                                  \
  "rhec " RHEC_VERSION_TEXT ", " RHEC_COMPILER_TEXT ", " RHEC_LIBRARY_TEXT ", " RHEC_EIGEN_TEXT \
  ","                                                                                           \
  " " RHEC_ALIGNMENT_TEXT
