// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// How bodies turn by their angular velocities, and these as they do.
#pragma once

#include <algorithm>
#include <cmath>

#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Turn a quaternion x y z w by an angular velocity ω, in the common frame, for a time h. Its tan(θ/4) is
// t + t³/3 with t = h·ω/4, so the angle is short of h·ω by (h·ω)⁵/1920.
inline void spin(double (&q)[4], const Vec<double>& angular, double h) {
  Vec<double> t = (0.25 * h) * angular;
  t = (1.0 + dot(t, t) / 3.0) * t;
  double squared = dot(t, t), share = 1.0 / (1.0 + squared), w = share * (1.0 - squared);
  Vec<double> v = (2.0 * share) * t, u = vector_at(q);
  Vec<double> turned = (w * u + q[3] * v) + cross(v, u);
  q[3] = w * q[3] - dot(v, u);
  std::copy_n(turned.v, 3, q);
}

// I⁻¹ in the common frame.
inline Mat<double> inverse_inertia_of(const Body& body, const Placed& placed) {
  Mat<double> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      m[i][j] = dot(row(placed.axes, i), body.inverse_inertia * row(placed.axes, j));
  return m;
}

// A body that turns less at a time [rad] keeps its angular velocity: the change is beyond its digits.
constexpr double least_turn = 0x1p-40;

// A body turns by no more than this at a time [rad], and so often at most: its energy then swings by
// 4e-5, before it is put right.
constexpr double turn_limit = 0.05;
constexpr int turns_max = 1000;

// Turn a body with the quaternion q by t = tan(θ / 2) about its own axis x.
inline void turn_about(int x, double t, double (&q)[4]) {
  int y = (x + 1) % 3, z = (x + 2) % 3;
  double w = q[3], at_x = q[x], at_y = q[y], at_z = q[z], norm = 1.0 / std::sqrt(1.0 + t * t);
  q[x] = norm * (at_x + t * w);
  q[3] = norm * (w - t * at_x);
  q[y] = norm * (at_y + t * at_z);
  q[z] = norm * (at_z - t * at_y);
}

// Where the angle of momentum and velocity is less [rad], rounding would say how to put the energy right.
constexpr double least_angle = 0x1p-20;

// Put twice the kinetic energy right. The body turns a little under its angular momentum, which stays: by
// `most` [rad]. Of a cube, and about a principal axis, there is nothing to put right.
inline void keep_energy(const Body& body, double energy, double most, double (&q)[4],
                        Vec<double>& momentum) {
  Vec<double> speed = momentum * body.inverse_inertia;
  double squared = dot(momentum, momentum), found = dot(momentum, speed);
  Vec<double> across = speed - (found / squared) * momentum;
  double slope = 2.0 * dot(across, across), amount = (found - energy) / slope;
  if (!(slope > least_angle * least_angle * dot(speed, speed))) return;
  if (!(amount * amount * slope <= most * most * squared)) return;
  Vec<double> turned = momentum - amount * across;
  turned = std::sqrt(squared / dot(turned, turned)) * turned;
  Vec<double> half = (0.5 / squared) * cross(turned, momentum);
  double w = q[3], norm = 1.0 / std::sqrt(1.0 + dot(half, half));
  Vec<double> v = vector_at(q), after = norm * ((v + w * half) + cross(v, half));
  q[3] = norm * (w - dot(v, half));
  std::copy_n(after.v, 3, q);
  momentum = turned;
}

// Turn a body on which nothing acts for a time h: about each of its own axes in turn, there and back
// (Dullweber, Leimkuhler and McLachlan, "Symplectic splitting methods for rigid body molecular dynamics",
// 1997). Its angular momentum in the common frame stays the same to rounding, and so does its energy.
// `momentum`: in its own frame.
inline void tumble(const Body& body, double h, double (&q)[4], Vec<double>& momentum) {
  Vec<double> speed = momentum * body.inverse_inertia;
  double energy = dot(momentum, speed);
  double angle = length(speed) * h;
  double turns = std::ceil(std::min(double(turns_max), angle / turn_limit));
  constexpr int axes[] = {0, 1, 2, 1, 0};
  for (int k = int(turns); k-- > 0;)
    for (int step = 0; step < 5; ++step) {
      int x = axes[step], y = (x + 1) % 3, z = (x + 2) % 3;
      double part = (step == 2 ? 1.0 : 0.5) * (h / turns);
      double half = 0.5 * part * momentum[x] * body.inverse_inertia[x],
             t = half + half * half * half / 3.0;  // tan(angle / 2)
      double scale = 1.0 / (1.0 + t * t), cosine = scale * (1.0 - t * t), sine = 2.0 * scale * t;
      double along_y = momentum[y], along_z = momentum[z];
      momentum[y] = cosine * along_y + sine * along_z;
      momentum[z] = cosine * along_z - sine * along_y;
      turn_about(x, t, q);
    }
  for (int newton = 0; newton < 2; ++newton)
    keep_energy(body, energy, turn_limit * std::min(angle, 1.0), q, momentum);
}

// Turn a body for a time h, and change its angular velocity in the common frame as it does by itself.
inline void turn_freely(const Body& body, double h, double (&q)[4], Placed& placed,
                        Vec<double>& angular) {
  double most = largest(abs(angular));
  if (most == 0.0) return;
  if (!body.is_free() || h * most < least_turn) {
    spin(q, angular, h);
    placed.axes = rotation_matrix(q);
    return;
  }
  Vec<double> momentum =
      transposed_times(placed.axes, angular) / body.inverse_inertia;  // in its own frame
  tumble(body, h, q, momentum);
  placed.axes = rotation_matrix(q);
  angular = placed.axes * (momentum * body.inverse_inertia);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
