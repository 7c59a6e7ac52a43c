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

# stridewire_cold(TARGET [SOURCE...]): code that runs once, or waits for people and networks. -O3 takes two to
# three times as long to compile it and nobody would notice. At -O1 gcc 12 warns of overflows in the
# standard library's own vectors.
set(stridewire_cold_options $<$<CONFIG:Release>:-O1> $<$<CONFIG:Release>:-Wno-stringop-overflow>
                            $<$<CONFIG:Release>:-Wno-array-bounds>)
function(stridewire_cold target)
  if(ARGN)
    set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS ${stridewire_cold_options})
  else()
    target_compile_options(${target} PRIVATE ${stridewire_cold_options})
  endif()
endfunction()

# stridewire_flatbuffers(TARGET SCHEMA...): C++ headers made by flatc at build time, never edited.
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
  target_include_directories(${target} SYSTEM PRIVATE ${generated_dir})
endfunction()
