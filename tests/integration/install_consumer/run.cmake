# cmake [-DBUILD=<build folder of Stridewire>] -DPREFIX=<folder> -DCONSUMERS=<this folder>
#       -DSCRATCH=<folder to overwrite> [-DC=<C compiler>] [-DCXX=<C++ compiler>]
#       [-DNPM=<path of npm>] -P run.cmake
# Builds and runs projects that use a Stridewire installed in PREFIX: a C++ project, a C project,
# and the same C program with the C compiler and pkg-config only. With NPM, also builds a TypeScript
# project, which downloads packages. With BUILD, first installs Stridewire into PREFIX, and then
# builds the C project with an installation that contains only the component `client`.
cmake_minimum_required(VERSION 3.25)

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE output
                  ERROR_VARIABLE output)
  message("${output}")
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " line)
    message(FATAL_ERROR "${line}: failed with ${result}")
  endif()
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
if(BUILD)
  file(REMOVE_RECURSE ${PREFIX})
  run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${PREFIX})
endif()

set(compilers)
foreach(language C CXX)
  if(${language})
    list(APPEND compilers -DCMAKE_${language}_COMPILER=${${language}})
  endif()
endforeach()
foreach(consumer cxx c)
  run(${CMAKE_COMMAND} -G Ninja -S ${CONSUMERS}/${consumer} -B ${SCRATCH}/${consumer}
      -DCMAKE_PREFIX_PATH=${PREFIX} -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF ${compilers})
  run(${CMAKE_COMMAND} --build ${SCRATCH}/${consumer})
  run(${SCRATCH}/${consumer}/install_consumer)
endforeach()
run(${SCRATCH}/c/install_consumer_shared)

# A C program needs neither CMake nor the C++ compiler.
find_program(PKG_CONFIG NAMES pkg-config pkgconf REQUIRED)
file(GLOB_RECURSE package_file ${PREFIX}/*/stridewire-client.pc)
get_filename_component(package_dir ${package_file} DIRECTORY)
get_filename_component(library_dir ${package_dir} DIRECTORY)
set(ENV{PKG_CONFIG_PATH} ${package_dir})
function(pkg_config result)
  execute_process(COMMAND ${PKG_CONFIG} ${ARGN} stridewire-client OUTPUT_VARIABLE output
                  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(output UNIX_COMMAND "${output}")
  set(${result} ${output} PARENT_SCOPE)
endfunction()
if(NOT C)
  set(C cc)
endif()
pkg_config(flags --cflags --libs)
run(${C} ${CONSUMERS}/c/main.c -o ${SCRATCH}/with_pkg_config ${flags} -Wl,-rpath,${library_dir})
run(${SCRATCH}/with_pkg_config)
pkg_config(flags --cflags --libs --static)
# Take the static library, which is in the same folder as the shared one.
list(TRANSFORM flags REPLACE "^-lstridewire-client$" "-l:libstridewire-client.a")
run(${C} ${CONSUMERS}/c/main.c -o ${SCRATCH}/with_pkg_config_static ${flags})
run(${SCRATCH}/with_pkg_config_static)

if(BUILD)
  run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${SCRATCH}/client_only --component client)
  run(${CMAKE_COMMAND} -G Ninja -S ${CONSUMERS}/c -B ${SCRATCH}/c_client_only -DSHARED_ONLY=ON
      -DCMAKE_PREFIX_PATH=${SCRATCH}/client_only -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF ${compilers})
  run(${CMAKE_COMMAND} --build ${SCRATCH}/c_client_only)
  run(${SCRATCH}/c_client_only/install_consumer_shared)
endif()

if(NPM)
  file(GLOB package ${PREFIX}/share/stridewire/npm/stridewire-client-*.tgz)
  if(NOT package)
    message(FATAL_ERROR "${PREFIX}/share/stridewire/npm does not contain the TypeScript client")
  endif()
  file(COPY ${CONSUMERS}/typescript DESTINATION ${SCRATCH})
  run(${NPM} install --prefix ${SCRATCH}/typescript --no-audit --no-fund --loglevel=error
      ${package})
  run(${CMAKE_COMMAND} -E chdir ${SCRATCH}/typescript
      ${NPM} test --silent -- ${PREFIX}/bin/stridewired)
endif()
