// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What is no pose, and why, by codes. solver/checks.py has words for them.
#pragma once

#include <cmath>

#include "../src/library/refusals.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

enum PoseFault : uint8_t {
  no_fault,
  position_not_finite,
  position_too_far,
  quaternion_not_finite,
  quaternion_too_short,
  quaternion_too_long,
};

inline PoseFault fault_of(const double* pose) {
  if (detail::pose_is_valid(pose)) return no_fault;
  auto is_finite = [pose](int from, int to) {
    return std::all_of(pose + from, pose + to, [](double x) { return std::isfinite(x); });
  };
  if (!is_finite(0, 3)) return position_not_finite;
  for (int k = 0; k < 3; ++k)
    if (std::fabs(pose[k]) > length_max) return position_too_far;
  if (!is_finite(3, 7)) return quaternion_not_finite;
  const double quaternion[4] = {pose[3], pose[4], pose[5], pose[6]};
  return squared_norm(quaternion) < 1.0 ? quaternion_too_short : quaternion_too_long;
}

inline PyObject* pose_fault(PyObject*, PyObject* pose) {
  double copy[7];
  if (const double* numbers = numbers_of(pose, 7, copy)) return PyLong_FromLong(fault_of(numbers));
  return PyLong_FromLong(fault_of(read<double>(pose, "pose", {7}).numbers));
}

inline PyObject* pose_faults(PyObject*, PyObject* given) {
  auto poses = read<double>(given, "poses", {any_length, 7});
  auto faults = make<uint8_t>({poses.length(0)});
  for (npy_intp row = 0; row < poses.length(0); ++row)
    faults.numbers[row] = fault_of(poses.numbers + 7 * row);
  return faults.object.release();
}

}  // namespace box_contact::binding
