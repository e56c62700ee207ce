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

// The inverse of a matrix, by its cofactors. One whose determinant is not positive gives zero.
inline Mat<double> inverse(const Mat<double>& m) {
  Vec<double> r0 = row(m, 0), r1 = row(m, 1), r2 = row(m, 2), c0 = cross(r1, r2);
  double determinant = dot(r0, c0), s = determinant > 0.0 ? 1.0 / determinant : 0.0;
  Vec<double> x = s * c0, y = s * cross(r2, r0), z = s * cross(r0, r1);
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

// How much the angular velocity ω of a body that nothing touches changes in a step h; all in its frame.
//
// Implicit midpoint, which keeps the energy, by two Newton steps: I·Δ = −h·ω̄ × I·ω̄ with ω̄ = ω + Δ/2.
// An explicit step gains energy without bound. What Newton leaves of the energy is scaled off.
inline Vec<double> gyroscopic_change(const Body& body, const Vec<double>& angular, double h) {
  const Vec<double>& inverse_inertia = body.inverse_inertia;
  Vec<double> ones{1.0, 1.0, 1.0}, inertia = ones / inverse_inertia;
  // Euler's equations: the rate of ω0 is share[0]·ω1·ω2, and so on.
  Vec<double> share = Vec<double>{inertia[1] - inertia[2], inertia[2] - inertia[0],
                                  inertia[0] - inertia[1]} * inverse_inertia;
  Vec<double> change{0.0, 0.0, 0.0};
  for (int newton = 0; newton < 2; ++newton) {
    Vec<double> mean = angular + 0.5 * change, x = (0.5 * h) * share;
    Vec<double> rate = share * Vec<double>{mean[1] * mean[2], mean[2] * mean[0], mean[0] * mean[1]};
    Mat<double> slope{{{1.0, -x[0] * mean[2], -x[0] * mean[1]},
                       {-x[1] * mean[2], 1.0, -x[1] * mean[0]},
                       {-x[2] * mean[1], -x[2] * mean[0], 1.0}}};
    change = change - inverse(slope) * (change - h * rate);
  }
  Vec<double> after = angular + change;
  double energy = dot(inertia * angular, angular), found = dot(inertia * after, after);
  return found > 0.0 ? std::sqrt(energy / found) * after - angular : change;
}

}  // namespace box_contact::BOX_CONTACT_SET::force
