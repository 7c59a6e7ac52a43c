# cmake -DROOT=<project> -P check_includes.cmake: which part of the project may include what.
#
#   public headers   the standard library, GLM and other public headers; never Boost, FlatBuffers or
#                    any other library that stays hidden
#   base <- runtime <- offline; protocol and client never include the server, nor core the protocol
cmake_minimum_required(VERSION 3.25)
set(found 0)
set(failures 0)

# Every #include of the files below DIRECTORY has to match ALLOWED and not FORBIDDEN (regexes; empty: no rule).
function(check directory allowed forbidden reason)
  file(GLOB_RECURSE files
       ${ROOT}/${directory}/*.h ${ROOT}/${directory}/*.hpp ${ROOT}/${directory}/*.cpp)
  foreach(file IN LISTS files)
    file(STRINGS ${file} includes REGEX "^[ \t]*#[ \t]*include[ \t]*[<\"]")
    foreach(line IN LISTS includes)
      string(REGEX REPLACE "^[^<\"]*[<\"]([^>\"]*)[>\"].*$" "\\1" name "${line}")
      math(EXPR found "${found} + 1")
      if((allowed AND NOT name MATCHES "${allowed}") OR (forbidden AND name MATCHES "${forbidden}"))
        file(RELATIVE_PATH relative ${ROOT} ${file})
        message(SEND_ERROR "${relative} includes ${name}: ${reason}")
        math(EXPR failures "${failures} + 1")
      endif()
    endforeach()
  endforeach()
  set(found ${found} PARENT_SCOPE)
  set(failures ${failures} PARENT_SCOPE)
endfunction()

set(public "^(stridewire/.*|glm/.*|[a-z_0-9]+(\\.h)?)$")
set(reason "public headers take only the standard library, GLM and one another")
check(core/include "${public}" "" "${reason}")
check(protocol/include "${public}" "" "${reason}")
check(client_sdk/c/include "${public}" "" "${reason}")
check(client_sdk/cpp/include "${public}" "" "${reason}")

set(reason "dependencies point one way")
set(above_core "^stridewire/((protocol|server)/|client)|^boost/|^spdlog/")
foreach(kind include/stridewire src)
  check(core/${kind}/base "" "^stridewire/(runtime|offline)/|${above_core}" "${reason}")
  check(core/${kind}/runtime "" "^stridewire/offline/|${above_core}" "${reason}")
  check(core/${kind}/offline "" "${above_core}" "${reason}")
endforeach()
check(protocol/include "" "^stridewire/((runtime|offline|server)/|client)" "${reason}")
check(protocol/src "" "^stridewire/((runtime|offline|server)/|client)" "${reason}")
check(client_sdk "" "^stridewire/server/" "${reason}")
foreach(kind c cpp src samples)  # Its tools may: stridewire-record writes BVH.
  check(client_sdk/${kind} "" "^stridewire/offline/" "${reason}")
endforeach()

if(found EQUAL 0)
  message(FATAL_ERROR "found no #include at all below ${ROOT}")
endif()
message(STATUS "${found} includes looked at, ${failures} wrong")
