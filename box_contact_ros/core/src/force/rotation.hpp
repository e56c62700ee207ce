// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// How bodies move by their velocities, and turn: one by one, or side by side. Each lane has the bits of a body
// alone.
#pragma once

#include "block.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Turn a quaternion x y z w by an angular velocity ω, in the common frame, for a time h. Its tan(θ/4) is
// t + t³/3 with t = h·ω/4, so the angle is short of h·ω by (h·ω)⁵/1920.
template <class T>
BC_INLINE void spin(T (&q)[4], const Vec<T>& angular, double h) {
  Vec<T> t = (0.25 * h) * angular;
  t = (1.0 + dot(t, t) / 3.0) * t;
  T squared = dot(t, t), share = 1.0 / (1.0 + squared), w = share * (1.0 - squared);
  Vec<T> v = (2.0 * share) * t, u{q[0], q[1], q[2]};
  Vec<T> turned = (w * u + q[3] * v) + cross(v, u);
  q[3] = w * q[3] - dot(v, u);
  for (int k = 0; k < 3; ++k) q[k] = turned[k];
}

// I⁻¹ in the common frame, of that about a body's own axes.
template <class T>
BC_INLINE Mat<T> inverse_inertia_of(const Vec<T>& inverse_inertia, const Mat<T>& axes) {
  Mat<T> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = dot(row(axes, i), inverse_inertia * row(axes, j));
  return m;
}

// A body that turns less at a time [rad] keeps its angular velocity: the change is beyond its digits.
constexpr double least_rotation = 0x1p-40;

// A body turns by no more than this at a time [rad], and so often at most: its energy then swings by
// 4e-5, before it is put right.
constexpr double rotation_limit = 0.05;
constexpr int rotations_max = 1000;

// Turn a body with the quaternion q by t = tan(θ / 2) about its own axis x.
template <class T>
BC_INLINE void rotate_about(int x, T t, T (&q)[4]) {
  int y = (x + 1) % 3, z = (x + 2) % 3;
  T w = q[3], at_x = q[x], at_y = q[y], at_z = q[z], norm = 1.0 / sqrt(1.0 + t * t);
  q[x] = norm * (at_x + t * w);
  q[3] = norm * (w - t * at_x);
  q[y] = norm * (at_y + t * at_z);
  q[z] = norm * (at_z - t * at_y);
}

// Where the angle of momentum and velocity is less [rad], rounding would say how to put the energy right.
constexpr double least_angle = 0x1p-20;

// Put twice the kinetic energy right. The body turns a little under its angular momentum, which stays: by
// `most` [rad]. Of a cube, and about a principal axis, there is nothing to put right.
template <class T>
BC_INLINE void keep_energy(const Vec<T>& inverse_inertia, T energy, T most, T (&q)[4],
                           Vec<T>& momentum) {
  Vec<T> speed = momentum * inverse_inertia;
  T squared = dot(momentum, momentum), found = dot(momentum, speed);
  Vec<T> across = speed - (found / squared) * momentum;
  T slope = 2.0 * dot(across, across), amount = (found - energy) / slope;
  Mask<T> turns = (slope > least_angle * least_angle * dot(speed, speed)) &
                  (amount * amount * slope <= most * most * squared);
  if (!any(turns)) return;
  Vec<T> turned = momentum - amount * across;
  turned = sqrt(squared / dot(turned, turned)) * turned;
  Vec<T> half = (0.5 / squared) * cross(turned, momentum), v{q[0], q[1], q[2]};
  T w = q[3], norm = 1.0 / sqrt(1.0 + dot(half, half));
  Vec<T> after = norm * ((v + w * half) + cross(v, half));
  for (int k = 0; k < 3; ++k) q[k] = select<T>(turns, after[k], q[k]);
  q[3] = select<T>(turns, norm * (w - dot(v, half)), w);
  momentum = select(turns, turned, momentum);
}

// Turn those bodies, on which nothing acts, for a time h: about each of their own axes after each other, there and back
// (Dullweber, Leimkuhler and McLachlan, "Symplectic splitting methods for rigid body molecular dynamics",
// 1997). Their angular momenta in the common frame stay the same to rounding, and so do their energies.
// `momentum`: in their own frames.
template <class T>
BC_INLINE void tumble(const Vec<T>& inverse_inertia, Mask<T> chosen, double h, T (&q)[4],
                      Vec<T>& momentum) {
  Vec<T> speed = momentum * inverse_inertia;
  T energy = dot(momentum, speed), angle = length(speed) * h;
  T turns = select<T>(chosen, ceil(min<T>(angle / rotation_limit, splat<T>(rotations_max))), T{});
  for (int done = 0; any(turns > double(done)); ++done) {
    T turned[4] = {q[0], q[1], q[2], q[3]};
    Vec<T> after = momentum;
    auto about = [&](int x, double share) __attribute__((always_inline)) {
      int y = (x + 1) % 3, z = (x + 2) % 3;
      T part = share * (h / turns), half = 0.5 * part * after[x] * inverse_inertia[x],
        t = half + half * half * half / 3.0;  // tan(angle / 2)
      T scale = 1.0 / (1.0 + t * t), cosine = scale * (1.0 - t * t), sine = 2.0 * scale * t;
      T along_y = after[y], along_z = after[z];
      after[y] = cosine * along_y + sine * along_z;
      after[z] = cosine * along_z - sine * along_y;
      rotate_about(x, t, turned);
    };
    about(0, 0.5);
    about(1, 0.5);
    about(2, 1.0);
    about(1, 0.5);
    about(0, 0.5);
    Mask<T> goes_on = turns > double(done);
    for (int k = 0; k < 4; ++k) q[k] = select<T>(goes_on, turned[k], q[k]);
    momentum = select(goes_on, after, momentum);
  }
  for (int newton = 0; newton < 2; ++newton)
    keep_energy<T>(inverse_inertia, energy, rotation_limit * min<T>(angle, splat<T>(1.0)), q,
                   momentum);
}

// Turn bodies for a time h, and change their angular velocities in the common frame as they do by themselves.
template <class T>
BC_INLINE void rotate_freely(const Vec<T>& inverse_inertia, Mask<T> is_free, double h, T (&q)[4],
                             Mat<T>& axes, Vec<T>& angular) {
  T most = largest(abs(angular));
  Mask<T> turns = most != 0.0, tumbles = turns & is_free & (h * most >= least_rotation);
  if (!any(turns)) return;
  T spun[4] = {q[0], q[1], q[2], q[3]}, tumbled[4] = {q[0], q[1], q[2], q[3]};
  if (bits(turns) & ~bits(tumbles)) spin(spun, angular, h);
  Vec<T> momentum{};  // in its own frame
  if (any(tumbles)) {
    momentum = transposed_times(axes, angular) / inverse_inertia;
    tumble<T>(inverse_inertia, tumbles, h, tumbled, momentum);
  }
  for (int k = 0; k < 4; ++k)
    q[k] = select<T>(turns, select<T>(tumbles, tumbled[k], spun[k]), q[k]);
  Mat<T> after = rotation_matrix(q);
  put<T>(turns, after, axes);
  angular = select(tumbles, axes * (momentum * inverse_inertia), angular);
}

// Move bodies by their velocities for a time h. inverse_inertia: about their own axes.
template <class T>
BC_INLINE void move(const Vec<T>& inverse_inertia, double h, T (&q)[4], Speeds<T>& speeds,
                    Where<T>& at) {
  Mask<T> is_free = speeds.inverse_mass > 0.0;
  at.placed.position += h * speeds.linear;
  rotate_freely<T>(inverse_inertia, is_free, h, q, at.placed.axes, speeds.angular);
  put<T>(is_free, inverse_inertia_of(inverse_inertia, at.placed.axes), at.inverse_inertia);
}
inline void move(const Body& body, double h, Moving& moving) {
  move<double>(body.inverse_inertia, h, moving.quaternion, moving, moving);
  moving.pushed = {moving.linear, moving.angular};
}

}  // namespace box_contact::BOX_CONTACT_SET::force
