# Builds build/client.wasm: the runtime of core, the protocol and the session of the C++ client,
# compiled to WebAssembly. It uses the same sources as the native libraries, in the same unity
# groups, except sources that need threads, sockets or files.
find_program(STRIDEWIRE_WASM_CXX clang++-19 REQUIRED)

# Debian's headers for wasm32-wasi must not be mixed with the other headers in /usr/include, so the
# header-only libraries get a separate folder.
set(wasm_dir ${CMAKE_CURRENT_BINARY_DIR}/wasm)
file(MAKE_DIRECTORY ${wasm_dir}/include)
foreach(header glm hwy flatbuffers xxhash.h xxh3.h)
  find_path(wasm_${header}_dir ${header} REQUIRED NO_CACHE)
  file(CREATE_LINK ${wasm_${header}_dir}/${header} ${wasm_dir}/include/${header} SYMBOLIC)
endforeach()
find_path(wasm_eigen_dir Eigen PATH_SUFFIXES eigen3 REQUIRED NO_CACHE)
file(CREATE_LINK ${wasm_eigen_dir}/Eigen ${wasm_dir}/include/Eigen SYMBOLIC)

set(wasm_flags --target=wasm32-wasi -std=c++23 -O3 -DNDEBUG -DXXH_INLINE_ALL -msimd128
    -mbulk-memory -mnontrapping-fptoint
    -fno-exceptions -fno-rtti -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/= -ffp-contract=off
    -fvisibility=hidden -Wall -Wextra -Wshadow
    -Wno-missing-field-initializers -Wno-missing-designated-field-initializers
    $<$<BOOL:${STRIDEWIRE_WARNINGS_AS_ERRORS}>:-Werror>
    -I${PROJECT_SOURCE_DIR}/core/include -I${PROJECT_SOURCE_DIR}/core/src
    -I${PROJECT_BINARY_DIR}/core/include -isystem ${PROJECT_BINARY_DIR}/core/generated
    -I${PROJECT_SOURCE_DIR}/protocol/include -I${PROJECT_SOURCE_DIR}/protocol/src
    -isystem ${PROJECT_BINARY_DIR}/protocol/generated
    -I${PROJECT_BINARY_DIR}/protocol/generated/include
    -I${PROJECT_SOURCE_DIR}/client_sdk/c/include -I${PROJECT_SOURCE_DIR}/client_sdk/src
    -I${PROJECT_SOURCE_DIR}/client_sdk/src/replica
    -isystem ${wasm_dir}/include)

# stridewire_wasm_object(NAME FILE FLAG...): compiles a file.
set(wasm_objects)
function(stridewire_wasm_object name file)
  set(object ${wasm_dir}/${name}.o)
  add_custom_command(OUTPUT ${object}
    COMMAND ${CMAKE_CXX_COMPILER_LAUNCHER} ${STRIDEWIRE_WASM_CXX} ${wasm_flags} ${ARGN}
            -MD -MF ${object}.d -c ${file} -o ${object}
    DEPENDS ${file} stridewire_core_schema stridewire_protocol_schema
    DEPFILE ${object}.d
    COMMENT "Compiling ${name} to WebAssembly"
    COMMAND_EXPAND_LISTS VERBATIM)
  set(wasm_objects ${wasm_objects} ${object} PARENT_SCOPE)
endfunction()

set(wasm_left_out network_thread.cpp client.cpp client_commands.cpp client_poses.cpp
    library_task.cpp)
foreach(target core protocol client)
  get_target_property(sources stridewire_${target} SOURCES)
  get_target_property(folder stridewire_${target} SOURCE_DIR)
  set(groups)
  foreach(source IN LISTS sources)
    cmake_path(GET source FILENAME name)
    if(NOT source MATCHES "\\.cpp$" OR name IN_LIST wasm_left_out)
      continue()
    endif()
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
    get_source_file_property(group ${source} TARGET_DIRECTORY stridewire_${target} UNITY_GROUP)
    if(group)
      list(APPEND groups ${group})
      list(APPEND group_${target}_${group} ${source})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES groups)
  foreach(group IN LISTS groups)
    list(TRANSFORM group_${target}_${group} REPLACE "(.+)" "#include \"\\1\"\n"
         OUTPUT_VARIABLE text)
    list(JOIN text "" text)
    file(CONFIGURE OUTPUT ${wasm_dir}/${target}_${group}.cpp CONTENT "${text}" @ONLY)
    stridewire_wasm_object(${target}_${group} ${wasm_dir}/${target}_${group}.cpp)
  endforeach()
endforeach()
stridewire_wasm_object(replica_set ${PROJECT_SOURCE_DIR}/client_sdk/src/replica/replica_set.cpp)
stridewire_wasm_object(client_module ${CMAKE_CURRENT_SOURCE_DIR}/wasm/client_module.cpp)
stridewire_wasm_object(interpolate_kernel
  ${PROJECT_SOURCE_DIR}/client_sdk/src/interpolate_kernel.cpp)
stridewire_wasm_object(compact_kernel ${PROJECT_SOURCE_DIR}/protocol/src/compact_kernel.cpp)
stridewire_wasm_object(quantise_kernel ${PROJECT_SOURCE_DIR}/protocol/src/quantise_kernel.cpp)
stridewire_wasm_object(pose_kernels ${PROJECT_SOURCE_DIR}/core/src/runtime/pose/pose_kernels.cpp)

# The stack is at the start of the memory, so a stack overflow stops the module instead of
# overwriting data. With an option -O, clang would also run wasm-opt where that program is
# installed, and the module would depend on the machine.
set(web_wasm ${CMAKE_CURRENT_SOURCE_DIR}/build/client.wasm)
add_custom_command(OUTPUT ${web_wasm}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_CURRENT_SOURCE_DIR}/build
  COMMAND ${STRIDEWIRE_WASM_CXX} --target=wasm32-wasi -mexec-model=reactor -fno-exceptions
          -Wl,--gc-sections,--strip-all,--stack-first,-z,stack-size=1048576
          ${wasm_objects} -o ${web_wasm}
  DEPENDS ${wasm_objects}
  COMMENT "Linking client.wasm"
  VERBATIM)
add_custom_target(web_wasm DEPENDS ${web_wasm})
