# `cmake --install` installs the libraries, their headers, the programs and the package files, with
# which find_package(stridewire) provides stridewire::core, ::offline, ::protocol and ::client.
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
install(DIRECTORY core/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")
install(FILES ${PROJECT_BINARY_DIR}/core/include/stridewire/base/version.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/stridewire/base)
install(DIRECTORY ${PROJECT_BINARY_DIR}/protocol/generated/include/
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
foreach(include_dir protocol/include client_sdk/c/include client_sdk/cpp/include)
  if(EXISTS ${PROJECT_SOURCE_DIR}/${include_dir})
    install(DIRECTORY ${include_dir}/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
            FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")
  endif()
endforeach()

foreach(program stridewired stridewire-library stridewire-record stridewire-load)
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
endforeach()

# Libraries that the C++ compiler links and the C compiler does not, for projects without C++.
set(STRIDEWIRE_CXX_RUNTIME ${CMAKE_CXX_IMPLICIT_LINK_LIBRARIES})
list(REMOVE_ITEM STRIDEWIRE_CXX_RUNTIME ${CMAKE_C_IMPLICIT_LINK_LIBRARIES})
list(TRANSFORM STRIDEWIRE_CXX_RUNTIME REPLACE "(.+)" "$<LINK_ONLY:\\1>")
install(EXPORT stridewireTargets NAMESPACE stridewire:: DESTINATION ${package_dir})
configure_package_config_file(cmake/stridewireConfig.cmake.in
  ${PROJECT_BINARY_DIR}/stridewireConfig.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 any minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/stridewireConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/stridewireConfig.cmake
              ${PROJECT_BINARY_DIR}/stridewireConfigVersion.cmake
        DESTINATION ${package_dir})
