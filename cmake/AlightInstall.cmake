# `cmake --install` leaves the program, the libraries, the headers, the example rigs and
# scenarios, and a package for find_package(alight).
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/alight)
set(ALIGHT_INSTALL_CONFIG_DIR ${CMAKE_INSTALL_DATADIR}/alight)

get_property(rooms GLOBAL PROPERTY ALIGHT_ROOMS)
list(TRANSFORM rooms PREPEND alight_ OUTPUT_VARIABLE room_targets)
# alight::alight is all of them.
add_library(alight_all INTERFACE)
target_link_libraries(alight_all INTERFACE ${room_targets})
set_target_properties(alight_all PROPERTIES EXPORT_NAME alight)
add_library(alight::alight ALIAS alight_all)

install(TARGETS alight_options alight_daqp alight_mujoco ${room_targets} alight_all
  EXPORT alightTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(TARGET alight)
  install(TARGETS alight RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
install(EXPORT alightTargets NAMESPACE alight:: DESTINATION ${package_dir})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/alight DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h" PATTERN "test" EXCLUDE)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/config/ DESTINATION ${ALIGHT_INSTALL_CONFIG_DIR})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/AlightConfig.cmake.in
  ${PROJECT_BINARY_DIR}/alightConfig.cmake INSTALL_DESTINATION ${package_dir}
  PATH_VARS ALIGHT_INSTALL_CONFIG_DIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/alightConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/alightConfig.cmake
  ${PROJECT_BINARY_DIR}/alightConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindOpenCV.cmake DESTINATION ${package_dir})
