# What a model of one formula is for the build; used by the tree itself and, installed with the package, by outside models.
find_package(xsimd QUIET)
if(NOT xsimd_FOUND)
  message(STATUS "rhec: xsimd was not found (package libxsimd-dev): models evaluate one stage at a time")
endif()

# Instruction sets that models are also compiled for, and what the compiler must be told; rhec/core/model/formula_model.hpp asks
# the machine for all of it before it uses them.
set(RHEC_WIDE_FLAGS_avx2 -mavx2 -mfma)
set(RHEC_WIDE_FLAGS_avx512 ${RHEC_WIDE_FLAGS_avx2} -mavx512f -mavx512cd -mavx512dq -mavx512bw -mavx512vl)

set(RHEC_MODEL_INSTRUCTION_SETS generic avx2 avx512 CACHE STRING
  "Instruction sets that models are compiled for; generic is always among them. One is enough to try a model out.")

# rhec_add_model_kernels(TARGET PREFIX FORMULA_HEADER header FORMULA class)
#   Compiles the kernels of a formula into TARGET, for every set of RHEC_MODEL_INSTRUCTION_SETS (without xsimd or off x86-64
#   for the generic one alone), and with them a function `rhec::ModelKernelSets <PREFIX>_kernels()` that returns them.
function(rhec_add_model_kernels TARGET PREFIX)
  cmake_parse_arguments(PARSE_ARGV 2 ARG "" "FORMULA_HEADER;FORMULA" "")
  if(NOT ARG_FORMULA_HEADER OR NOT ARG_FORMULA OR ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "The kernels of ${TARGET} are declared with: FORMULA_HEADER <header> FORMULA <class>")
  endif()
  get_filename_component(HEADER "${ARG_FORMULA_HEADER}" ABSOLUTE)
  set(FOLDER "${CMAKE_CURRENT_BINARY_DIR}/${PREFIX}_kernels")
  set(DECLARATIONS "")
  set(MEMBERS ".generic = &generic")
  # In three units, so that who changes a formula does not wait for their sum.
  foreach(KERNELS IN ITEMS dense row hessian_row)
    set(UNIT "${FOLDER}/generic_${KERNELS}.cpp")
    set(TABLE ${PREFIX}_kernels_generic_${KERNELS})
    file(CONFIGURE OUTPUT "${UNIT}" CONTENT "\
#include \"rhec/core/model/kernel_tables.hpp\"

#include \"${HEADER}\"

namespace rhec {
extern const ModelKernels ${TABLE};
constinit const ModelKernels ${TABLE} = make_${KERNELS}_kernels<${ARG_FORMULA}, double>();
}
")
    add_library(${PREFIX}_generic_${KERNELS} OBJECT "${UNIT}")
    target_compile_features(${PREFIX}_generic_${KERNELS} PRIVATE cxx_std_20)
    target_link_libraries(${PREFIX}_generic_${KERNELS} PRIVATE rhec::core $<TARGET_NAME_IF_EXISTS:rhec_flags>)
    set_target_properties(${PREFIX}_generic_${KERNELS} PROPERTIES
      CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON POSITION_INDEPENDENT_CODE ON)
    target_sources(${TARGET} PRIVATE $<TARGET_OBJECTS:${PREFIX}_generic_${KERNELS}>)
    string(APPEND DECLARATIONS "extern const ModelKernels ${TABLE};\n")
  endforeach()
  if(xsimd_FOUND AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
    foreach(SET IN LISTS RHEC_MODEL_INSTRUCTION_SETS)
      if(SET STREQUAL "generic")
        continue()  # in units of its own, above
      elseif(NOT DEFINED RHEC_WIDE_FLAGS_${SET})
        message(FATAL_ERROR "RHEC_MODEL_INSTRUCTION_SETS: '${SET}' is none of generic, avx2, avx512")
      endif()
      set(UNIT "${FOLDER}/${SET}.cpp")
      set(TABLE ${PREFIX}_kernels_${SET})
      file(CONFIGURE OUTPUT "${UNIT}" CONTENT "\
#define RHEC_PACK_NAMESPACE xsimd_${SET}
#include \"rhec/core/model/pack.hpp\"

#include \"${HEADER}\"

namespace rhec {
extern const ModelKernels ${TABLE};
constinit const ModelKernels ${TABLE} = make_model_kernels<${ARG_FORMULA}, WidestPack>();
}
")
      add_library(${PREFIX}_${SET} OBJECT "${UNIT}")
      target_compile_features(${PREFIX}_${SET} PRIVATE cxx_std_20)
      target_link_libraries(${PREFIX}_${SET} PRIVATE rhec::core xsimd $<TARGET_NAME_IF_EXISTS:rhec_flags>)
      # -O3 in every configuration: what is inlined leaves no copy behind that the linker could take for another unit's.
      # Not with sanitizers, whose checks in every line make that take minutes. Without signed zeros the sums of
      # derivatives lose their terms that are always zero.
      target_compile_options(${PREFIX}_${SET} PRIVATE
        $<$<NOT:$<OR:$<BOOL:${RHEC_SANITIZE}>,$<BOOL:${RHEC_SANITIZE_THREADS}>>>:-O3> ${RHEC_WIDE_FLAGS_${SET}} -fno-math-errno -fno-trapping-math
        -fno-signed-zeros -ffp-contract=fast
        "$<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized;-Wno-uninitialized>")  # in gcc's own intrinsics
      set_target_properties(${PREFIX}_${SET} PROPERTIES
        CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON POSITION_INDEPENDENT_CODE ON)
      target_sources(${TARGET} PRIVATE $<TARGET_OBJECTS:${PREFIX}_${SET}>)
      set_property(GLOBAL APPEND PROPERTY RHEC_WIDE_KERNEL_TARGETS ${PREFIX}_${SET})
      string(APPEND DECLARATIONS "extern const ModelKernels ${TABLE};\n")
      list(APPEND MEMBERS ".${SET} = &${TABLE}")
    endforeach()
  endif()
  list(JOIN MEMBERS ", " MEMBERS)
  file(CONFIGURE OUTPUT "${FOLDER}/sets.cpp" CONTENT "\
#include \"rhec/core/model/formula_model.hpp\"

namespace rhec {
${DECLARATIONS}
ModelKernelSets ${PREFIX}_kernels();
ModelKernelSets ${PREFIX}_kernels() {
  static const ModelKernels generic = join(${PREFIX}_kernels_generic_dense, ${PREFIX}_kernels_generic_row,
                                           ${PREFIX}_kernels_generic_hessian_row);
  return {${MEMBERS}};
}
}
")
  target_sources(${TARGET} PRIVATE "${FOLDER}/sets.cpp")
endfunction()

# rhec_add_model(NAME SOURCES ... FORMULA_HEADER header FORMULA class [PRIVATE ...])
#   The plugin NAME of a model, with the kernels of its formula for the instruction sets: its source declares
#   `rhec::ModelKernelSets <NAME>_kernels()` in namespace rhec and hands them to rhec::FormulaModel. The header holds the
#   formula alone, and includes nothing but what that needs.
function(rhec_add_model NAME)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "FORMULA_HEADER;FORMULA" "SOURCES;PRIVATE")
  rhec_add_plugin(${NAME} SOURCES ${ARG_SOURCES} PRIVATE ${ARG_PRIVATE})
  rhec_add_model_kernels(${NAME} ${NAME} FORMULA_HEADER "${ARG_FORMULA_HEADER}" FORMULA ${ARG_FORMULA})
endfunction()
