# cmake --install: libraries, headers and a package configuration, so that another project says
#
#   find_package(effuse 0.1 REQUIRED COMPONENTS geometry flow_sph)
#   target_link_libraries(mine PRIVATE effuse::geometry effuse::flow_sph)
#
# and needs on its machine only the packages those rooms are built on. Which rooms there are and what
# each links is read from the targets themselves: a new room is exported without a word here; a new
# package needs one line in effuse_package_of.

include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(EFFUSE_CONFIG_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/effuse)

# The package an imported target comes from; "" for rooms of ours and for what only the build needs.
function(effuse_package_of target out)
  set(CGAL::CGAL CGAL)
  set(Eigen3::Eigen Eigen3)
  set(TBB::tbb TBB)
  set(fmt::fmt fmt)
  set(fcl fcl)
  set(assimp::assimp assimp)
  set(tomlplusplus::tomlplusplus tomlplusplus)
  set(OpenVDB::openvdb OpenVDB)
  set(embree embree)
  set(PNG::PNG PNG)
  set(OpenEXR::OpenEXR OpenEXR)
  set(ZLIB::ZLIB ZLIB)
  set(Threads::Threads Threads)
  set(nlohmann_json::nlohmann_json nlohmann_json)
  if(target MATCHES "^\\$<BUILD_INTERFACE:.*>$|^effuse_")
    set(${out} "" PARENT_SCOPE)
  elseif(DEFINED ${target})
    set(${out} ${${target}} PARENT_SCOPE)
  else()
    message(FATAL_ERROR "A room links ${target}, and .cmake/install.cmake does not say which package that is: "
                        "add it to effuse_package_of, and its find_package to effuse-config.cmake.in.")
  endif()
endfunction()

# Each room in an export set of its own: who asks for one room is not troubled with the packages of another.
get_property(rooms GLOBAL PROPERTY EFFUSE_ROOMS)
set(EFFUSE_ROOM_NAMES "")
set(EFFUSE_ROOM_NEEDS "")
foreach(target IN LISTS rooms)
  string(REGEX REPLACE "^effuse_" "" room ${target})
  set(needed_rooms "")
  set(packages "")
  get_target_property(links ${target} LINK_LIBRARIES)
  foreach(link IN LISTS links)
    if(link MATCHES "^effuse_")
      string(REGEX REPLACE "^effuse_" "" below ${link})
      if(NOT below IN_LIST EFFUSE_ROOM_NAMES)
        message(FATAL_ERROR "${target} links ${link}, which comes after it: rooms are added from the ground up.")
      endif()
      list(APPEND needed_rooms ${below})
    endif()
    effuse_package_of(${link} package)
    list(APPEND packages ${package})
  endforeach()
  list(REMOVE_DUPLICATES needed_rooms)
  list(REMOVE_DUPLICATES packages)
  list(APPEND EFFUSE_ROOM_NAMES ${room})
  string(APPEND EFFUSE_ROOM_NEEDS
         "set(_effuse_${room}_rooms ${needed_rooms})\nset(_effuse_${room}_packages ${packages})\n")
  install(TARGETS ${target} EXPORT effuse-${room} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT effuse-${room} NAMESPACE effuse:: FILE effuse-${room}.cmake DESTINATION ${EFFUSE_CONFIG_DIR})
endforeach()

# Headers keep their path below the repository's root; *_internal.h are no one else's business.
foreach(folder geometry flow skin importers)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/${folder}/*.h)
  list(FILTER headers EXCLUDE REGEX "_internal\\.h$")
  foreach(header IN LISTS headers)
    cmake_path(GET header PARENT_PATH place)
    install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION include/effuse/${place})
  endforeach()
endforeach()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/effuse-config.cmake.in ${PROJECT_BINARY_DIR}/effuse-config.cmake
                              INSTALL_DESTINATION ${EFFUSE_CONFIG_DIR} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
# Below 1.0 a minor version may change any signature.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/effuse-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/effuse-config.cmake ${PROJECT_BINARY_DIR}/effuse-config-version.cmake
        DESTINATION ${EFFUSE_CONFIG_DIR})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
