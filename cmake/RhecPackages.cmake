# Debian packages by cpack; scripts/package builds them, and tries them in a clean root. A component of what is installed is a
# package: rhec what is run, dev what is built against, python `import rhec`, ros the node for ROS 2, where that is built.
#
#   rhec          the program, its libraries and plugins, scenarios, documents
#   librhec-dev   headers, the CMake package, plugins/template
#   python3-rhec  the Python package
#   rhec-ros      the node
set(RHEC_MAINTAINER "the rhec authors <rhec@localhost.localdomain>" CACHE STRING
  "Who is named as the maintainer of Debian packages: a name, and an address that is read")

# Documents that Debian's packages have. The date of a package is SOURCE_DATE_EPOCH's, where that is set.
set(RHEC_PACKAGE_REVISION 1)
string(TIMESTAMP RHEC_PACKAGE_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(DOCUMENTS "${PROJECT_BINARY_DIR}/packaging")
configure_file("${PROJECT_SOURCE_DIR}/packaging/changelog.in" "${DOCUMENTS}/changelog.Debian" @ONLY)
configure_file("${PROJECT_SOURCE_DIR}/CHANGELOG.md" "${DOCUMENTS}/changelog" COPYONLY)
find_program(RHEC_GZIP gzip)
if(RHEC_GZIP)
  foreach(NAME IN ITEMS changelog changelog.Debian)
    execute_process(COMMAND "${RHEC_GZIP}" -9 --no-name --force --keep "${DOCUMENTS}/${NAME}" COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_PACKAGE_VENDOR "the rhec authors")
set(CPACK_PACKAGE_CONTACT "${RHEC_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${RHEC_MAINTAINER}")
set(CPACK_PACKAGING_INSTALL_PREFIX "/usr")
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_PACKAGE_RELEASE ${RHEC_PACKAGE_REVISION})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
# Libraries of other packages are found by dpkg-shlibdeps; those of our own package are looked for where they were built.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS "${CMAKE_LIBRARY_OUTPUT_DIRECTORY}")
set(RHEC_THIS_VERSION "${PROJECT_VERSION}-${RHEC_PACKAGE_REVISION}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each component's begins with its own

get_cmake_property(KNOWN COMPONENTS)
set(CPACK_COMPONENTS_ALL rhec dev)
foreach(COMPONENT IN ITEMS python ros)
  if(COMPONENT IN_LIST KNOWN)
    list(APPEND CPACK_COMPONENTS_ALL ${COMPONENT})
  endif()
endforeach()

set(CPACK_DEBIAN_RHEC_PACKAGE_NAME rhec)
set(CPACK_DEBIAN_RHEC_PACKAGE_SECTION science)
# Which package a library is in, and that the loader's cache is to be renewed. (cpack would do so by scripts.)
get_property(LIBRARIES GLOBAL PROPERTY RHEC_SHARED_LIBRARIES)
list(TRANSFORM LIBRARIES APPEND " ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} rhec (= ${RHEC_THIS_VERSION})\n" OUTPUT_VARIABLE SHLIBS)
list(JOIN SHLIBS "" SHLIBS)
file(CONFIGURE OUTPUT "${DOCUMENTS}/shlibs" CONTENT "${SHLIBS}")
file(CONFIGURE OUTPUT "${DOCUMENTS}/triggers" CONTENT "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_RHEC_PACKAGE_CONTROL_EXTRA "${DOCUMENTS}/shlibs;${DOCUMENTS}/triggers")
set(CPACK_COMPONENT_RHEC_DESCRIPTION "receding horizon estimation and control of field robots that slip
rhec estimates how much the wheels of a field robot slip, and steers the robot
along a path with what it has learned. This package has the command line, the
libraries and the plugins: vehicle models, priors, blocking strategies, terms
and solvers.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME librhec-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "rhec (= ${RHEC_THIS_VERSION}), libeigen3-dev, libfmt-dev, libxsimd-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "cmake, g++")
set(CPACK_COMPONENT_DEV_DESCRIPTION "headers of rhec, for robots and plugins
What programs and plugins are built with that use rhec, a framework for
receding horizon estimation and control: headers, the CMake package and a
project with plugins to begin with.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-rhec)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
get_property(PYTHON GLOBAL PROPERTY RHEC_PYTHON_VERSION)  # the module is for this one, and not for the next
if(PYTHON MATCHES "^([0-9]+)[.]([0-9]+)$")
  math(EXPR NEXT "${CMAKE_MATCH_2} + 1")
  set(PYTHON "python3 (>= ${PYTHON}), python3 (<< ${CMAKE_MATCH_1}.${NEXT})")
endif()
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "rhec (= ${RHEC_THIS_VERSION}), ${PYTHON}, python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-sympy, python3-pandas, librhec-dev")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "rhec from Python
The same as the command line and the library of rhec, a framework for receding
horizon estimation and control, from Python: robots sample by sample, runs,
recorded drives, sweeps, tuning and problems. Results are arrays of numpy.")

set(CPACK_DEBIAN_ROS_PACKAGE_NAME rhec-ros)
set(CPACK_DEBIAN_ROS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_ROS_PACKAGE_DEPENDS "rhec (= ${RHEC_THIS_VERSION})")
set(CPACK_COMPONENT_ROS_DESCRIPTION "rhec as a node of ROS 2
The estimator and the controller of rhec, a framework for receding horizon
estimation and control, live: \`rhec ros\` is a node of ROS 2 on Cyclone DDS that
hears a robot's sensors and steers it, or a simulated robot. ROS itself is not
needed.")

# What each package has in /usr/share/doc, and why lintian is to overlook what it has found.
foreach(COMPONENT IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${COMPONENT} NAME)
  set(PACKAGE ${CPACK_DEBIAN_${NAME}_PACKAGE_NAME})
  set(PLACE "${CMAKE_INSTALL_DATADIR}/doc/${PACKAGE}")
  install(FILES "${PROJECT_SOURCE_DIR}/packaging/copyright" DESTINATION "${PLACE}" COMPONENT ${COMPONENT})
  install(FILES "${DOCUMENTS}/changelog.gz" "${DOCUMENTS}/changelog.Debian.gz" DESTINATION "${PLACE}" COMPONENT ${COMPONENT} OPTIONAL)
  set(OVERRIDES "${PROJECT_SOURCE_DIR}/packaging/${PACKAGE}.lintian-overrides")
  if(EXISTS "${OVERRIDES}")
    install(FILES "${OVERRIDES}" DESTINATION "${CMAKE_INSTALL_DATADIR}/lintian/overrides" RENAME ${PACKAGE} COMPONENT ${COMPONENT})
  endif()
endforeach()

# The terms of what is compiled in, as the packages of these headers have them.
set(EMBEDDED_RHEC libeigen3-dev libfmt-dev libxsimd-dev libcli11-dev nlohmann-json3-dev)
set(EMBEDDED_PYTHON pybind11-dev)
set(EMBEDDED_ROS libeigen3-dev libfmt-dev)
foreach(NAME IN ITEMS RHEC PYTHON ROS)
  string(TOLOWER ${NAME} COMPONENT)
  foreach(PACKAGE IN LISTS EMBEDDED_${NAME})
    if(COMPONENT IN_LIST CPACK_COMPONENTS_ALL AND EXISTS "/usr/share/doc/${PACKAGE}/copyright")
      install(FILES "/usr/share/doc/${PACKAGE}/copyright"
        DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${NAME}_PACKAGE_NAME}/embedded" RENAME "${PACKAGE}" COMPONENT ${COMPONENT})
    endif()
  endforeach()
endforeach()

include(CPack)
