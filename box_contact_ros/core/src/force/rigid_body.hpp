// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rigid bodies: mass, place, motion and turn.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "../../include/box_contact/force.h"
#include "../placed.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Of a place of a centre of mass [m]: that of a box, and a centre in it.
constexpr double place_max = 4.0 * length_max;

inline bool is_still(const bc_velocity& velocity) {
  auto is_zero = [](double number) { return number == 0.0; };
  return std::all_of(velocity.linear, velocity.linear + 3, is_zero) &&
         std::all_of(velocity.angular, velocity.angular + 3, is_zero);
}

// A body that no force moves has inverses of zero.
struct Body {
  double inverse_mass;          // [1/kg]
  Vec<double> inverse_inertia;  // about its own axes, through the centre of mass [1/(kg m²)]
  Vec<double> centre;           // of mass, in the box's frame [m]

  bool is_free() const { return inverse_mass > 0.0; }
};

struct Motion {
  Vec<double> linear, angular;  // of the centre of mass [m/s], [rad/s]
};

// The inverse of a matrix, by its cofactors. One whose determinant is not positive gives zero.
template <class T>
BC_INLINE Mat<T> inverse(const Mat<T>& m) {
  Vec<T> r0 = row(m, 0), r1 = row(m, 1), r2 = row(m, 2), c0 = cross(r1, r2);
  T determinant = dot(r0, c0), s = select<T>(determinant > 0.0, 1.0 / determinant, T{});
  Vec<T> x = s * c0, y = s * cross(r2, r0), z = s * cross(r0, r1);
  return {{{x[0], y[0], z[0]}, {x[1], y[1], z[1]}, {x[2], y[2], z[2]}}};
}

// Two unit vectors across a unit normal.
inline void tangents(const Vec<double>& n, Vec<double>& t1, Vec<double>& t2) {
  Vec<double> aside =
      std::fabs(n[0]) < 0.6 ? Vec<double>{1.0, 0.0, 0.0} : Vec<double>{0.0, 1.0, 0.0};
  t1 = cross(n, aside);
  t1 = (1.0 / length(t1)) * t1;
  t2 = cross(n, t1);
}

inline Placed placed_at(const bc_pose& pose, const Vec<double>& centre) {
  Mat<double> axes = rotation_matrix(pose.quaternion);
  return {vector(pose.position) + axes * centre, axes};
}
// The pose of a body that is placed so. quaternion: of any length.
inline bc_pose pose_at(const Placed& placed, const double (&quaternion)[4],
                       const Vec<double>& centre) {
  bc_pose pose;
  const Vec<double> position = placed.position - placed.axes * centre;
  std::copy_n(position.v, 3, pose.position);
  double scale = 1.0 / std::sqrt(squared_norm(quaternion));
  for (int i = 0; i < 4; ++i) pose.quaternion[i] = scale * quaternion[i];
  return pose;
}

// The pose of a box in the common frame, of a pose in the frame of a body at `body`.
inline bc_pose in_common_frame(const bc_pose& body, const bc_pose& box) {
  auto read = [](const bc_pose& pose) -> Pose<double> {
    const double(&q)[4] = pose.quaternion;
    return {vector(pose.position), {q[0], q[1], q[2], q[3]}};
  };
  auto [at, turned] = pose_in_common_frame(read(body), read(box));
  return {{at[0], at[1], at[2]}, {turned[0], turned[1], turned[2], turned[3]}};
}

// The rotation of a body between two places, as a vector: sin θ along the axis, for small θ its angle.
inline Vec<double> rotation(const Placed& from, const Placed& to) {
  Vec<double> sum{0.0, 0.0, 0.0};
  for (int k = 0; k < 3; ++k) sum = sum + cross(column(from.axes, k), column(to.axes, k));
  return 0.5 * sum;
}

// Where the point of a body that was at `point` has gone.
inline Vec<double> carried(const Placed& from, const Placed& to, const Vec<double>& point) {
  return to.position + to.axes * transposed_times(from.axes, point - from.position);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
