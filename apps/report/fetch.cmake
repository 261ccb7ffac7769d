# Called at build time: `npm ci` in the folder INTO with copies of FILES, and the stamp INTO/fetched once all is there.
file(REMOVE "${INTO}/fetched")
file(COPY ${FILES} DESTINATION "${INTO}")
execute_process(COMMAND "${NPM}" ci ${OMIT} WORKING_DIRECTORY "${INTO}"
  RESULT_VARIABLE RESULT OUTPUT_VARIABLE OUTPUT ERROR_VARIABLE OUTPUT)
if(NOT RESULT EQUAL 0)
  message(FATAL_ERROR "${OUTPUT}\nrhec report: 'npm ci' ended with ${RESULT}. It needs a network, or npm's cache of an earlier "
    "build; without either ${ADVICE}")
endif()
file(TOUCH "${INTO}/fetched")
