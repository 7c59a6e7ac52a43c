# Compiler flags that all targets of Stridewire share.

option(STRIDEWIRE_UNITY_BUILD "Compile several sources as one, which saves a third of the time" ON)

# gold, which Debian's binutils contain, links a program in half the time of the default linker.
# With the sanitizers of clang it prints hundreds of warnings.
include(CheckLinkerFlag)
check_linker_flag(CXX -fuse-ld=gold STRIDEWIRE_HAS_GOLD)

# stridewire_target(TARGET): sets warnings, sanitizers and floating-point rules.
function(stridewire_target target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow
                         $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>)
  # Designated initializers leave other members at their defaults on purpose, but g++ 12 warns.
  target_compile_options(${target} PRIVATE -Wno-missing-field-initializers)
  # __FILE__ is relative to the project, so that clones in other folders share the compiler cache,
  # and programs do not contain the path of the machine that built them.
  target_compile_options(${target} PRIVATE -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
  if(STRIDEWIRE_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(STRIDEWIRE_HAS_GOLD AND NOT STRIDEWIRE_SANITIZE)
    target_link_options(${target} PRIVATE -fuse-ld=gold)
  endif()
  # A fused multiply-add rounds once where a multiplication and an addition round twice. Contracted
  # code would therefore compute other bytes on machines that have it.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  if(STRIDEWIRE_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${STRIDEWIRE_SANITIZE}
                           -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${STRIDEWIRE_SANITIZE})
    if(STRIDEWIRE_SANITIZE MATCHES undefined AND
       NOT target MATCHES "^stridewire_(core|offline|protocol)")
      # In files that include Boost or GoogleTest, checks of each pointer take two fifths of the
      # compilation time. The address sanitizer also finds null pointers. The libraries that read
      # files and messages are compiled with all checks.
      target_compile_options(${target} PRIVATE -fno-sanitize=null,alignment,object-size)
    endif()
    if(STRIDEWIRE_SANITIZE MATCHES thread)
      # The headers of Asio contain fences, which gcc's thread sanitizer does not follow and warns
      # about. Nothing here relies on them: threads share only queues with locks.
      target_compile_options(${target} PRIVATE -Wno-tsan)
    endif()
  endif()
endfunction()

# stridewire_sources(TARGET GROUP SOURCE...): adds sources that form one unit of a unity build. Each
# group takes 5 to 15 s to compile, so that two processors finish at about the same time.
function(stridewire_sources target group)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${STRIDEWIRE_UNITY_BUILD}
                        UNITY_BUILD_MODE GROUP)
  list(TRANSFORM ARGN PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  target_sources(${target} PRIVATE ${ARGN})
  set_property(SOURCE ${ARGN} TARGET_DIRECTORY ${target} PROPERTY UNITY_GROUP ${group})
endfunction()

# stridewire_optimize_less(TARGET): compiles without optimization, also in release builds. For tests
# and for code that runs once: -O3 takes three times as long to compile.
function(stridewire_optimize_less target)
  target_compile_options(${target} PRIVATE $<$<NOT:$<CONFIG:Debug>>:-O0>)
endfunction()

# stridewire_flatbuffers(TARGET SCHEMA...): generates C++ headers from schemas with flatc at build
# time. The target TARGET_schema generates the headers and nothing else.
function(stridewire_flatbuffers target)
  set(generated_dir ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(headers)
  foreach(schema IN LISTS ARGN)
    get_filename_component(name ${schema} NAME_WE)
    get_filename_component(schema ${schema} ABSOLUTE)
    set(header ${generated_dir}/${name}_generated.h)
    add_custom_command(
      OUTPUT ${header}
      COMMAND ${STRIDEWIRE_FLATC} --cpp --cpp-std c++17 --scoped-enums --gen-mutable
              -o ${generated_dir} ${schema}
      DEPENDS ${schema}
      VERBATIM)
    list(APPEND headers ${header})
  endforeach()
  target_sources(${target} PRIVATE ${headers})
  add_custom_target(${target}_schema DEPENDS ${headers})
  add_dependencies(${target} ${target}_schema)
  target_include_directories(${target} SYSTEM PRIVATE ${generated_dir})
endfunction()
