# For 64-bit ARM, with Debian's compiler (package g++-aarch64-linux-gnu), as the preset aarch64 has it:
#
#     scripts/cross-root arm64 build/aarch64-root
#     scripts/build aarch64 bicycle_slip gn_rti
#
# RHEC_SYSROOT is a folder with the libraries of the target and their headers, as its root has them. The programs that
# write the kernels of models run under qemu (package qemu-user-static) where there is one; otherwise, set
# RHEC_MODEL_WRITERS to the folder bin/ of a build for this machine.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)

list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES RHEC_SYSROOT)
if(RHEC_SYSROOT)
  set(CMAKE_SYSROOT "${RHEC_SYSROOT}")
  set(CMAKE_FIND_ROOT_PATH "${RHEC_SYSROOT}")
endif()
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${RHEC_SYSROOT}")
set(ENV{PKG_CONFIG_LIBDIR} "${RHEC_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${RHEC_SYSROOT}/usr/lib/pkgconfig:${RHEC_SYSROOT}/usr/share/pkgconfig")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

find_program(RHEC_QEMU NAMES qemu-aarch64 qemu-aarch64-static)
if(RHEC_QEMU AND NOT RHEC_MODEL_WRITERS)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${RHEC_QEMU}" -L "${RHEC_SYSROOT}")
endif()
