# What is installed besides the libraries, headers and plugins that cmake/RhecTargets.cmake installs: the command line,
# and the package that `find_package(rhec)` finds. All of it can be moved: paths are relative to where it lies.
include(CMakePackageConfigHelpers)

get_property(RHEC_PLUGIN_TARGETS GLOBAL PROPERTY RHEC_PLUGIN_TARGETS)

if(TARGET rhec_cli)
  file(RELATIVE_PATH RHEC_LIB_FROM_BIN "${CMAKE_INSTALL_FULL_BINDIR}" "${CMAKE_INSTALL_FULL_LIBDIR}")
  set_target_properties(rhec_cli PROPERTIES INSTALL_RPATH "$ORIGIN/${RHEC_LIB_FROM_BIN}")
  install(TARGETS rhec_cli RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
  # Everything that a user runs, and nothing that only developers run.
  add_custom_target(product DEPENDS rhec_cli ${RHEC_PLUGIN_TARGETS})
  if(TARGET sweep_mpi)
    add_dependencies(product sweep_mpi)
  endif()
endif()

set(RHEC_PACKAGE_DIRECTORY "${CMAKE_INSTALL_LIBDIR}/cmake/rhec")
install(EXPORT rhecTargets NAMESPACE rhec:: DESTINATION "${RHEC_PACKAGE_DIRECTORY}")
configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/rhecConfig.cmake.in" "${PROJECT_BINARY_DIR}/rhecConfig.cmake"
  INSTALL_DESTINATION "${RHEC_PACKAGE_DIRECTORY}" PATH_VARS RHEC_PLUGIN_DIRECTORY)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/rhecConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES
  "${PROJECT_BINARY_DIR}/rhecConfig.cmake"
  "${PROJECT_BINARY_DIR}/rhecConfigVersion.cmake"
  "${PROJECT_SOURCE_DIR}/cmake/RhecPlugin.cmake"
  "${PROJECT_SOURCE_DIR}/cmake/RhecModel.cmake"
  DESTINATION "${RHEC_PACKAGE_DIRECTORY}")

install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/" DESTINATION "${CMAKE_INSTALL_DOCDIR}/docs" FILES_MATCHING PATTERN "*.md")
install(FILES "${PROJECT_SOURCE_DIR}/README.md" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/scenarios/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/scenarios" OPTIONAL)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples/logs/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/logs" FILES_MATCHING PATTERN "*.yaml")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples/vehicles/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/vehicles" FILES_MATCHING PATTERN "*.yaml")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/plugins/template/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/template"
  PATTERN build EXCLUDE)
