# stridewire_test(NAME [THREADS] [RUN_SERIAL] LABEL <unit|integration|fuzz> SOURCES source...
#                 [SKIP_UNITY_BUILD source...] LIBRARIES library...)
#
# Adds a GoogleTest program whose tests ctest runs one by one. With sanitizers, ctest runs each half
# of the tests in one process, because starting a process and generating the library take up to
# three seconds. GTEST_FILTER then selects tests.
#   THREADS            the code under test has several threads: also built for the thread sanitizer
#   RUN_SERIAL         no other test runs at the same time
#   SKIP_UNITY_BUILD   sources whose local names clash with those of other sources
function(stridewire_test name)
  cmake_parse_arguments(ARG "RUN_SERIAL;THREADS" "LABEL" "SOURCES;SKIP_UNITY_BUILD;LIBRARIES"
                        ${ARGN})
  add_executable(${name} ${ARG_SOURCES} ${ARG_SKIP_UNITY_BUILD})
  set_source_files_properties(${ARG_SKIP_UNITY_BUILD} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} test_support stridewire_core_internal
                        GTest::gtest GTest::gmock GTest::gtest_main)
  stridewire_target(${name})
  stridewire_optimize_less(${name})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${STRIDEWIRE_UNITY_BUILD}
                        UNITY_BUILD_BATCH_SIZE 0)
  if(STRIDEWIRE_SANITIZE MATCHES thread AND NOT ARG_THREADS)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  if(STRIDEWIRE_SANITIZE)
    foreach(half IN ITEMS 0 1)
      add_test(NAME ${name}.${half} COMMAND ${name})
      set_tests_properties(${name}.${half} PROPERTIES
        LABELS ${ARG_LABEL} TIMEOUT 1200 RUN_SERIAL ${ARG_RUN_SERIAL}
        ENVIRONMENT "GTEST_TOTAL_SHARDS=2;GTEST_SHARD_INDEX=${half}")
    endforeach()
    return()
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
                       PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 300 RUN_SERIAL ${ARG_RUN_SERIAL})
endfunction()
