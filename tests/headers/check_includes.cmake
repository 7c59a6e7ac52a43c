# cmake -DROOT=<project> -P check_includes.cmake
# Checks which part of the project may include which other part.
#
#   public headers   may include the standard library, GLM and other public headers, but no Boost,
#                    FlatBuffers or other library that a user of Stridewire does not need
#   components       base <- runtime <- offline; core does not include the protocol; neither the
#                    protocol nor the client includes the server
#   rooms            the folders of a component in a fixed order; files of a room include only this
#                    room and rooms before it
cmake_minimum_required(VERSION 3.25)
set(found 0)
set(failures 0)

# check(DIRECTORY ALLOWED FORBIDDEN REASON): every #include of the files below DIRECTORY must match
# the regular expression ALLOWED and must not match FORBIDDEN. An empty expression means no rule.
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

# check_rooms(DIRECTORY PREFIX ROOM...): checks the rooms of DIRECTORY, listed from bottom to top.
# Sources include a header of a room as "PREFIX<room>/<header>". Each folder must be a listed room.
function(check_rooms directory prefix)
  file(GLOB folders RELATIVE ${ROOT}/${directory} LIST_DIRECTORIES true ${ROOT}/${directory}/*/)
  foreach(folder IN LISTS folders)
    if(IS_DIRECTORY ${ROOT}/${directory}/${folder} AND NOT folder IN_LIST ARGN)
      message(SEND_ERROR "${directory}/${folder} is not in the list of rooms of this test")
      math(EXPR failures "${failures} + 1")
    endif()
  endforeach()
  set(above ${ARGN})
  foreach(room IN LISTS ARGN)
    list(REMOVE_AT above 0)
    if(above)
      list(JOIN above "|" names)
      check(${directory}/${room} "" "^${prefix}(${names})/"
            "a room includes only rooms that are below it")
    endif()
  endforeach()
  set(found ${found} PARENT_SCOPE)
  set(failures ${failures} PARENT_SCOPE)
endfunction()

check_rooms(core/src/runtime "runtime/"
            skeleton terrain library movement pose weights plan avatar)
check_rooms(core/src/offline "offline/" base capture extract build builtin choreography)
check_rooms(server/src "" base net world session app)

if(found EQUAL 0)
  message(FATAL_ERROR "no #include found below ${ROOT}")
endif()
message(STATUS "${found} includes checked, ${failures} wrong")
