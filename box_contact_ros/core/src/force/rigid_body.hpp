// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rigid bodies: mass, place, motion and turn.
#pragma once

#include <cmath>

#include "../../include/box_contact/force.h"
#include "../poses.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A body that no force moves has inverses of zero.
struct Body {
  double inverse_mass;          // [1/kg]
  Vec<double> inverse_inertia;  // about its own axes, through the centre of mass [1/(kg m²)]
  Vec<double> centre;           // of mass, in the box's frame [m]

  bool is_free() const { return inverse_mass > 0.0; }
};

// Where a body is: its centre of mass, and its axes as columns; common frame.
struct Placed {
  Vec<double> position;
  Mat<double> axes;
};

struct Motion {
  Vec<double> linear, angular;  // of the centre of mass [m/s], [rad/s]
};

inline Vec<double> cross(const Vec<double>& a, const Vec<double>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double length(const Vec<double>& a) { return std::sqrt(dot(a, a)); }
inline Vec<double> vector_at(const double* numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}
inline Vec<double> vector(const double (&numbers)[3]) { return vector_at(numbers); }

// The inverse of a symmetric positive definite matrix, by its cofactors. A singular one gives zero.
inline Mat<double> inverse(const Mat<double>& m) {
  Vec<double> r0 = row(m, 0), r1 = row(m, 1), r2 = row(m, 2), c0 = cross(r1, r2);
  double determinant = dot(r0, c0), s = determinant > 0.0 ? 1.0 / determinant : 0.0;
  Vec<double> x = s * c0, y = s * cross(r2, r0), z = s * cross(r0, r1);
  return {{{x[0], x[1], x[2]}, {y[0], y[1], y[2]}, {z[0], z[1], z[2]}}};
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

// The turn of a body between two places, as a vector: sin θ along the axis, for small θ its angle.
inline Vec<double> turn(const Placed& from, const Placed& to) {
  Vec<double> sum{0.0, 0.0, 0.0};
  for (int k = 0; k < 3; ++k) sum = sum + cross(column(from.axes, k), column(to.axes, k));
  return 0.5 * sum;
}

// Where the point of a body that was at `point` has gone.
inline Vec<double> carried(const Placed& from, const Placed& to, const Vec<double>& point) {
  return to.position + to.axes * transposed_times(from.axes, point - from.position);
}

// I⁻¹ in the common frame.
inline Mat<double> inverse_inertia_of(const Body& body, const Placed& placed) {
  Mat<double> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      m[i][j] = dot(row(placed.axes, i), body.inverse_inertia * row(placed.axes, j));
  return m;
}

// −ω × (I·ω), in the common frame.
inline Vec<double> gyroscopic_torque(const Body& body, const Placed& placed,
                                     const Vec<double>& angular) {
  Vec<double> own = transposed_times(placed.axes, angular);
  return placed.axes * cross(own / body.inverse_inertia, own);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
