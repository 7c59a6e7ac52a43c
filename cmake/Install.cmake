# `cmake --install` installs the libraries, their headers, the programs and the package files, with
# which find_package(stridewire) provides stridewire::core, ::offline, ::protocol, ::client and
# ::client_shared. The component `client` contains what programs need that use the shared client
# library: `cmake --install BUILD --component client`.
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/stridewire)

foreach(part core offline protocol client)
  if(TARGET stridewire_${part})
    set_target_properties(stridewire_${part} PROPERTIES EXPORT_NAME ${part})
    install(TARGETS stridewire_${part} EXPORT stridewireTargets
            ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
            LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
            INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  endif()
endforeach()
# The shared client library needs none of the others, so its targets are exported to another file.
install(TARGETS stridewire_client_shared EXPORT stridewireClientSharedTargets
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client
        INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT stridewireClientSharedTargets NAMESPACE stridewire:: DESTINATION ${package_dir}
        COMPONENT client)
install(DIRECTORY core/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")
install(FILES ${PROJECT_BINARY_DIR}/core/include/stridewire/base/version.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/stridewire/base)
install(DIRECTORY ${PROJECT_BINARY_DIR}/protocol/generated/include/
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY protocol/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.h")
install(DIRECTORY client_sdk/c/include/ client_sdk/cpp/include/
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client
        FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")

foreach(program stridewired stridewire-library stridewire-record stridewire-load)
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
endforeach()

# Libraries that the C++ compiler links and the C compiler does not, for projects without C++.
set(STRIDEWIRE_CXX_RUNTIME ${CMAKE_CXX_IMPLICIT_LINK_LIBRARIES})
list(REMOVE_ITEM STRIDEWIRE_CXX_RUNTIME ${CMAKE_C_IMPLICIT_LINK_LIBRARIES})
set(STRIDEWIRE_PC_PRIVATE flatbuffers xxhash hwy ${STRIDEWIRE_CXX_RUNTIME})
list(TRANSFORM STRIDEWIRE_PC_PRIVATE PREPEND "-l")
list(JOIN STRIDEWIRE_PC_PRIVATE " " STRIDEWIRE_PC_PRIVATE)
string(APPEND STRIDEWIRE_PC_PRIVATE " ${CMAKE_THREAD_LIBS_INIT}")
list(TRANSFORM STRIDEWIRE_CXX_RUNTIME REPLACE "(.+)" "$<LINK_ONLY:\\1>")
install(EXPORT stridewireTargets NAMESPACE stridewire:: DESTINATION ${package_dir})
configure_package_config_file(cmake/stridewireConfig.cmake.in
  ${PROJECT_BINARY_DIR}/stridewireConfig.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 any minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/stridewireConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/stridewireConfig.cmake
              ${PROJECT_BINARY_DIR}/stridewireConfigVersion.cmake
        DESTINATION ${package_dir} COMPONENT client)

# pkg-config. The prefix is relative to the file, so that the installed tree can be moved.
file(RELATIVE_PATH up_to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" up_to_prefix "${up_to_prefix}")
set(STRIDEWIRE_PC_PREFIX "\${pcfiledir}/${up_to_prefix}")
configure_file(client_sdk/stridewire-client.pc.in stridewire-client.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/stridewire-client.pc
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT client)

# The C# package needs the shared client library only.
install(DIRECTORY client_sdk/unity/ DESTINATION ${CMAKE_INSTALL_DATADIR}/stridewire/unity
        COMPONENT client)
