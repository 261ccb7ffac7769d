# The module rhec._rhec, of an rhec that is built beside it or installed.

# rhec_add_python_module(TARGET): the module; pybind11 must have been found.
function(rhec_add_python_module TARGET)
  set(BINDING "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/binding")
  file(GLOB SOURCES CONFIGURE_DEPENDS "${BINDING}/*.cpp")
  pybind11_add_module(${TARGET} MODULE NO_EXTRAS ${SOURCES})
  target_compile_features(${TARGET} PRIVATE cxx_std_20)
  target_compile_definitions(${TARGET} PRIVATE RHEC_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${TARGET} PRIVATE
    rhec::core rhec::plugins rhec::logs_files rhec::sim_check rhec::sim_horizons rhec::sim_maps rhec::sim_study
    rhec::sim_telemetry rhec::sim_tuning fmt::fmt)
  set_target_properties(${TARGET} PROPERTIES
    OUTPUT_NAME _rhec CXX_EXTENSIONS OFF
    UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)  # pybind11's headers take longer than what is written with them
endfunction()
