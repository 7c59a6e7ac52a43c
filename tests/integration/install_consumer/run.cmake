# cmake [-DBUILD=<build folder of Stridewire>] -DPREFIX=<folder> -DCONSUMERS=<this folder>
#       -DSCRATCH=<folder to overwrite> [-DC=<C compiler>] [-DCXX=<C++ compiler>]
#       [-DNPM=<path of npm>] -P run.cmake
# Builds and runs projects that use a Stridewire installed in PREFIX: a C++ project and a C project,
# and with NPM also a TypeScript project, which downloads packages. With BUILD, it first installs
# Stridewire into PREFIX.
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
