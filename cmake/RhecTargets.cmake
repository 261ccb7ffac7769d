# Targets of the house: one function a kind, so that every library and plugin is built alike.

# Flags that every target of ours shares.
add_library(rhec_flags INTERFACE)
target_compile_options(rhec_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual)
# x86-64-v2 is what any field computer of the last decade has; kernels for wider registers are chosen at run time.
if(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
  target_compile_options(rhec_flags INTERFACE -march=x86-64-v2)
endif()
# IEEE semantics stay; only what costs speed and that nobody reads (errno, floating-point traps) goes.
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

# rhec_add_library(NAME FLOOR DIR SOURCES ... PUBLIC ... PRIVATE ...)
#   A shared library `rhec_<NAME>` with the alias `rhec::<NAME>`, headers in <folder>/include.
function(rhec_add_library NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(rhec_${NAME} SHARED ${ARG_SOURCES})
  add_library(rhec::${NAME} ALIAS rhec_${NAME})
  target_include_directories(rhec_${NAME} PUBLIC
    "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
    "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  target_link_libraries(rhec_${NAME} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} "$<BUILD_INTERFACE:rhec_flags>")
  target_compile_features(rhec_${NAME} PUBLIC cxx_std_20)
  set_target_properties(rhec_${NAME} PROPERTIES
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
    EXPORT_NAME ${NAME} INSTALL_RPATH "$ORIGIN")
  install(TARGETS rhec_${NAME} EXPORT rhecTargets LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  install(DIRECTORY include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
endfunction()

include("${CMAKE_CURRENT_LIST_DIR}/RhecPlugin.cmake")

# rhec_add_plugin(NAME SOURCES ... PRIVATE ...)
#   A plugin of the house: a module `<NAME>.so` in the plugin directory, built with the flags that all our targets share.
function(rhec_add_plugin NAME)
  rhec_plugin_module(${NAME} ${ARGN})
  target_link_libraries(${NAME} PRIVATE rhec_flags)
  file(RELATIVE_PATH LIB_FROM_PLUGINS "${CMAKE_INSTALL_FULL_LIBDIR}/rhec/plugins" "${CMAKE_INSTALL_FULL_LIBDIR}")
  set_target_properties(${NAME} PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/${RHEC_PLUGIN_DIRECTORY}"
    INSTALL_RPATH "$ORIGIN/${LIB_FROM_PLUGINS}")
  set_property(GLOBAL APPEND PROPERTY RHEC_PLUGIN_TARGETS ${NAME})
  install(TARGETS ${NAME} LIBRARY DESTINATION "${RHEC_PLUGIN_DIRECTORY}")
endfunction()

include("${CMAKE_CURRENT_LIST_DIR}/RhecModel.cmake")
