// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Turns at constant rate of two boxes side by side, by sine, cosine and arctangent of our own.
//
// The functions of C libraries differ in their last bits. These need + − · / √ alone, so they have the
// same bits on every machine. Their errors are a few units of 2⁻⁵³.
#pragma once

#include "../poses.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

using Vector = Vec<double>;
using Both = Lanes<double, 2>;  // a number of A, and one of B
using BothVectors = Vec<Both>;

BC_INLINE double larger_norm(const Vector& a, const Vector& b) {
  return std::sqrt(max(dot(a, a), dot(b, b)));
}

BC_INLINE BothVectors both(const Vector& of_a, const Vector& of_b) {
  return {Both{of_a[0], of_b[0]}, Both{of_a[1], of_b[1]}, Both{of_a[2], of_b[2]}};
}
BC_INLINE Vector vector_of(const BothVectors& v, int box) {
  return {v[0][box], v[1][box], v[2][box]};
}
// What B has more than A.
BC_INLINE double difference(const Both& x) { return x[1] - x[0]; }
BC_INLINE Vector difference(const BothVectors& v) {
  return {difference(v[0]), difference(v[1]), difference(v[2])};
}

struct SinesAndCosines {
  Both sine, cosine;
};

// Of angles from 0 to π/2: the series at half of them, then doubled.
BC_INLINE SinesAndCosines sines_and_cosines(const Both& angle) {
  Both x = 0.5 * angle, square = x * x, one = splat<Both>(1.0), sine = one, cosine = one;
  for (int k = 18; k > 0; k -= 2) {
    sine = one - square * (1.0 / double(k * (k + 1))) * sine;
    cosine = one - square * (1.0 / double(k * (k - 1))) * cosine;
  }
  sine = x * sine;
  return {2.0 * sine * cosine, one - 2.0 * sine * sine};
}

// The angles from 0 to π/2 of sines and cosines that are not below 0: the series at an eighth of them.
BC_INLINE Both angles_of(const Both& sine, const Both& cosine) {
  Both one = splat<Both>(1.0), tangent = sine / (sqrt(sine * sine + cosine * cosine) + cosine);
  for (int half = 0; half < 2; ++half) tangent = tangent / (one + sqrt(one + tangent * tangent));
  Both square = tangent * tangent, series{};
  for (int k = 23; k > 0; k -= 2) series = 1.0 / double(k) - square * series;
  return 8.0 * tangent * series;
}

// Turns about fixed axes. An angle of a quaternion is half of the turn's.
struct Turns {
  BothVectors axis;  // unit vectors; zeros without a turn
  Both half_angle;
  Both start[4];  // unit quaternions, x y z w

  // Write the quaternions at s.
  BC_INLINE void at(double s, Both (&q)[4]) const {
    SinesAndCosines now = sines_and_cosines(s * half_angle);
    BothVectors turned = now.sine * axis, from{start[0], start[1], start[2]};
    BothVectors found = (now.cosine * from + start[3] * turned) + cross(turned, from);
    for (int k = 0; k < 3; ++k) q[k] = found[k];
    q[3] = now.cosine * start[3] - dot(turned, from);
  }
};

// Half turns closer than this to 180 degrees have no shorter way [cosine of half the angle].
constexpr double least_cosine = 1e-9;

// Find the shortest turns between orientations. Returns which box has two of them: 0, 1 or −1.
inline int find_shortest_turns(const Both (&start)[4], const Both (&end)[4], Turns& turns) {
  Both to[4], one = splat<Both>(1.0);
  Both by_start = one / sqrt(squared_norm(start)), by_end = one / sqrt(squared_norm(end));
  for (int k = 0; k < 4; ++k) turns.start[k] = by_start * start[k], to[k] = by_end * end[k];
  BothVectors p{turns.start[0], turns.start[1], turns.start[2]}, q{to[0], to[1], to[2]};
  Both cosine = to[3] * turns.start[3] + dot(q, p);
  BothVectors way = (turns.start[3] * q - to[3] * p) - cross(q, p);
  for (int box = 0; box < 2; ++box)
    if (!(std::fabs(cosine[box]) >= least_cosine)) return box;
  Both sine = length(way);  // q and −q are one orientation
  Both sign = select<Both>(cosine < splat<Both>(0.0), -one, one);
  Mask<Both> is_turn = sine > splat<Both>(0.0);
  turns.half_angle = angles_of(sine, abs(cosine));
  turns.axis = (sign / select<Both>(is_turn, sine, one)) * way;
  return -1;
}

}  // namespace box_contact::BOX_CONTACT_SET::motion
