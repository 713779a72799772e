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
# xcalib_export(name description REQUIRES pc... LIBRARIES -l...): the latter are what a static library
# leaves to be linked.
function(xcalib_export name description)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "" "REQUIRES;LIBRARIES")
  install(EXPORT xcalib_${name} NAMESPACE xcalib:: DESTINATION ${to} COMPONENT development
    FILE xcalib_${name}.cmake)
  list(JOIN arg_REQUIRES " " requires)
  set(libraries "")
  if(NOT BUILD_SHARED_LIBS)
    list(JOIN arg_LIBRARIES " " libraries)
  endif()
  configure_file(cmake/pkgconfig.pc.in xcalib_${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/xcalib_${name}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endfunction()

set(hwy_library -lhwy)
if(TARGET xcalib_highway)
  set(hwy_library)
endif()
xcalib_export(register "Registers thermal images to visible ones through depth, frame by frame"
  LIBRARIES ${hwy_library} -pthread -lstdc++ -lm)
if(TARGET xcalib_rig_file)
  xcalib_export(rig_file "Rig files of XCalib" REQUIRES xcalib_register LIBRARIES -lyaml-cpp)
endif()
if(TARGET xcalib_core)
  # Ceres has no pkg-config file that a static library could ask for what it needs.
  xcalib_export(core "Calibrates thermal-visible camera rigs" REQUIRES xcalib_rig_file
    LIBRARIES -lceres -lglog -lopencv_imgproc -lopencv_core)
endif()
