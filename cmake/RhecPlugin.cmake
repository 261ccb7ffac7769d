# What a plugin of rhec is for the build; used by the tree itself and, installed with the package, by outside plugins.

# rhec_plugin_module(NAME SOURCES ... PRIVATE ...)
#   A module `<NAME>.so` that links to rhec::plugins and to what it is given, and exports its manifest alone.
function(rhec_plugin_module NAME)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES;PRIVATE")
  if(NOT ARG_SOURCES OR ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "The plugin ${NAME} is declared as: rhec_add_plugin(${NAME} SOURCES <files> [PRIVATE <targets>])")
  endif()
  add_library(${NAME} MODULE ${ARG_SOURCES})
  target_compile_features(${NAME} PRIVATE cxx_std_20)
  target_link_libraries(${NAME} PRIVATE rhec::plugins ${ARG_PRIVATE})
  set_target_properties(${NAME} PROPERTIES
    PREFIX "" CXX_EXTENSIONS OFF CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
endfunction()
