# What lies beside the libraries in a prefix: find_package(xcalib), and pkg-config's files.
include(CMakePackageConfigHelpers)
set(to ${CMAKE_INSTALL_LIBDIR}/cmake/xcalib)
configure_package_config_file(cmake/xcalibConfig.cmake.in xcalibConfig.cmake
  INSTALL_DESTINATION ${to})
# Before 1.0 a minor version may change what is there.
write_basic_package_version_file(xcalibConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/xcalibConfig.cmake
  ${PROJECT_BINARY_DIR}/xcalibConfigVersion.cmake
  DESTINATION ${to} COMPONENT development)

file(RELATIVE_PATH to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" to_prefix ${to_prefix})
# xcalib_pkgconfig(name description REQUIRES pc... LIBRARIES -l...): the latter are what a static
# library leaves to be linked.
function(xcalib_pkgconfig name description)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "" "REQUIRES;LIBRARIES")
  list(JOIN arg_REQUIRES " " requires)
  set(libraries "")
  if(NOT BUILD_SHARED_LIBS)
    list(JOIN arg_LIBRARIES " " libraries)
  endif()
  configure_file(cmake/pkgconfig.pc.in xcalib_${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/xcalib_${name}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endfunction()

foreach(name IN ITEMS register rig_file core stream)
  if(TARGET xcalib_${name})
    install(EXPORT xcalib_${name} NAMESPACE xcalib:: DESTINATION ${to} COMPONENT development
      FILE xcalib_${name}.cmake)
  endif()
endforeach()
set(hwy_library -lhwy)
if(TARGET xcalib_highway)
  set(hwy_library)
endif()
xcalib_pkgconfig(register "Registers thermal images to visible ones through depth, frame by frame"
  LIBRARIES ${hwy_library} -pthread -lstdc++ -lm)
if(TARGET xcalib_rig_file)
  xcalib_pkgconfig(rig_file "Rig files of XCalib" REQUIRES xcalib_register LIBRARIES -lyaml-cpp)
endif()
if(TARGET xcalib_core AND BUILD_SHARED_LIBS)
  # Of what a static Ceres needs in turn, only CMake is told.
  xcalib_pkgconfig(core "Calibrates thermal-visible camera rigs" REQUIRES xcalib_rig_file eigen3)
  xcalib_pkgconfig(stream "Registers streams of thermal-visible frames" REQUIRES xcalib_core)
endif()
