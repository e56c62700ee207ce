// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bodies that no force moves, within a step: a lift, a turntable, a lorry that brakes.
#pragma once

#include <algorithm>
#include <cmath>

#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// The velocity of a body that goes from one pose to another in a time [s].
inline bc_velocity velocity_between(const bc_pose& from, const bc_pose& to,
                                    const Vec<double>& centre, double time) {
  const Placed at = placed_at(from, centre), then = placed_at(to, centre);
  Vec<double> turn = rotation(at, then);  // sin θ, made θ by its series
  double squared = dot(turn, turn);
  Vec<double> linear = (1.0 / time) * (then.position - at.position),
              angular = ((1.0 + squared * (1.0 / 6.0 + squared * 0.075)) / time) * turn;
  bc_velocity velocity;
  std::copy_n(linear.v, 3, velocity.linear);
  std::copy_n(angular.v, 3, velocity.angular);
  return velocity;
}

// The smaller of two changes after each other, where they have one sign (minmod): a jump is none.
inline Vec<double> least_change_of(const Vec<double>& x, const Vec<double>& y,
                                   const Vec<double>& z) {
  Vec<double> change{0.0, 0.0, 0.0};
  for (int i = 0; i < 3; ++i) {
    double first = y[i] - x[i], second = z[i] - y[i];
    if (first * second > 0.0) change[i] = std::fabs(first) < std::fabs(second) ? first : second;
  }
  return change;
}

// A velocity that changes within the step as it did lately. Its mean is what was given. Had the first
// sub-step all of the change, friction would have to give it in so short a time. `part`: of the step, from
// its middle [1]. `before`, `last`: given for the last steps.
inline Vec<double> carried_at(double part, const Vec<double>& before, const Vec<double>& last,
                              const Vec<double>& given) {
  // Lanes add zeros of either sign to it: only a positive one stays as it is.
  return (given + part * least_change_of(before, last, given)) + 0.0;
}

// Beside a body that no force moves and that turns, points go around by the chord of a step h. The step
// begins here or, below 0, ends here. By the tangent, what lies on a turntable would creep outward. Returns
// how the velocity of B relative to A differs by that.
template <class T, class Body>
BC_INLINE Vec<T> along_chords(const Body& a, const Body& b, const Vec<T>& arm_a,
                              const Vec<T>& arm_b, double h) {
  auto turns = [](const Body& body) __attribute__((always_inline)) {
    return (body.inverse_mass <= 0.0) & (dot(body.angular, body.angular) > 0.0);
  };
  Mask<T> is_carrier = turns(a) | turns(b);
  if (!any(is_carrier)) return {};
  auto inward = [](const Body& body, const Vec<T>& arm) __attribute__((always_inline)) {
    return cross(body.angular, cross<T>(body.angular, arm));
  };
  return select(is_carrier, (0.5 * h) * (inward(b, arm_b) - inward(a, arm_a)), Vec<T>{});
}

}  // namespace box_contact::BOX_CONTACT_SET::force
