// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Where boxes and bodies are, as vectors and axes.
#pragma once

#include "../include/box_contact/box_contact.h"
#include "poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

inline Vec<double> vector_at(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }
inline Vec<double> vector(const double (&numbers)[3]) { return vector_at(numbers); }

// By how much the length of a normal may differ from 1 [1].
constexpr double normal_slack = 1e-6;
inline bool is_unit(const Vec<double>& a) {
  double squared = dot(a, a);
  return squared >= (1.0 - normal_slack) * (1.0 - normal_slack) &&
         squared <= (1.0 + normal_slack) * (1.0 + normal_slack);
}

// A place, and axes as columns; common frame. Of a body, the place is its centre of mass.
template <class T>
struct PlacedOf {
  Vec<T> position;
  Mat<T> axes;
};
using Placed = PlacedOf<double>;

// A box, about its own centre.
inline Placed box_at(const bc_pose& pose) {
  return {vector(pose.position), rotation_matrix(pose.quaternion)};
}

}  // namespace box_contact::BOX_CONTACT_SET
