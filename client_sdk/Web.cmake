# The web client and the viewer (npm workspace in this folder), for STRIDEWIRE_BUILD_VIEWER.
# Target web_client builds web/dist, which the viewer's bundle needs.
find_program(STRIDEWIRE_NODE NAMES node nodejs REQUIRED)
find_program(STRIDEWIRE_NPM npm REQUIRED)

# Installs the packages of the lock file, again only when the lock file changes.
set(STRIDEWIRE_NODE_MODULES ${CMAKE_CURRENT_LIST_DIR}/node_modules/.stridewire-stamp)
add_custom_command(OUTPUT ${STRIDEWIRE_NODE_MODULES}
  COMMAND ${STRIDEWIRE_NPM} ci --no-progress --loglevel=error
  COMMAND ${CMAKE_COMMAND} -E touch ${STRIDEWIRE_NODE_MODULES}
  WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR}
  DEPENDS ${CMAKE_CURRENT_LIST_DIR}/package.json ${CMAKE_CURRENT_LIST_DIR}/package-lock.json
          ${CMAKE_CURRENT_LIST_DIR}/web/package.json ${CMAKE_CURRENT_LIST_DIR}/viewer/package.json
  COMMENT "Installing npm packages for the web client"
  VERBATIM)
add_custom_target(web_modules DEPENDS ${STRIDEWIRE_NODE_MODULES})

# stridewire_node_test(NAME LABEL SECONDS ARGUMENTS...): runs a test script with node in the
# caller's folder. A skipped test counts as a failure, because ctest provides everything that the
# test needs.
function(stridewire_node_test name label seconds)
  add_test(NAME ${name} COMMAND ${STRIDEWIRE_NODE} ${ARGN}
           WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  set_tests_properties(${name} PROPERTIES LABELS ${label} TIMEOUT ${seconds}
    FAIL_REGULAR_EXPRESSION " skipped [1-9]")
endfunction()

add_subdirectory(web)
if(EXISTS ${CMAKE_CURRENT_LIST_DIR}/viewer/CMakeLists.txt)
  add_subdirectory(viewer)
endif()
