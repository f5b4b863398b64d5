# SPDX-License-Identifier: GPL-3.0-or-later
find_program(INTERGLOW_MOLD mold)
add_library(interglow_options INTERFACE)
target_compile_options(interglow_options INTERFACE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion
  -Wno-restrict  # GCC 12 warns falsely on std::string + (GCC bug 105329)
  $<$<BOOL:${INTERGLOW_WARNINGS_AS_ERRORS}>:-Werror>)
if(INTERGLOW_SANITIZE)
  target_compile_options(interglow_options INTERFACE -fsanitize=${INTERGLOW_SANITIZE} -fno-omit-frame-pointer -g)
  target_link_options(interglow_options INTERFACE -fsanitize=${INTERGLOW_SANITIZE})
endif()
if(INTERGLOW_MOLD)
  target_link_options(interglow_options INTERFACE -fuse-ld=mold)
endif()

# interglow_library(radiosity SOURCES a.cpp ... HEADERS a.h ... PUBLIC lib ... PRIVATE lib ...)
# One static library a folder, interglow_radiosity, alias interglow::radiosity; headers are included from the root.
function(interglow_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  set(target interglow_${name})
  add_library(${target} STATIC ${arg_SOURCES} ${arg_HEADERS})
  add_library(interglow::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON LINKER_LANGUAGE CXX)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/interglow>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:interglow_options>)
  install(TARGETS ${target} EXPORT interglowTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(FILES ${arg_HEADERS} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/interglow/${name})
endfunction()

# interglow_test(radiosity SOURCES form_factor_test.cpp ... LIBRARIES interglow::radiosity ...)
# One GoogleTest program a folder. INTERGLOW_TEST_DATA is tests/data; INTERGLOW_SHARED_DATA is ../shared/data,
# which a stranger's clone lacks: tests that need it skip with a message. LABEL slow: for tests of more than some seconds.
function(interglow_test name)
  cmake_parse_arguments(arg "" "LABEL" "SOURCES;LIBRARIES" ${ARGN})
  set(target ${name}_test)
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE ${arg_LIBRARIES} interglow_options GTest::gtest_main GTest::gmock)
  target_compile_definitions(${target} PRIVATE
    INTERGLOW_TEST_DATA="${CMAKE_SOURCE_DIR}/tests/data"
    INTERGLOW_SHARED_DATA="${CMAKE_SOURCE_DIR}/../shared/data")
  include(GoogleTest)
  gtest_discover_tests(${target} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600 LABELS "${arg_LABEL}")
endfunction()
