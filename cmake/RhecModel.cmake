# What a model of one formula is for the build; used by the tree itself and, installed with the package, by outside models.
find_package(xsimd QUIET)
if(NOT xsimd_FOUND)
  message(STATUS "rhec: xsimd was not found (package libxsimd-dev): models evaluate one stage at a time")
endif()

# Instruction sets of this kind of processor that models are also compiled for, slowest first, and what the compiler must be
# told; rhec/core/base/instruction_sets.hpp lists the same, and asks the machine for all of it before it uses them.
set(RHEC_WIDE_SETS "")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(RHEC_WIDE_SETS avx2 avx512)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  set(RHEC_WIDE_SETS neon)
endif()
set(RHEC_WIDE_FLAGS_avx2 -mavx2 -mfma)
set(RHEC_WIDE_FLAGS_avx512 ${RHEC_WIDE_FLAGS_avx2} -mavx512f -mavx512cd -mavx512dq -mavx512bw -mavx512vl)
set(RHEC_WIDE_FLAGS_neon "")  # every compiler for 64-bit ARM takes it for granted

set(RHEC_MODEL_INSTRUCTION_SETS generic ${RHEC_WIDE_SETS} CACHE STRING
  "Instruction sets that models are compiled for; generic is always among them. native: the widest of this machine, to try a model out.")

# rhec_native_set(VARIABLE): the last of RHEC_WIDE_SETS that this machine has; nothing where that cannot be known.
function(rhec_native_set VARIABLE)
  set(${VARIABLE} "" PARENT_SCOPE)
  if(CMAKE_CROSSCOMPILING OR NOT EXISTS /proc/cpuinfo)
    return()
  endif()
  file(STRINGS /proc/cpuinfo FEATURES REGEX "^(flags|Features)[ \t]*:" LIMIT_COUNT 1)
  string(REGEX REPLACE "^[^:]*:" "" FEATURES "${FEATURES}")
  separate_arguments(FEATURES UNIX_COMMAND "${FEATURES}")
  foreach(SET IN LISTS RHEC_WIDE_SETS)
    set(HAS_ALL TRUE)
    foreach(FLAG IN LISTS RHEC_WIDE_FLAGS_${SET})
      string(REGEX REPLACE "^-m" "" FEATURE "${FLAG}")
      if(NOT FEATURE IN_LIST FEATURES)
        set(HAS_ALL FALSE)
      endif()
    endforeach()
    if(HAS_ALL)
      set(${VARIABLE} ${SET} PARENT_SCOPE)
    endif()
  endforeach()
endfunction()

set(RHEC_MODEL_WRITERS "" CACHE PATH
  "When cross-compiling without CMAKE_CROSSCOMPILING_EMULATOR: the folder in which a build for this machine has its programs <model>_write")

# rhec_add_model_kernels(TARGET PREFIX FORMULA_HEADER header FORMULA class_template)
#   Compiles the kernels of a formula into TARGET, for every set of RHEC_MODEL_INSTRUCTION_SETS (without xsimd for the
#   generic one alone), and with them `const rhec::StraightCode& rhec::<PREFIX>_kernels()` that returns them. A
#   program <PREFIX>_write records the formula as a graph, differentiates it, and writes the kernels as C++.
function(rhec_add_model_kernels TARGET PREFIX)
  cmake_parse_arguments(PARSE_ARGV 2 ARG "" "FORMULA_HEADER;FORMULA" "")
  if(NOT ARG_FORMULA_HEADER OR NOT ARG_FORMULA OR ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "The kernels of ${TARGET} are declared with: FORMULA_HEADER <header> FORMULA <class template>")
  endif()
  get_filename_component(HEADER "${ARG_FORMULA_HEADER}" ABSOLUTE)
  set(FOLDER "${CMAKE_CURRENT_BINARY_DIR}/${PREFIX}_kernels")
  set(WANTED ${RHEC_MODEL_INSTRUCTION_SETS})
  if("native" IN_LIST WANTED)
    rhec_native_set(NATIVE)
    list(APPEND WANTED ${NATIVE})
  endif()
  set(UNKNOWN ${WANTED})
  list(REMOVE_ITEM UNKNOWN generic native ${RHEC_WIDE_SETS})
  if(UNKNOWN)
    list(JOIN RHEC_WIDE_SETS ", " KNOWN)
    message(FATAL_ERROR "RHEC_MODEL_INSTRUCTION_SETS: '${UNKNOWN}' is none of those for ${CMAKE_SYSTEM_PROCESSOR}: generic, ${KNOWN}, native")
  endif()
  set(SETS generic)
  foreach(SET IN LISTS RHEC_WIDE_SETS)
    if(xsimd_FOUND AND SET IN_LIST WANTED)
      list(APPEND SETS ${SET})
    endif()
  endforeach()

  file(CONFIGURE OUTPUT "${FOLDER}/write.cpp" CONTENT "\
#include \"rhec/core/model/write_model_code.hpp\"

#include <cstdio>
#include <exception>

#include \"${HEADER}\"

int main(int count, char** arguments) try {
  rhec::write_model_code_to(rhec::trace<${ARG_FORMULA}>(), \"${PREFIX}\", \"${ARG_FORMULA}\",
                            {arguments + 1, arguments + count});
  return 0;
} catch (const std::exception& mistake) {
  std::fprintf(stderr, \"error: the formula ${ARG_FORMULA}: %s\\n\", mistake.what());
  return 1;
}
")
  add_executable(${PREFIX}_write "${FOLDER}/write.cpp")
  target_compile_features(${PREFIX}_write PRIVATE cxx_std_20)
  target_link_libraries(${PREFIX}_write PRIVATE rhec::core)
  if(TARGET rhec_flags)  # a core with sanitizers needs a program with their runtimes
    target_link_options(${PREFIX}_write PRIVATE $<TARGET_PROPERTY:rhec_flags,INTERFACE_LINK_OPTIONS>)
  endif()
  # It runs once: what is optimised away is not worth its time.
  target_compile_options(${PREFIX}_write PRIVATE -O0 -g0)
  set_target_properties(${PREFIX}_write PROPERTIES CXX_EXTENSIONS OFF)
  if(CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR)
    if(NOT RHEC_MODEL_WRITERS)
      message(FATAL_ERROR "The kernels of ${PREFIX} are written by a program that has to run on this machine: set "
        "CMAKE_CROSSCOMPILING_EMULATOR, or RHEC_MODEL_WRITERS to the folder of a build for it")
    endif()
    set(WRITER "${RHEC_MODEL_WRITERS}/${PREFIX}_write")
    set_target_properties(${PREFIX}_write PROPERTIES EXCLUDE_FROM_ALL ON)
  else()
    set(WRITER ${PREFIX}_write)
  endif()
  add_custom_command(OUTPUT "${FOLDER}/kernels.cpp" "${FOLDER}/table.cpp"
    COMMAND ${WRITER} "${FOLDER}" ${SETS}
    DEPENDS ${WRITER} COMMENT "Writing the kernels of ${PREFIX}" VERBATIM)
  # Several libraries are made of one text; one target writes it.
  add_custom_target(${PREFIX}_text DEPENDS "${FOLDER}/kernels.cpp" "${FOLDER}/table.cpp")

  target_sources(${TARGET} PRIVATE "${FOLDER}/table.cpp")
  add_dependencies(${TARGET} ${PREFIX}_text)
  foreach(SET IN LISTS SETS)
    # A copy for each set, for a build system knows a source by its name.
    set(UNIT "${FOLDER}/${SET}.cpp")
    set(PACKS "")
    if(NOT SET STREQUAL "generic")
      set(PACKS "#define RHEC_PACK_NAMESPACE xsimd_${SET}\n")
    endif()
    file(CONFIGURE OUTPUT "${UNIT}" CONTENT "\
#define RHEC_STRAIGHT_SET ${SET}
${PACKS}#include \"kernels.cpp\"
")
    set_source_files_properties("${UNIT}" PROPERTIES OBJECT_DEPENDS "${FOLDER}/kernels.cpp")
    add_library(${PREFIX}_${SET} OBJECT "${UNIT}")
    add_dependencies(${PREFIX}_${SET} ${PREFIX}_text)
    target_compile_features(${PREFIX}_${SET} PRIVATE cxx_std_20)
    target_link_libraries(${PREFIX}_${SET} PRIVATE rhec::core)
    # -O2 in every configuration: what is inlined leaves no copy behind that the linker could take for another unit's.
    # Sums are fused with products where the text says so, and nowhere else.
    target_compile_options(${PREFIX}_${SET} PRIVATE -O2 -g0 ${RHEC_WIDE_FLAGS_${SET}} -ffp-contract=off -fno-math-errno
      -fno-trapping-math -fno-tree-vectorize -Wno-psabi
      "$<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized;-Wno-uninitialized>")  # in gcc's own intrinsics
    set_target_properties(${PREFIX}_${SET} PROPERTIES
      CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON POSITION_INDEPENDENT_CODE ON)
    target_sources(${TARGET} PRIVATE $<TARGET_OBJECTS:${PREFIX}_${SET}>)
    if(NOT SET STREQUAL "generic")
      target_link_libraries(${PREFIX}_${SET} PRIVATE xsimd)
      set_property(GLOBAL APPEND PROPERTY RHEC_WIDE_KERNEL_TARGETS ${PREFIX}_${SET})
    endif()
  endforeach()
endfunction()

# rhec_add_model(NAME SOURCES ... FORMULA_HEADER header FORMULA class_template [PRIVATE ...])
#   The plugin NAME of a model, with the kernels of its formula for the instruction sets: its source declares
#   `const rhec::StraightCode& rhec::<NAME>_kernels()` and hands them to rhec::FormulaModel. The header holds the formula
#   alone, and includes nothing but what that needs.
function(rhec_add_model NAME)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "FORMULA_HEADER;FORMULA" "SOURCES;PRIVATE")
  rhec_add_plugin(${NAME} SOURCES ${ARG_SOURCES} PRIVATE ${ARG_PRIVATE})
  rhec_add_model_kernels(${NAME} ${NAME} FORMULA_HEADER "${ARG_FORMULA_HEADER}" FORMULA ${ARG_FORMULA})
endfunction()
