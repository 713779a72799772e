# What is installed, used as its users do: by find_package, and by pkg-config from C.
set(prefix ${CMAKE_CURRENT_BINARY_DIR}/prefix)
add_test(NAME install COMMAND ${CMAKE_COMMAND} --install ${PROJECT_BINARY_DIR} --prefix ${prefix})
set_tests_properties(install PROPERTIES FIXTURES_SETUP installed)

# Where a program for AVX2 runs here: the tests of structures that must not depend on a user's flags.
set(AVX2_RUNS OFF)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$" AND NOT CMAKE_CROSSCOMPILING)
  include(CheckCXXSourceRuns)
  check_cxx_source_runs(
    "int main() { return __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") ? 0 : 1; }"
    XCALIB_AVX2_RUNS)
  if(XCALIB_AVX2_RUNS)
    set(AVX2_RUNS ON)
  endif()
endif()

# installed_project(name folder): builds a project against the prefix and runs its tests.
function(installed_project name folder)
  add_test(NAME ${name} COMMAND ${CMAKE_CTEST_COMMAND}
    --build-and-test ${folder} ${CMAKE_CURRENT_BINARY_DIR}/${name}
    --build-generator ${CMAKE_GENERATOR}
    --build-options -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_TOOLCHAIN_FILE=${CMAKE_TOOLCHAIN_FILE}
    -DCMAKE_BUILD_TYPE=Release -DAVX2_RUNS=${AVX2_RUNS} -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF -Wno-dev
    --test-command ${CMAKE_CTEST_COMMAND} --output-on-failure)
  set_tests_properties(${name} PROPERTIES FIXTURES_REQUIRED installed)
endfunction()

installed_project(install_examples ${PROJECT_SOURCE_DIR}/examples)
if(AVX2_RUNS)
  installed_project(install_abi ${PROJECT_SOURCE_DIR}/tests/install/abi)
endif()
installed_project(install_c ${PROJECT_SOURCE_DIR}/tests/install/c)
if(TARGET xcalib::core)
  installed_project(install_core ${PROJECT_SOURCE_DIR}/tests/install/core)
endif()

enable_language(C)
add_test(NAME install_pkg_config COMMAND sh ${PROJECT_SOURCE_DIR}/tests/install/pkg_config.sh
  ${prefix} ${CMAKE_INSTALL_LIBDIR} ${PROJECT_SOURCE_DIR}/examples/register_frame.c
  ${CMAKE_C_COMPILER} ${CMAKE_CROSSCOMPILING_EMULATOR})
set_tests_properties(install_pkg_config PROPERTIES FIXTURES_REQUIRED installed)

add_test(NAME install_links_little COMMAND sh ${PROJECT_SOURCE_DIR}/tests/install/links_little.sh
  $<TARGET_FILE:xcalib_register> ${CMAKE_READELF} ${CMAKE_NM})
