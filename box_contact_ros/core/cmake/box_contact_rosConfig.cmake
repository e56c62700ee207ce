# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# find_package(box_contact_ros) for what pip and colcon install: box_contact_ros::box_contact.
#
# This file is in the Python package beside the library, and again in PREFIX/share/box_contact_ros,
# where CMake looks for it below a prefix.
if(NOT TARGET box_contact_ros::box_contact)
  get_filename_component(_box_contact_here "${CMAKE_CURRENT_LIST_FILE}" REALPATH)
  get_filename_component(_box_contact_here "${_box_contact_here}" DIRECTORY)
  get_filename_component(_box_contact_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
  file(GLOB _box_contact_cores
       "${_box_contact_prefix}/lib*/python3*/*-packages/box_contact_ros/core"
       "${_box_contact_prefix}/local/lib*/python3*/*-packages/box_contact_ros/core")
  foreach(_box_contact_core IN ITEMS "${_box_contact_here}/.." LISTS _box_contact_cores)
    get_filename_component(_box_contact_core "${_box_contact_core}" ABSOLUTE)
    if(EXISTS "${_box_contact_core}/libbox_contact.so" AND NOT TARGET box_contact_ros::box_contact)
      add_library(box_contact_ros::box_contact SHARED IMPORTED)
      set_target_properties(box_contact_ros::box_contact PROPERTIES
          IMPORTED_LOCATION "${_box_contact_core}/libbox_contact.so"
          IMPORTED_SONAME libbox_contact.so
          INTERFACE_INCLUDE_DIRECTORIES "${_box_contact_core}/include")
    endif()
  endforeach()
  if(NOT TARGET box_contact_ros::box_contact)
    set(${CMAKE_FIND_PACKAGE_NAME}_FOUND FALSE)
    set(${CMAKE_FIND_PACKAGE_NAME}_NOT_FOUND_MESSAGE
        "libbox_contact.so is neither beside ${_box_contact_here} nor below ${_box_contact_prefix}")
  endif()
endif()
