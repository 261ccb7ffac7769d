# One function for each kind of target, so that all libraries and plugins are built alike.

# Flags that every target of ours shares.
add_library(rhec_flags INTERFACE)
target_compile_options(rhec_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual)
# x86-64-v2 is what any field computer of the last decade has; kernels for wider registers are chosen at run time.
if(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
  target_compile_options(rhec_flags INTERFACE -march=x86-64-v2)
else()
  # That has no fused product and sum; processors that have it round as if they had not, but in targets with this property.
  target_compile_options(rhec_flags INTERFACE "$<$<NOT:$<BOOL:$<TARGET_PROPERTY:RHEC_FUSES>>>:-ffp-contract=off>")
endif()
# GNU's compiler collects garbage whenever some of its own megabytes may have come together, which takes up to a fifth of its
# time. Where there is memory enough for each of the processor's cores, more may come together first.
cmake_host_system_information(RESULT RHEC_HOST_MEMORY QUERY TOTAL_PHYSICAL_MEMORY)  # MiB
cmake_host_system_information(RESULT RHEC_HOST_CORES QUERY NUMBER_OF_LOGICAL_CORES)
math(EXPR RHEC_MEMORY_OF_CORE "${RHEC_HOST_MEMORY} / ${RHEC_HOST_CORES}")
if(RHEC_MEMORY_OF_CORE GREATER 3000)
  target_compile_options(rhec_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=786432>)  # KiB
endif()
# IEEE semantics stay; only what costs speed and is never read (errno, floating-point traps) goes.
target_compile_options(rhec_flags INTERFACE -fno-math-errno -fno-trapping-math)
# Nobody replaces single functions of our libraries, so calls within one need not go through its tables.
target_compile_options(rhec_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-fno-semantic-interposition>)
target_link_options(rhec_flags INTERFACE -Wl,-Bsymbolic-functions)
if(RHEC_WARNINGS_AS_ERRORS)
  target_compile_options(rhec_flags INTERFACE -Werror)
endif()
if(RHEC_SANITIZE)
  target_compile_options(rhec_flags INTERFACE -fsanitize=address,undefined -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  target_link_options(rhec_flags INTERFACE -fsanitize=address,undefined)
endif()
if(RHEC_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "RHEC_FUZZ needs clang, which has libFuzzer; scripts/fuzz configures that")
  endif()
  target_compile_options(rhec_flags INTERFACE -fsanitize=fuzzer-no-link,address,undefined -fno-omit-frame-pointer
    -fno-sanitize-recover=undefined)
  target_link_options(rhec_flags INTERFACE -fsanitize=address,undefined)
endif()
if(RHEC_SANITIZE_THREADS)
  if(RHEC_SANITIZE)
    message(FATAL_ERROR "RHEC_SANITIZE and RHEC_SANITIZE_THREADS are both ON; the compiler can do one of them at a time")
  endif()
  target_compile_options(rhec_flags INTERFACE -fsanitize=thread)
  target_link_options(rhec_flags INTERFACE -fsanitize=thread)
endif()

# What Eigen and fmt would compile anew for most sources. Those with precompiled headers know that it is here.
if(RHEC_PRECOMPILE)
  add_library(rhec_compiled_once STATIC "${CMAKE_CURRENT_LIST_DIR}/compiled_once/eigen.cpp" "${CMAKE_CURRENT_LIST_DIR}/compiled_once/fmt.cpp")
  target_compile_features(rhec_compiled_once PRIVATE cxx_std_20)
  # Each function apart: a library takes those that it calls.
  target_compile_options(rhec_compiled_once PRIVATE $<TARGET_PROPERTY:rhec_flags,INTERFACE_COMPILE_OPTIONS> -ffunction-sections)
  target_link_options(rhec_compiled_once INTERFACE -Wl,--gc-sections)
  target_link_libraries(rhec_compiled_once PRIVATE Eigen3::Eigen fmt::fmt)
  target_link_libraries(rhec_flags INTERFACE rhec_compiled_once)
endif()

# rhec_add_precompiled_headers(NAME): what most sources include, parsed once with the options of this folder. Those of its
# targets, and of the folders below and after it, that call rhec_precompile have it.
#   A source includes what it needs all the same: it compiles without these, and clang-tidy reads it so.
function(rhec_add_precompiled_headers NAME)
  if(NOT RHEC_PRECOMPILE)
    return()
  endif()
  file(CONFIGURE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/${NAME}.cpp" CONTENT "// Headers alone.\n")
  add_library(${NAME} OBJECT EXCLUDE_FROM_ALL "${CMAKE_CURRENT_BINARY_DIR}/${NAME}.cpp")
  target_compile_features(${NAME} PRIVATE cxx_std_20)
  target_compile_options(${NAME} PRIVATE ${RHEC_PRECOMPILED_OPTIONS})
  target_link_libraries(${NAME} PRIVATE rhec_flags Eigen3::Eigen fmt::fmt)
  target_precompile_headers(${NAME} PRIVATE ${RHEC_PRECOMPILED_HEADERS})
  if(RHEC_COLD)
    target_compile_options(${NAME} PRIVATE ${RHEC_COLD_OPTIONS})
    set(RHEC_COLD_PRECOMPILED ${NAME} PARENT_SCOPE)
  else()
    set(RHEC_PRECOMPILED ${NAME} PARENT_SCOPE)
  endif()
endfunction()
# A folder that sets RHEC_COLD has sources which take the compiler longer than they ever run: they wait for files, or for what
# they call. They are optimised less: with -Og, which takes the compiler 14 to 24 % less time than -O1.
set(RHEC_COLD_OPTIONS "$<$<CONFIG:Release,RelWithDebInfo>:-Og>")
set(RHEC_PRECOMPILED_HEADERS
  <algorithm> <array> <charconv> <chrono> <cmath> <filesystem> <fstream> <functional> <map> <memory> <numbers> <optional>
  <set> <span> <string> <string_view> <utility> <vector> 
  "${CMAKE_CURRENT_LIST_DIR}/compiled_once/eigen.hpp" "${CMAKE_CURRENT_LIST_DIR}/compiled_once/fmt.hpp")
# ccache is to know what a precompiled header holds. gcc 12 warns of sums of texts, once std::string is precompiled, that they
# are written beyond the short texts' place in the object, or onto themselves.
set(RHEC_PRECOMPILED_OPTIONS "$<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess;-Wno-array-bounds;-Wno-stringop-overflow;-Wno-restrict>")

# rhec_precompile(TARGET): the target's sources have the precompiled headers, those of cold sources in a folder of such.
function(rhec_precompile TARGET)
  if(RHEC_COLD)
    target_compile_options(${TARGET} PRIVATE ${RHEC_COLD_OPTIONS})
    set(RHEC_PRECOMPILED ${RHEC_COLD_PRECOMPILED})
  endif()
  if(NOT RHEC_PRECOMPILE)
    return()
  endif()
  target_precompile_headers(${TARGET} REUSE_FROM ${RHEC_PRECOMPILED})
  target_compile_options(${TARGET} PRIVATE ${RHEC_PRECOMPILED_OPTIONS})
  # What fmt is told must be the same for all, also where it is not linked.
  target_compile_definitions(${TARGET} PRIVATE $<TARGET_PROPERTY:fmt::fmt,INTERFACE_COMPILE_DEFINITIONS>)
endfunction()

# rhec_set_up_shared_library(NAME): what all shared libraries of ours have. The target is `rhec_<NAME>`, its alias and its
# name in the package are `rhec::<NAME>`.
function(rhec_set_up_shared_library NAME)
  set(TARGET rhec_${NAME})
  add_library(rhec::${NAME} ALIAS ${TARGET})
  target_compile_features(${TARGET} PUBLIC cxx_std_20)
  set_target_properties(${TARGET} PROPERTIES
    LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
    EXPORT_NAME ${NAME} INSTALL_RPATH "$ORIGIN")
  set_property(GLOBAL APPEND PROPERTY RHEC_SHARED_LIBRARIES lib${TARGET})
  install(TARGETS ${TARGET} EXPORT rhecTargets
    LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT rhec NAMELINK_COMPONENT dev)
endfunction()

# rhec_unite(TARGET): with RHEC_UNITY, several of the target's sources are compiled as one. Where tests are built with all else,
# those with a private header beside them are not: tests link their objects (rhec_objects_of).
function(rhec_unite TARGET)
  if(NOT RHEC_UNITY)
    return()
  endif()
  if(RHEC_TESTS_LINK_OBJECTS)
    get_target_property(SOURCES ${TARGET} SOURCES)
    foreach(SOURCE IN LISTS SOURCES)
      cmake_path(REPLACE_EXTENSION SOURCE hpp OUTPUT_VARIABLE HEADER)
      if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${HEADER}")
        set_source_files_properties("${SOURCE}" PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      endif()
    endforeach()
  endif()
  # As many sources in each, so that none is left over; fewer where they are compiled again after a change.
  get_target_property(SOURCES ${TARGET} SOURCES)
  list(LENGTH SOURCES COUNT)
  set(MOST 16)
  if(RHEC_TESTS_LINK_OBJECTS)
    set(MOST 10)
  endif()
  math(EXPR UNITS "(${COUNT} + ${MOST} - 1) / ${MOST}")
  math(EXPR SIZE "(${COUNT} + ${UNITS} - 1) / ${UNITS}")
  set_target_properties(${TARGET} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${SIZE})
endfunction()

# rhec_objects_of(VARIABLE TARGET name ...): objects of a library's or a plugin's sources <name>.cpp, for tests that call
# what it does not export. They are those that it was linked from, so that nothing is compiled twice, unless it was compiled as one.
function(rhec_objects_of VARIABLE TARGET)
  list(JOIN ARGN "|" NAMES)
  if(NOT RHEC_TESTS_LINK_OBJECTS)
    string(MD5 HASH "${NAMES}")
    string(SUBSTRING "${HASH}" 0 8 HASH)
    set(APART ${TARGET}_apart_${HASH})
    get_target_property(SOURCES ${TARGET} SOURCES)
    get_target_property(FOLDER ${TARGET} SOURCE_DIR)
    list(FILTER SOURCES INCLUDE REGEX "^(.*/)?(${NAMES})[.]cpp$")
    list(TRANSFORM SOURCES PREPEND "${FOLDER}/")
    add_library(${APART} OBJECT EXCLUDE_FROM_ALL ${SOURCES})
    target_include_directories(${APART} PRIVATE "$<TARGET_PROPERTY:${TARGET},INCLUDE_DIRECTORIES>")
    target_compile_definitions(${APART} PRIVATE "$<TARGET_PROPERTY:${TARGET},COMPILE_DEFINITIONS>")
    target_compile_options(${APART} PRIVATE "$<TARGET_PROPERTY:${TARGET},COMPILE_OPTIONS>")
    target_compile_features(${APART} PRIVATE cxx_std_20)
    set(TARGET ${APART})
  endif()
  set(${VARIABLE} "$<FILTER:$<TARGET_OBJECTS:${TARGET}>,INCLUDE,/(${NAMES})[.]cpp>" PARENT_SCOPE)
endfunction()

# rhec_add_room(FLOOR ROOM [INTERNAL] [SHARED] [AFTER room ...] [SOURCES ...] [PUBLIC ...] [PRIVATE ...])
#   A room of a floor, in its own folder: the target `rhec_<FLOOR>_<ROOM>`. It sees the public headers of the rooms of the same
#   floor that it comes AFTER, and of those that they come after, and no others. The headers in <folder>/include are
#   installed, those of an INTERNAL room are not. What is compiled is a part of the floor's library, or of a SHARED room a
#   library of its own, `rhec::<FLOOR>_<ROOM>`, which is linked to those of the rooms before it that it needs.
function(rhec_add_room FLOOR ROOM)
  cmake_parse_arguments(PARSE_ARGV 2 ARG "INTERNAL;SHARED" "" "AFTER;SOURCES;PUBLIC;PRIVATE")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "rhec_add_room(${FLOOR} ${ROOM}): what is '${ARG_UNPARSED_ARGUMENTS}'?")
  endif()
  set(TARGET rhec_${FLOOR}_${ROOM})
  list(TRANSFORM ARG_AFTER PREPEND rhec_${FLOOR}_)
  set(HEADERS "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>")
  if(ARG_SHARED)
    add_library(${TARGET} SHARED ${ARG_SOURCES})
    target_include_directories(${TARGET} PUBLIC "${HEADERS}" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
    target_link_libraries(${TARGET} PUBLIC ${ARG_AFTER} ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} "$<BUILD_INTERFACE:rhec_flags>")
    target_link_options(${TARGET} PRIVATE "LINKER:--as-needed")
    rhec_set_up_shared_library(${FLOOR}_${ROOM})
    set_property(GLOBAL APPEND PROPERTY RHEC_ROOMS_${FLOOR} rhec::${FLOOR}_${ROOM})
    rhec_precompile(${TARGET})
  elseif(ARG_SOURCES)
    add_library(${TARGET} OBJECT ${ARG_SOURCES})
    target_include_directories(${TARGET} PUBLIC "${HEADERS}")
    target_link_libraries(${TARGET} PUBLIC ${ARG_AFTER} ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} rhec_flags)
    target_compile_features(${TARGET} PUBLIC cxx_std_20)
    rhec_add_objects(${FLOOR} ${TARGET})
    rhec_precompile(${TARGET})
  else()
    add_library(${TARGET} INTERFACE)
    target_include_directories(${TARGET} INTERFACE "${HEADERS}")
    target_link_libraries(${TARGET} INTERFACE ${ARG_AFTER} ${ARG_PUBLIC})
    target_compile_features(${TARGET} INTERFACE cxx_std_20)
  endif()
  if(ARG_SOURCES)
    rhec_unite(${TARGET})
  endif()
  if(NOT ARG_INTERNAL)
    set_property(GLOBAL APPEND PROPERTY RHEC_HEADERS_${FLOOR} "${CMAKE_CURRENT_SOURCE_DIR}/include")
    install(DIRECTORY include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT dev)
  endif()
endfunction()

# rhec_write_set_list(SOURCE HEADER set ...): the header of SOURCE with RHEC_FOR_EACH_SET(of), which is `of(<set>)` for each of the
# instruction sets that kernels were compiled for.
function(rhec_write_set_list SOURCE HEADER)
  set(FOLDER "${CMAKE_CURRENT_BINARY_DIR}/sets")
  list(TRANSFORM ARGN REPLACE "(.+)" "of(\\1)" OUTPUT_VARIABLE CALLS)
  list(JOIN CALLS " " CALLS)
  file(CONFIGURE OUTPUT "${FOLDER}/${HEADER}" CONTENT "#pragma once\n\n#define RHEC_FOR_EACH_SET(of) ${CALLS}\n")
  set_source_files_properties("${SOURCE}" PROPERTIES INCLUDE_DIRECTORIES "${FOLDER}")
endfunction()

# rhec_add_objects(FLOOR TARGET): what an object library has compiled becomes part of a floor's library.
function(rhec_add_objects FLOOR TARGET)
  set_property(GLOBAL APPEND PROPERTY RHEC_OBJECTS_${FLOOR} "$<TARGET_OBJECTS:${TARGET}>")
endfunction()

# rhec_add_library(NAME [SOURCES ...] [PUBLIC ...] [PRIVATE ...])
#   A shared library `rhec_<NAME>` with the alias `rhec::<NAME>`: of its rooms, or of sources with headers in
#   <folder>/include.
function(rhec_add_library NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  get_property(OBJECTS GLOBAL PROPERTY RHEC_OBJECTS_${NAME})
  get_property(HEADERS GLOBAL PROPERTY RHEC_HEADERS_${NAME})
  if(ARG_SOURCES)
    list(APPEND HEADERS "${CMAKE_CURRENT_SOURCE_DIR}/include")
    set_property(GLOBAL APPEND PROPERTY RHEC_HEADERS_${NAME} "${CMAKE_CURRENT_SOURCE_DIR}/include")
    install(DIRECTORY include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT dev)
  endif()
  add_library(rhec_${NAME} SHARED ${ARG_SOURCES} ${OBJECTS})
  target_include_directories(rhec_${NAME} PUBLIC
    "$<BUILD_INTERFACE:${HEADERS}>" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  target_link_libraries(rhec_${NAME} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} "$<BUILD_INTERFACE:rhec_flags>")
  rhec_set_up_shared_library(${NAME})
endfunction()

include("${CMAKE_CURRENT_LIST_DIR}/RhecPlugin.cmake")

# rhec_add_plugin(NAME SOURCES ... PRIVATE ...)
#   A plugin that comes with rhec: a module `<NAME>.so` in the plugin directory, built with the flags that all our targets share.
function(rhec_add_plugin NAME)
  rhec_plugin_module(${NAME} ${ARGN})
  target_link_libraries(${NAME} PRIVATE rhec_flags)
  rhec_precompile(${NAME})
  if(NOT RHEC_TESTS_LINK_OBJECTS)
    rhec_unite(${NAME})
  endif()
  file(RELATIVE_PATH LIB_FROM_PLUGINS "${CMAKE_INSTALL_FULL_LIBDIR}/rhec/plugins" "${CMAKE_INSTALL_FULL_LIBDIR}")
  set_target_properties(${NAME} PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/${RHEC_PLUGIN_DIRECTORY}"
    INSTALL_RPATH "$ORIGIN/${LIB_FROM_PLUGINS}")
  set_property(GLOBAL APPEND PROPERTY RHEC_PLUGIN_TARGETS ${NAME})
  install(TARGETS ${NAME} LIBRARY DESTINATION "${RHEC_PLUGIN_DIRECTORY}" COMPONENT rhec)
endfunction()

include("${CMAKE_CURRENT_LIST_DIR}/RhecModel.cmake")
