# What is installed besides the libraries, headers and plugins that cmake/RhecTargets.cmake installs: the command line,
# and the package that `find_package(rhec)` finds. All of it can be moved: paths are relative to where it lies.
include(CMakePackageConfigHelpers)

get_property(RHEC_PLUGIN_TARGETS GLOBAL PROPERTY RHEC_PLUGIN_TARGETS)

if(TARGET rhec_cli)
  file(RELATIVE_PATH RHEC_LIB_FROM_BIN "${CMAKE_INSTALL_FULL_BINDIR}" "${CMAKE_INSTALL_FULL_LIBDIR}")
  set_target_properties(rhec_cli PROPERTIES INSTALL_RPATH "$ORIGIN/${RHEC_LIB_FROM_BIN}")
  install(TARGETS rhec_cli RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT rhec)
  # Everything that a user runs, and nothing that only developers run.
  add_custom_target(product DEPENDS rhec_cli ${RHEC_PLUGIN_TARGETS})
  if(TARGET sweep_mpi)
    add_dependencies(product sweep_mpi)
  endif()
endif()

set(RHEC_PACKAGE_DIRECTORY "${CMAKE_INSTALL_LIBDIR}/cmake/rhec")
install(EXPORT rhecTargets NAMESPACE rhec:: DESTINATION "${RHEC_PACKAGE_DIRECTORY}" COMPONENT dev)
# They lie in the build tree as in an installation, so that `find_package(rhec)` takes either.
set(RHEC_PACKAGE_HERE "${PROJECT_BINARY_DIR}/${RHEC_PACKAGE_DIRECTORY}")
configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/rhecConfig.cmake.in" "${RHEC_PACKAGE_HERE}/rhecConfig.cmake"
  INSTALL_DESTINATION "${RHEC_PACKAGE_DIRECTORY}" PATH_VARS RHEC_PLUGIN_DIRECTORY)
write_basic_package_version_file("${RHEC_PACKAGE_HERE}/rhecConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
foreach(FILE IN ITEMS RhecPlugin RhecModel)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/${FILE}.cmake" "${RHEC_PACKAGE_HERE}/${FILE}.cmake" COPYONLY)
endforeach()
file(REMOVE "${PROJECT_BINARY_DIR}/rhecConfig.cmake" "${PROJECT_BINARY_DIR}/rhecConfigVersion.cmake")  # of earlier builds: would be found first
export(EXPORT rhecTargets NAMESPACE rhec:: FILE "${RHEC_PACKAGE_HERE}/rhecTargets.cmake")
install(FILES
  "${RHEC_PACKAGE_HERE}/rhecConfig.cmake"
  "${RHEC_PACKAGE_HERE}/rhecConfigVersion.cmake"
  "${RHEC_PACKAGE_HERE}/RhecPlugin.cmake"
  "${RHEC_PACKAGE_HERE}/RhecModel.cmake"
  DESTINATION "${RHEC_PACKAGE_DIRECTORY}" COMPONENT dev)

install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT licence)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/" DESTINATION "${CMAKE_INSTALL_DOCDIR}/docs" COMPONENT rhec FILES_MATCHING PATTERN "*.md")
install(FILES "${PROJECT_SOURCE_DIR}/README.md" DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT rhec)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/scenarios/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/scenarios" COMPONENT rhec OPTIONAL)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples/robot/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/robot" COMPONENT rhec)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples/logs/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/logs" COMPONENT rhec FILES_MATCHING PATTERN "*.yaml")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples/vehicles/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/vehicles" COMPONENT rhec FILES_MATCHING PATTERN "*.yaml")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/plugins/template/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rhec/template" COMPONENT dev
  PATTERN build EXCLUDE)
