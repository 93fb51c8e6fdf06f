# One room of the house: a static library from the folder's sources and, beside it, one
# test program from its test/ folder. New files are picked up without an edit here.

add_library(alight_options INTERFACE)
target_compile_features(alight_options INTERFACE cxx_std_20)
target_include_directories(alight_options INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
# gcc 12 sees overlapping copies inside std::string that are not there (GCC bug 105651).
set(ALIGHT_WARNINGS $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> -Wall -Wextra -Wshadow -Wconversion -Werror)
# Same input, same bits: no contraction into fused operations, no fast-math. Nobody reads
# the flags that floating-point operations raise, nor errno: loops with a comparison in
# them then become vector instructions, with the same results.
set(ALIGHT_FLAGS -ffp-contract=off -fno-trapping-math -fno-math-errno)
if(ALIGHT_SANITIZE)
  list(APPEND ALIGHT_FLAGS -fsanitize=${ALIGHT_SANITIZE} -fno-sanitize-recover=all
    -fno-omit-frame-pointer -D_GLIBCXX_ASSERTIONS)
  target_link_options(alight_options INTERFACE $<BUILD_INTERFACE:-fsanitize=${ALIGHT_SANITIZE}>)
endif()
if(ALIGHT_FUZZ)
  list(APPEND ALIGHT_FLAGS -fsanitize=fuzzer-no-link)
endif()

# alight_module(NAME [PUBLIC targets...] [PRIVATE targets...])
function(alight_module name)
  cmake_parse_arguments(arg "" "" "PUBLIC;PRIVATE" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  if(sources)
    add_library(alight_${name} STATIC ${sources})
    target_link_libraries(alight_${name} PUBLIC alight_options ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
    target_compile_options(alight_${name} PRIVATE ${ALIGHT_WARNINGS} ${ALIGHT_FLAGS})
  else()
    add_library(alight_${name} INTERFACE)
    target_link_libraries(alight_${name} INTERFACE alight_options ${arg_PUBLIC})
  endif()
  add_library(alight::${name} ALIAS alight_${name})
  set_target_properties(alight_${name} PROPERTIES EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY ALIGHT_ROOMS ${name})

  file(GLOB tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/*_test.cpp)
  if(ALIGHT_TESTS AND tests)
    add_executable(${name}_test ${tests})
    target_link_libraries(${name}_test PRIVATE alight::${name} GTest::gtest_main ${arg_PRIVATE})
    target_compile_options(${name}_test PRIVATE ${ALIGHT_WARNINGS} ${ALIGHT_FLAGS})
    target_compile_definitions(${name}_test PRIVATE ALIGHT_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
    include(GoogleTest)
    gtest_discover_tests(${name}_test TEST_PREFIX ${name}. DISCOVERY_TIMEOUT 120)
  endif()
endfunction()
