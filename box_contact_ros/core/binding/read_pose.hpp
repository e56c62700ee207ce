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
  constexpr size_t frame_at = 16, pose_size = 7 * sizeof(double), padding_max = 3;
  constexpr uint32_t frame_max = 256;
  if (!PyBytes_CheckExact(given)) Py_RETURN_NONE;
  const char* data = PyBytes_AS_STRING(given);
  auto size = size_t(PyBytes_GET_SIZE(given));
  if (size < frame_at || data[0] != 0 || data[1] != CdrWriter::kind) Py_RETURN_NONE;
  int32_t sec;
  uint32_t nanosec, length;
  std::memcpy(&sec, data + 4, sizeof sec);
  std::memcpy(&nanosec, data + 8, sizeof nanosec);
  std::memcpy(&length, data + 12, sizeof length);
  if (nanosec >= 1'000'000'000 || length > frame_max) Py_RETURN_NONE;
  size_t at = 4 + (frame_at - 4 + length + 7) / 8 * 8;
  if (size < at + pose_size || size > at + pose_size + padding_max) Py_RETURN_NONE;
  const char* frame = data + frame_at;
  const void* end = std::memchr(frame, '\0', length);
  if (length && end != frame + length - 1) Py_RETURN_NONE;
  double pose[7];
  std::memcpy(pose, data + at, pose_size);
  if (!detail::pose_is_valid(pose)) Py_RETURN_NONE;
  PyObject* frame_id = PyUnicode_DecodeUTF8(frame, length ? length - 1 : 0, nullptr);
  if (!frame_id && PyErr_ExceptionMatches(PyExc_UnicodeDecodeError)) {
    PyErr_Clear();
    Py_RETURN_NONE;
  }
  return Py_BuildValue("((ddddddd)NL)", pose[0], pose[1], pose[2], pose[3], pose[4], pose[5],
                       pose[6], made(frame_id), sec * 1'000'000'000LL + nanosec);
}

}  // namespace box_contact::binding
