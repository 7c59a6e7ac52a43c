# Flags every Stridewire target shares. One call per target keeps the CMake files short.

function(stridewire_target target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow
                         $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>)
  # Designated initialisers leave the rest at its default on purpose; g++ 12 warns all the same.
  target_compile_options(${target} PRIVATE -Wno-missing-field-initializers)
  if(STRIDEWIRE_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  # A fused multiply-add rounds once where two operations round twice; contracted code would give
  # other bytes on machines that have it. Everything that evaluates a movement must agree everywhere.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  if(STRIDEWIRE_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${STRIDEWIRE_SANITIZE}
                           -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${STRIDEWIRE_SANITIZE})
    if(STRIDEWIRE_SANITIZE MATCHES thread)
      # Asio's headers have fences, which gcc's thread sanitizer warns that it does not follow. They
      # order nothing of ours: threads meet only in queues that lock.
      target_compile_options(${target} PRIVATE -Wno-tsan)
    endif()
  endif()
endfunction()

# Sources are compiled several at a time: a half to two thirds of the time to compile one goes to the headers
# of Asio, Beast, FlatBuffers, JSON, Eigen and GoogleTest. OFF compiles only what was edited, and finds headers that a
# source forgot to include.
option(STRIDEWIRE_TOGETHER "Compile several sources as one" ON)

# stridewire_together(TARGET GROUP SOURCE…): gives TARGET sources that are compiled as one. Groups take about as long as
# each other, 5 to 15 s, so that no processor waits for another at the end.
function(stridewire_together target group)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${STRIDEWIRE_TOGETHER} UNITY_BUILD_MODE GROUP)
  list(TRANSFORM ARGN PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  target_sources(${target} PRIVATE ${ARGN})
  set_property(SOURCE ${ARGN} TARGET_DIRECTORY ${target} PROPERTY UNITY_GROUP ${group})
endfunction()

# stridewire_cold(TARGET): code that runs once, or waits for people and networks. -O3 takes two to three times as long
# to compile it and nobody would notice. At -O1 gcc 12 warns of overflows in the standard library's own vectors.
# COMPUTES: under sanitizers, where -O0 is the default of such code, it stays at -O1.
function(stridewire_cold target)
  cmake_parse_arguments(ARG "COMPUTES" "" "" ${ARGN})
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1> $<$<CONFIG:Release>:-Wno-stringop-overflow>
                         $<$<CONFIG:Release>:-Wno-array-bounds>)
  if(STRIDEWIRE_SANITIZE AND NOT ARG_COMPUTES)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# stridewire_cold_part(TARGET): makes TARGET_cold, for those sources of TARGET that are cold; they see what the others
# see. Call it after everything that TARGET links and includes has been said.
function(stridewire_cold_part target)
  add_library(${target}_cold OBJECT)
  foreach(property LINK_LIBRARIES INCLUDE_DIRECTORIES COMPILE_DEFINITIONS)
    get_target_property(value ${target} ${property})
    if(value)
      set_target_properties(${target}_cold PROPERTIES ${property} "${value}")
    endif()
  endforeach()
  target_sources(${target} PRIVATE $<TARGET_OBJECTS:${target}_cold>)
  stridewire_target(${target}_cold)
  stridewire_cold(${target}_cold)
endfunction()

# stridewire_flatbuffers(TARGET SCHEMA...): C++ headers made by flatc at build time, never edited; TARGET_schema makes
# nothing else.
function(stridewire_flatbuffers target)
  set(generated_dir ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(headers)
  foreach(schema IN LISTS ARGN)
    get_filename_component(name ${schema} NAME_WE)
    set(header ${generated_dir}/${name}_generated.h)
    add_custom_command(
      OUTPUT ${header}
      COMMAND ${STRIDEWIRE_FLATC} --cpp --cpp-std c++17 --scoped-enums --gen-mutable
              -o ${generated_dir} ${CMAKE_CURRENT_SOURCE_DIR}/${schema}
      DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${schema}
      VERBATIM)
    list(APPEND headers ${header})
  endforeach()
  target_sources(${target} PRIVATE ${headers})
  add_custom_target(${target}_schema DEPENDS ${headers})
  add_dependencies(${target} ${target}_schema)
  target_include_directories(${target} SYSTEM PRIVATE ${generated_dir})
endfunction()
