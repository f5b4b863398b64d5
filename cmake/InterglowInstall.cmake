# SPDX-License-Identifier: GPL-3.0-or-later
# The package that find_package(interglow) finds; targets and headers are installed where they are defined.
include(CMakePackageConfigHelpers)
set(INTERGLOW_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/interglow)
set(INTERGLOW_TABLES_DIR ${CMAKE_INSTALL_DATADIR}/interglow/tables)
configure_package_config_file(cmake/interglowConfig.cmake.in ${CMAKE_BINARY_DIR}/interglowConfig.cmake
  INSTALL_DESTINATION ${INTERGLOW_CMAKE_DIR} PATH_VARS INTERGLOW_TABLES_DIR)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/interglowConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/interglowConfig.cmake ${CMAKE_BINARY_DIR}/interglowConfigVersion.cmake
  cmake/InterglowDependencies.cmake DESTINATION ${INTERGLOW_CMAKE_DIR})
install(EXPORT interglowTargets NAMESPACE interglow:: DESTINATION ${INTERGLOW_CMAKE_DIR})
