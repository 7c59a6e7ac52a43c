# stridewire_test(NAME LABEL <unit|integration|fuzz> SOURCES … LIBRARIES …): a GoogleTest program
# whose tests ctest runs one by one, with that label. ALONE: nothing runs beside them; for tests of
# programs that keep time, whose server misses ticks when a sanitizer's other tests take its processor.
function(stridewire_test name)
  cmake_parse_arguments(ARG "ALONE" "LABEL" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    STRIDEWIRE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    STRIDEWIRE_MOCAP_DIR="${PROJECT_SOURCE_DIR}/../shared/mocap")
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support)
  stridewire_target(${name})
  stridewire_cold(${name})
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
                       PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 300 RUN_SERIAL ${ARG_ALONE})
endfunction()
