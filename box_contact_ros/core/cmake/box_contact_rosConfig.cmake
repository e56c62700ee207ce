# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# find_package(box_contact_ros): target box_contact_ros::box_contact, also for
# ament_target_dependencies.
#
# colcon installs this file to PREFIX/share/box_contact_ros/cmake, the library to PREFIX/lib and its
# headers to PREFIX/include. pip leaves all three in the Python package.
if(NOT TARGET box_contact_ros::box_contact)
  get_filename_component(_box_contact_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
  get_filename_component(_box_contact_core "${CMAKE_CURRENT_LIST_DIR}/.." ABSOLUTE)
  if(EXISTS "${_box_contact_prefix}/lib/libbox_contact.so")
    set(_box_contact_library "${_box_contact_prefix}/lib/libbox_contact.so")
    set(_box_contact_headers "${_box_contact_prefix}/include/box_contact_ros")
  else()
    set(_box_contact_library "${_box_contact_core}/libbox_contact.so")
    set(_box_contact_headers "${_box_contact_core}/include" "${_box_contact_core}/../node/include")
  endif()
  if(EXISTS "${_box_contact_library}")
    add_library(box_contact_ros::box_contact SHARED IMPORTED)
    set_target_properties(box_contact_ros::box_contact PROPERTIES
        IMPORTED_LOCATION "${_box_contact_library}"
        IMPORTED_SONAME libbox_contact.so
        INTERFACE_INCLUDE_DIRECTORIES "${_box_contact_headers}")
  else()
    set(${CMAKE_FIND_PACKAGE_NAME}_FOUND FALSE)
    set(${CMAKE_FIND_PACKAGE_NAME}_NOT_FOUND_MESSAGE
        "libbox_contact.so is neither in ${_box_contact_prefix}/lib nor in ${_box_contact_core}")
  endif()
endif()
set(box_contact_ros_TARGETS box_contact_ros::box_contact)
