# For 64-bit ARM, with Debian's compiler (package g++-aarch64-linux-gnu):
#
#     cmake -S . -B build/aarch64 -DCMAKE_TOOLCHAIN_FILE=cmake/toolchains/aarch64.cmake -DRHEC_SYSROOT=<folder> ...
#
# RHEC_SYSROOT is a folder with the libraries of the target and their headers, as its root has them. The programs that
# write the kernels of models run under qemu (package qemu-user) where there is one; otherwise, set RHEC_MODEL_WRITERS
# to the folder bin/ of a build for this machine.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)

list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES RHEC_SYSROOT)
if(RHEC_SYSROOT)
  set(CMAKE_SYSROOT "${RHEC_SYSROOT}")
  set(CMAKE_FIND_ROOT_PATH "${RHEC_SYSROOT}")
endif()
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

find_program(RHEC_QEMU NAMES qemu-aarch64 qemu-aarch64-static)
if(RHEC_QEMU AND NOT RHEC_MODEL_WRITERS)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${RHEC_QEMU}" -L "${RHEC_SYSROOT}")
endif()
