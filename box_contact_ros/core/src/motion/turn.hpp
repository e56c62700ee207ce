// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Turns at constant rate, by sine, cosine and arctangent of our own.
//
// The functions of C libraries differ in their last bits. These need + − · / √ alone, so they have the
// same bits on every machine. Their errors are a few units of 2⁻⁵³.
#pragma once

#include "../poses.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

using Vector = Vec<double>;

BC_INLINE Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
BC_INLINE double norm(const Vector& a) { return std::sqrt(dot(a, a)); }

struct SineAndCosine {
  double sine, cosine;
};

// Of an angle from 0 to π/2: the series at half of it, then doubled.
inline SineAndCosine sine_and_cosine(double angle) {
  double x = 0.5 * angle, square = x * x, sine = 1.0, cosine = 1.0;
  for (int k = 18; k > 0; k -= 2) {
    sine = 1.0 - square * (1.0 / double(k * (k + 1))) * sine;
    cosine = 1.0 - square * (1.0 / double(k * (k - 1))) * cosine;
  }
  sine = x * sine;
  return {2.0 * sine * cosine, 1.0 - 2.0 * sine * sine};
}

// The angle from 0 to π/2 of a sine and a cosine that are not below 0: the series at an eighth of it.
inline double angle_of(double sine, double cosine) {
  double tangent = sine / (std::sqrt(sine * sine + cosine * cosine) + cosine);
  for (int half = 0; half < 2; ++half)
    tangent = tangent / (1.0 + std::sqrt(1.0 + tangent * tangent));
  double square = tangent * tangent, series = 0.0;
  for (int k = 23; k > 0; k -= 2) series = 1.0 / double(k) - square * series;
  return 8.0 * tangent * series;
}

// A turn about a fixed axis. An angle of a quaternion is half of the turn's.
struct Turn {
  Vector axis{};  // unit vector; zeros without a turn
  double half_angle = 0.0;
  double start[4];  // a unit quaternion, x y z w

  // The vector along the axis that is as long as the angle [rad]: the rate by s.
  Vector rate() const { return (2.0 * half_angle) * axis; }
  // Write the quaternion at s.
  void at(double s, double (&q)[4]) const {
    SineAndCosine now = sine_and_cosine(s * half_angle);
    Vector turned = now.sine * axis, from{start[0], start[1], start[2]};
    Vector found = (now.cosine * from + start[3] * turned) + cross(turned, from);
    for (int k = 0; k < 3; ++k) q[k] = found[k];
    q[3] = now.cosine * start[3] - dot(turned, from);
  }
};

// Half turns closer than this to 180 degrees have no shorter way [cosine of half the angle].
constexpr double least_cosine = 1e-9;

// Find the shortest turn between two orientations. Returns false where there are two.
inline bool find_shortest_turn(const double (&start)[4], const double (&end)[4], Turn& turn) {
  double to[4], by_start = 1.0 / std::sqrt(squared_norm(start));
  double by_end = 1.0 / std::sqrt(squared_norm(end));
  for (int k = 0; k < 4; ++k) turn.start[k] = by_start * start[k], to[k] = by_end * end[k];
  Vector p{turn.start[0], turn.start[1], turn.start[2]}, q{to[0], to[1], to[2]};
  double cosine = to[3] * turn.start[3] + dot(q, p);
  Vector way = (turn.start[3] * q - to[3] * p) - cross(q, p);
  if (!(std::fabs(cosine) >= least_cosine)) return false;
  double sine = norm(way), sign = cosine < 0.0 ? -1.0 : 1.0;  // q and −q are one orientation
  turn.half_angle = angle_of(sine, std::fabs(cosine));
  turn.axis = sine > 0.0 ? (sign / sine) * way : Vector{};
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET::motion
