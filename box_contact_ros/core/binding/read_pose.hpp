// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A pose from the bytes of a message.
#pragma once

#include "../src/library/refusals.hpp"
#include "cdr.hpp"

namespace box_contact::binding {

// Return numbers, frame_id and stamp [ns] of a serialised PoseStamped. Or None: it is refused, or is
// in the other order of bytes. Python reads it then, or says what is wrong (stream/read_poses.py).
inline PyObject* read_pose(PyObject*, PyObject* given) {
  CdrReader message(given);
  int64_t stamp = message.stamp();
  std::string_view frame = message.text(frame_id_max);
  const char* numbers = message.doubles(7);
  if (!message.is_at_end()) Py_RETURN_NONE;
  double pose[7];
  std::memcpy(pose, numbers, sizeof pose);
  if (!detail::pose_is_valid(pose)) Py_RETURN_NONE;
  PyObject* frame_id = PyUnicode_DecodeUTF8(frame.data(), Py_ssize_t(frame.size()), nullptr);
  if (!frame_id && PyErr_ExceptionMatches(PyExc_UnicodeDecodeError)) {
    PyErr_Clear();
    Py_RETURN_NONE;
  }
  return Py_BuildValue("((ddddddd)NL)", pose[0], pose[1], pose[2], pose[3], pose[4], pose[5],
                       pose[6], made(frame_id), (long long)stamp);
}

}  // namespace box_contact::binding
