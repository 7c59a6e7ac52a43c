# A folder whose tests wait for servers rather than compute sets these: a third less to compile.
set(STRIDEWIRE_WAITING_TEST_OPTIONS $<$<NOT:$<CONFIG:Debug>>:-O0>)

# stridewire_test(NAME LABEL <unit|integration|fuzz> SOURCES … APART … LIBRARIES …): a GoogleTest program
# whose tests ctest runs one by one, with that label, compiled together. ALONE: nothing runs beside them; for tests of
# programs that keep time, whose server misses ticks when a sanitizer's other tests take its processor.
# THREADS: what is tested runs in several threads; the thread sanitizer builds and runs no others, in which it could find
# nothing. APART: sources whose local names are those of others.
function(stridewire_test name)
  cmake_parse_arguments(ARG "ALONE;THREADS" "LABEL" "SOURCES;APART;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES} ${ARG_APART})
  set_source_files_properties(${ARG_APART} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} stridewire_core_internal GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    STRIDEWIRE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    STRIDEWIRE_MOCAP_DIR="${PROJECT_SOURCE_DIR}/../shared/mocap")
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support)
  stridewire_target(${name})
  stridewire_cold(${name} COMPUTES)
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${STRIDEWIRE_TOGETHER}
                        UNITY_BUILD_BATCH_SIZE 0)
  target_compile_options(${name} PRIVATE ${STRIDEWIRE_TEST_OPTIONS})
  if(STRIDEWIRE_SANITIZE MATCHES undefined)
    # A check of each pointer that a test follows is two fifths of the time to compile it. What is tested has them all.
    target_compile_options(${name} PRIVATE -fno-sanitize=null,alignment,object-size)
  endif()
  if(STRIDEWIRE_SANITIZE MATCHES thread AND NOT ARG_THREADS)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
                       PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 300 RUN_SERIAL ${ARG_ALONE})
endfunction()
