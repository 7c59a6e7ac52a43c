# cmake -DBUILD=<build folder of Stridewire> -DCONSUMERS=<this folder> -DSCRATCH=<folder to
# overwrite>
#       -DC=<C compiler> -DCXX=<C++ compiler> -P run.cmake
# Installs Stridewire into SCRATCH/prefix. Then it configures, builds and runs a C++ and a C project
# that use the installed package.
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
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${SCRATCH}/prefix)
foreach(consumer cxx c)
  run(${CMAKE_COMMAND} -G Ninja -S ${CONSUMERS}/${consumer} -B ${SCRATCH}/${consumer}
      -DCMAKE_PREFIX_PATH=${SCRATCH}/prefix -DCMAKE_C_COMPILER=${C} -DCMAKE_CXX_COMPILER=${CXX}
      -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
  run(${CMAKE_COMMAND} --build ${SCRATCH}/${consumer})
  run(${SCRATCH}/${consumer}/install_consumer)
endforeach()
