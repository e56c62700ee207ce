// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A patch as a block of six velocity constraints, and the bodies that its impulses move.
#pragma once

#include <algorithm>
#include <cstdint>

#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A window shrinks by the first where three steps are shorter by more: a frame may end with two shorter
// ones, and a step that is measured varies. A step begins with at most the second times the impulses of
// a window [1]. What iterations leave is as large in a step of 1 ns as in one of 5 ms: divided by the
// step it would be any force. A window that is halved by each tiny step loses a tower's impulses in
// three of them.
constexpr double window_shrinkage = 1.25, most_again = 2.0;
// Angular frequency of a soft constraint times the window [1]: a quarter turn. A box that rests on a
// whole face is 0.4·g·step² deep.
constexpr double soft_frequency = 1.57;
// The same times half a period and the latency of an answer [1]. With 2 a container at 50 Hz and 5 ms
// tilts by 0.06°; from 4 on late loads vibrate.
constexpr double late_frequency = 2.5;
// Of pushing out [1]: an overlap shrinks by a ninth a step. With 1, impacts are half as deep again.
constexpr double soft_damping_ratio = 5.0;
// The same where answers are late, or a patch has a stiffness of its own.
constexpr double slow_damping_ratio = 2.0;
// Speed at which an overlap is pushed out, at most [m/s]. The spring bears as much as without the limit.
// Speeds add up in a stack, and relaxation leaves some: with 1, eight cubes that overlap by 2 mm jump by
// 0.8 m.
constexpr double push_out_limit = 0.1;
// The same where answers are late, which bear nothing that is as hard.
constexpr double late_push_out_limit = 1.0;
// An answer that is overdue by so many periods [1] pushes nothing out.
constexpr double overdue_periods = 3.0;

// A body in a step.
struct Moving {
  Vec<double> linear, angular;
  double inverse_mass;
  Mat<double> inverse_inertia;  // common frame
  int changed;                  // the last iteration that changed its velocities
  int32_t body;
  double quaternion[4];  // of length 1
  Placed placed;
  Vec<double> impulse, angular_impulse;  // of contacts, since the advance began [N s], [N m s]

  // Move by the velocities for a time.
  void move(double h) {
    placed.position += h * linear;
    if (dot(angular, angular) == 0.0) return;
    spin(quaternion, angular, h);
    placed.axes = rotation_matrix(quaternion);
  }
};

// What all patches of a sub-step share.
struct SubStep {
  double length;   // [s]
  double window;   // the time in which the impulses that patches keep were given [s]
  double again;    // share of the impulses of the window before that is given at first [1]
  double kept;     // share of them that stays in the window [1]
  double share;    // of the advance [1]; answers are late in comparison with all of it
  double period;   // from one answer to the next [s]
  double overdue;  // age of an answer that is overdue [s]
};

// How pressing and rocking are solved: the impulses change by −mass·(v + bias + softness·impulses).
struct PressRows {
  Vec<double> softness, bias;
  Mat<double> mass;
};

// A patch in a step. Impulses are components: N, τ1, τ2 and f1, f2, m / r.
struct Block {
  int32_t a, b;   // places of its bodies among those that move
  int32_t patch;  // its place
  Vec<double> arm_a, arm_b, normal, surface;
  Rectangle shape;
  double friction;
  double closing;         // how much an impulse N alone changes the closing speed [1/kg]
  double least_rub_mass;  // of any row of friction and torsion
  PressRows pushing, relaxed;
  Mat<double> rub_mass;
  Vec<double> press, rub;
  Vec<double> press_sum, rub_sum;  // of the sub-steps
};

inline double clamp(double x, double limit) { return std::max(-limit, std::min(limit, x)); }
inline void bound(Vec<double>& rub, double limit) {
  double squared = dot(rub, rub);
  if (squared > limit * limit) rub = (limit / std::sqrt(squared)) * rub;
}

// How the velocities along three rows change by impulses along them. A row turns the bodies about an
// axis through their centres of mass, and the first `linear` rows have a direction as well.
template <int linear>
Mat<double> compliance(const Moving& a, const Moving& b, const Vec<double> (&turn_a)[3],
                       const Vec<double> (&turn_b)[3], const Vec<double> (&directions)[linear]) {
  Mat<double> m;
  bool a_moves = a.inverse_mass > 0.0, b_moves = b.inverse_mass > 0.0;
  for (int j = 0; j < 3; ++j) {
    Vec<double> spun_a = a_moves ? a.inverse_inertia * turn_a[j] : Vec<double>{0.0, 0.0, 0.0};
    Vec<double> spun_b = b_moves ? b.inverse_inertia * turn_b[j] : Vec<double>{0.0, 0.0, 0.0};
    for (int i = j; i < 3; ++i) {
      double moved = i < linear ? (a.inverse_mass + b.inverse_mass) *
                                      dot(directions[i % linear], directions[j % linear])
                                : 0.0;
      m[i][j] = m[j][i] = moved + dot(turn_a[i], spun_a) + dot(turn_b[i], spun_b);
    }
  }
  return m;
}

inline Mat<double> softened(Mat<double> pressed, const Vec<double>& softness) {
  for (int i = 0; i < 3; ++i) pressed[i][i] += softness[i];
  return inverse(pressed);
}

// The frequency of a patch whose answers are late [1/s].
inline double frequency_of(double late, double period) {
  return late_frequency / (late + 0.5 * period);
}

// Catto's soft step: a spring and a damper, implicit in time. Relaxation is without them, but for a
// stiffness of the patch's own. Rocking is soft where answers are late: the wedge of the overlap,
// which levels a body, is late then.
inline void soften(const Patch& patch, const SubStep& step, double depth, const Moving& a,
                   const Moving& b, const Mat<double>& pressed, Block& block) {
  bool is_apart = depth < 0.0;
  double h = step.length;
  block.relaxed = {{0.0, 0.0, 0.0}, {is_apart ? -depth / h : 0.0, 0.0, 0.0}, inverse(pressed)};
  block.pushing = block.relaxed;
  if (is_apart || patch.age > step.overdue) return;
  double frequency = soft_frequency / step.window;
  double bearable = frequency_of(patch.late, step.period);
  bool is_late = bearable < frequency * step.share;
  if (is_late) frequency = bearable;
  double own = std::sqrt(patch.stiffness * pressed[0][0]);
  bool is_spring = 0.0 < own && own < frequency;
  if (is_spring) frequency = own;
  double damping = is_late || is_spring ? slow_damping_ratio : soft_damping_ratio;
  double rate = frequency / (2.0 * damping + h * frequency);
  double softness = rate / (h * frequency * frequency);
  PressRows& rows = block.pushing;
  if (is_late) {
    Vec<double> turned = turn(patch.asked_b, b.placed) - turn(patch.asked_a, a.placed);
    rows.softness = softness * Vec<double>{0.0, pressed[1][1], pressed[2][2]};
    rows.bias =
        rate * Vec<double>{0.0, dot(turned, block.shape.axis_1), dot(turned, block.shape.axis_2)};
    rows.mass = softened(pressed, rows.softness);
    block.relaxed = rows;
  }
  double limit = is_late ? late_push_out_limit : push_out_limit;
  double slowed = is_spring ? 1.0 : std::min(1.0, limit / (rate * depth));
  rows.softness[0] = slowed * softness * pressed[0][0];
  rows.bias[0] = -slowed * rate * depth;
  rows.mass = softened(pressed, rows.softness);
  if (is_spring) block.relaxed = rows;
}

// From a body's centre of mass to a point. On one that no force moves, a point goes around by the chord
// of the step: by the tangent, what lies on a turntable would creep outward.
inline Vec<double> arm_of(const Moving& body, const Vec<double>& point, double h) {
  Vec<double> arm = point - body.placed.position;
  return body.inverse_mass > 0.0 ? arm : arm + 0.5 * h * cross(body.angular, arm);
}

// Make the rows of a patch, where its bodies are now.
inline void prepare(const Patch& patch, const Moving& a, const Moving& b, const SubStep& step,
                    Block& block) {
  const Rectangle& shape = patch.shape;
  // The patch goes with the body that no force moves, or with the mean of two that are free.
  Vec<double> way_a = carried(patch.asked_a, a.placed, patch.point) - patch.point;
  Vec<double> way_b = carried(patch.asked_b, b.placed, patch.point) - patch.point;
  double share = a.inverse_mass > 0.0 ? b.inverse_mass > 0.0 ? 0.5 : 1.0 : 0.0;
  Vec<double> point = patch.point + (1.0 - share) * way_a + share * way_b;
  block.arm_a = arm_of(a, point, step.length);
  block.arm_b = arm_of(b, point, step.length);
  block.normal = patch.normal;
  block.surface = patch.surface;
  block.shape = shape;
  block.friction = patch.friction;

  const Vec<double>&arm_a = block.arm_a, &arm_b = block.arm_b;
  Vec<double> spin = shape.radius * patch.normal;
  Mat<double> rubbed = compliance<2>(
      a, b, {cross(arm_a, shape.axis_1), cross(arm_a, shape.axis_2), spin},
      {cross(arm_b, shape.axis_1), cross(arm_b, shape.axis_2), spin}, {shape.axis_1, shape.axis_2});
  block.rub_mass = inverse(rubbed);
  block.least_rub_mass = 1.0 / std::max(std::max(rubbed[0][0], rubbed[1][1]), rubbed[2][2]);
  Mat<double> pressed =
      compliance<1>(a, b, {cross(arm_a, patch.normal), shape.axis_1, shape.axis_2},
                    {cross(arm_b, patch.normal), shape.axis_1, shape.axis_2}, {patch.normal});
  block.closing = pressed[0][0];
  double depth = patch.depth + dot(way_a - way_b, patch.normal);
  soften(patch, step, depth, a, b, pressed, block);
}

// Give B an impulse at the point and an angular impulse, and A the opposite.
inline void give(const Block& block, const Vec<double>& impulse, const Vec<double>& turn, Moving& a,
                 Moving& b) {
  if (a.inverse_mass > 0.0) {
    a.linear = a.linear - a.inverse_mass * impulse;
    a.angular = a.angular - a.inverse_inertia * (cross(block.arm_a, impulse) + turn);
  }
  if (b.inverse_mass > 0.0) {
    b.linear = b.linear + b.inverse_mass * impulse;
    b.angular = b.angular + b.inverse_inertia * (cross(block.arm_b, impulse) + turn);
  }
}
inline void give_press(const Block& block, const Vec<double>& x, Moving& a, Moving& b) {
  give(block, x[0] * block.normal, x[1] * block.shape.axis_1 + x[2] * block.shape.axis_2, a, b);
}
inline void give_rub(const Block& block, const Vec<double>& x, Moving& a, Moving& b) {
  give(block, x[0] * block.shape.axis_1 + x[1] * block.shape.axis_2,
       (block.shape.radius * x[2]) * block.normal, a, b);
}

// Add up the impulses that its bodies get.
inline void count(const Block& block, Moving& a, Moving& b) {
  const Rectangle& shape = block.shape;
  const Vec<double>&press = block.press, &rub = block.rub;
  Vec<double> impulse = press[0] * block.normal + (rub[0] * shape.axis_1 + rub[1] * shape.axis_2);
  Vec<double> turn =
      (press[1] * shape.axis_1 + press[2] * shape.axis_2) + (shape.radius * rub[2]) * block.normal;
  a.impulse = a.impulse - impulse;
  a.angular_impulse = a.angular_impulse - (cross(block.arm_a, impulse) + turn);
  b.impulse += impulse;
  b.angular_impulse += cross(block.arm_b, impulse) + turn;
}

// The impulses of the last window, about the point of this step.
inline void remember(const Patch& patch, const Block& block, Vec<double>& press, Vec<double>& rub) {
  const Rectangle& shape = block.shape;
  Vec<double> moved = patch.given_arm - block.arm_a;
  Vec<double> rock = patch.rock + cross(moved, patch.press * patch.normal);
  double spin = patch.spin + dot(patch.normal, cross(moved, patch.slip));
  press = {patch.press, clamp(dot(rock, shape.axis_1), patch.press * shape.half_2),
           clamp(dot(rock, shape.axis_2), patch.press * shape.half_1)};
  rub = {dot(patch.slip, shape.axis_1), dot(patch.slip, shape.axis_2),
         shape.radius > 0.0 ? spin / shape.radius : 0.0};
  bound(rub, block.friction * press[0]);
}

// Give a share of them again.
inline void warm_start(const Patch& patch, double share, Block& block, Moving& a, Moving& b) {
  remember(patch, block, block.press, block.rub);
  block.press = share * block.press;
  block.rub = share * block.rub;
  give_press(block, block.press, a, b);
  give_rub(block, block.rub, a, b);
}

// Keep the impulses of this step, and a share of those before.
inline void store(Block& block, double kept, Patch& patch) {
  block.press_sum += block.press;
  block.rub_sum += block.rub;
  if (kept > 0.0) {
    Vec<double> press, rub;
    remember(patch, block, press, rub);
    block.press += kept * press;
    block.rub += kept * rub;
  }
  const Rectangle& shape = block.shape;
  patch.press = block.press[0];
  patch.rock = block.press[1] * shape.axis_1 + block.press[2] * shape.axis_2;
  patch.slip = block.rub[0] * shape.axis_1 + block.rub[1] * shape.axis_2;
  patch.spin = shape.radius * block.rub[2];
  patch.given_arm = block.arm_a;
}

// Velocities of B relative to A: at the point, and angular.
inline Vec<double> speed(const Block& block, const Moving& a, const Moving& b) {
  return (b.linear + cross(b.angular, block.arm_b)) - (a.linear + cross(a.angular, block.arm_a));
}
inline Vec<double> turning(const Moving& a, const Moving& b) { return b.angular - a.angular; }

// Solve friction and torsion. Returns by how much a speed changed.
inline double solve_rub(Block& block, Moving& a, Moving& b) {
  const Rectangle& shape = block.shape;
  Vec<double> slip = speed(block, a, b) + block.surface;
  Vec<double> v{dot(slip, shape.axis_1), dot(slip, shape.axis_2),
                shape.radius * dot(turning(a, b), block.normal)};
  double limit = block.friction * block.press[0];
  Vec<double> next = block.rub - block.rub_mass * v;
  if (dot(next, next) > limit * limit) {
    // It slides: one factor for all rows turns friction against the motion.
    next = block.rub - block.least_rub_mass * v;
    bound(next, limit);
  }
  Vec<double> change = next - block.rub;
  block.rub = next;
  give_rub(block, change, a, b);
  return largest(abs(change)) / block.least_rub_mass;
}

// Solve pressing and rocking. Returns by how much the closing speed changed.
inline double solve_press(Block& block, const PressRows& rows, Moving& a, Moving& b) {
  Vec<double> before = block.press;
  const Mat<double>& mass = rows.mass;
  auto error = [&] {
    Vec<double> turns = turning(a, b);
    return Vec<double>{dot(speed(block, a, b), block.normal), dot(turns, block.shape.axis_1),
                       dot(turns, block.shape.axis_2)} +
           rows.bias + rows.softness * block.press;
  };
  Vec<double> v = error(), next = block.press - mass * v;
  double limit_1 = next[0] * block.shape.half_2, limit_2 = next[0] * block.shape.half_1;
  if (!(std::fabs(next[1]) <= limit_1 && std::fabs(next[2]) <= limit_2)) {
    // The pressure would be negative at the rim: row by row, within the limits.
    double alone = 1.0 / (block.closing + rows.softness[0]);
    next = {std::max(0.0, block.press[0] - alone * v[0]), block.press[1], block.press[2]};
    give_press(block, next - block.press, a, b);
    block.press = next;
    v = error();
    next[1] = clamp(next[1] - mass[1][1] * v[1], next[0] * block.shape.half_2);
    next[2] = clamp(next[2] - mass[2][2] * v[2], next[0] * block.shape.half_1);
  }
  give_press(block, next - block.press, a, b);
  block.press = next;
  return std::fabs(next[0] - before[0]) * block.closing;
}

}  // namespace box_contact::BOX_CONTACT_SET::force
