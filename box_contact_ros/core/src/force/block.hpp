// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A patch as a block of six velocity constraints, and the bodies that its impulses move.
#pragma once

#include <algorithm>
#include <cstdint>

#include "clock.hpp"
#include "patch.hpp"
#include "pressing.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

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
  Motion pushed;         // its velocities before relaxation, at the end of the advance
  double load;           // weights that it bears and its own [N]
  int carriers;          // how many patches bear it
  double speed_squared;  // twice its energy by its mass, at the end of an advance [m²/s²]
  bool is_held;          // whether friction holds it
};

// How pressing and rocking are solved: the impulses change by −mass·(v + bias + softness·impulses).
struct NormalRows {
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
  double depth;  // [m]
  double height, rises,
      load;            // of its point; of its normal, upward; of the weights above [m], [1], [N]
  Mat<double> across;  // how pressing and rocking change the velocities along their rows
  double least_friction_mass;  // of any row of friction and torsion
  NormalRows pushing, relaxed;
  Mat<double> friction_mass;
  Vec<double> normal_impulses, friction_impulses;
  Vec<double> normal_counted, friction_counted;  // what of them is in the sums of the bodies
  Vec<double> normal_sum, friction_sum;          // of the sub-steps
};

// Rocking whose centre of pressure is within the spans.
inline double clamp(double x, double low, double high) { return std::max(low, std::min(high, x)); }
inline double bounded_1(const Rectangle& shape, double normal, double rocking) {
  return clamp(rocking, normal * rocking_1(shape).low, normal * rocking_1(shape).high);
}
inline double bounded_2(const Rectangle& shape, double normal, double rocking) {
  return clamp(rocking, normal * rocking_2(shape).low, normal * rocking_2(shape).high);
}
inline void bound(Vec<double>& impulses, double limit) {
  double squared = dot(impulses, impulses);
  if (squared > limit * limit) impulses = (limit / std::sqrt(squared)) * impulses;
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

inline Mat<double> softened(Mat<double> compliance, const Vec<double>& softness) {
  for (int i = 0; i < 3; ++i) compliance[i][i] += softness[i];
  return inverse(compliance);
}

// Catto's soft step: a spring and a damper, implicit in time. Relaxation is without them, but for a
// stiffness of the patch's own. Rocking is soft where answers are late: the wedge of the overlap,
// which levels a body, is late then.
inline void soften(const Patch& patch, const SubSteps& step, const Moving& a, const Moving& b,
                   Block& block) {
  const Mat<double>& compliance = block.across;
  double depth = block.depth;
  bool is_apart = depth < 0.0;
  double h = step.length;
  block.relaxed = {{0.0, 0.0, 0.0}, {is_apart ? -depth / h : 0.0, 0.0, 0.0}, inverse(compliance)};
  block.pushing = block.relaxed;
  if (is_apart || patch.age > step.overdue) return;
  double frequency = soft_frequency / step.window;
  double bearable = frequency_of(patch.late, step.period);
  bool is_late = bearable < frequency * step.share;
  if (is_late) frequency = bearable;
  double own = std::sqrt(patch.stiffness * compliance[0][0]);
  bool is_spring = 0.0 < own && own < frequency;
  if (is_spring) frequency = own;
  double damping = is_late || is_spring ? slow_damping_ratio : soft_damping_ratio;
  double rate = frequency / (2.0 * damping + h * frequency);
  double softness = rate / (h * frequency * frequency);
  NormalRows& rows = block.pushing;
  if (is_late) {
    Vec<double> turned = turn(patch.asked_b, b.placed) - turn(patch.asked_a, a.placed);
    rows.softness = softness * Vec<double>{0.0, compliance[1][1], compliance[2][2]};
    rows.bias =
        rate * Vec<double>{0.0, dot(turned, block.shape.axis_1), dot(turned, block.shape.axis_2)};
    rows.mass = softened(compliance, rows.softness);
    block.relaxed = rows;
  }
  double limit = is_late ? late_push_out_limit : push_out_limit;
  double slowed = is_spring ? 1.0 : std::min(1.0, limit / (rate * depth));
  rows.softness[0] = slowed * softness * compliance[0][0];
  rows.bias[0] = -slowed * rate * depth;
  rows.mass = softened(compliance, rows.softness);
  if (is_spring) block.relaxed = rows;
}

// From a body's centre of mass to a point. On one that no force moves, a point goes around by the chord
// of the step: by the tangent, what lies on a turntable would creep outward.
inline Vec<double> arm_of(const Moving& body, const Vec<double>& point, double h) {
  Vec<double> arm = point - body.placed.position;
  return body.inverse_mass > 0.0 ? arm : arm + 0.5 * h * cross(body.angular, arm);
}

// Put the point of a patch where its bodies are now. Returns its depth there.
inline double place(const Patch& patch, const Moving& a, const Moving& b, double h, Block& block) {
  // The patch goes with the body that no force moves, or with the mean of two that are free.
  Vec<double> way_a = carried(patch.asked_a, a.placed, patch.point) - patch.point;
  Vec<double> way_b = carried(patch.asked_b, b.placed, patch.point) - patch.point;
  double share = a.inverse_mass > 0.0 ? b.inverse_mass > 0.0 ? 0.5 : 1.0 : 0.0;
  Vec<double> point = patch.point + (1.0 - share) * way_a + share * way_b;
  block.arm_a = arm_of(a, point, h);
  block.arm_b = arm_of(b, point, h);
  return patch.depth + dot(way_a - way_b, patch.normal);
}

// Make the masses of friction and torsion, and how pressing and rocking comply.
inline void weigh(const Moving& a, const Moving& b, Block& block) {
  const Rectangle& shape = block.shape;
  const Vec<double>&arm_a = block.arm_a, &arm_b = block.arm_b, &normal = block.normal;
  Vec<double> about = shape.radius * normal;
  Mat<double> along =
      compliance<2>(a, b, {cross(arm_a, shape.axis_1), cross(arm_a, shape.axis_2), about},
                    {cross(arm_b, shape.axis_1), cross(arm_b, shape.axis_2), about},
                    {shape.axis_1, shape.axis_2});
  block.friction_mass = inverse(along);
  block.least_friction_mass = 1.0 / std::max(std::max(along[0][0], along[1][1]), along[2][2]);
  block.across = compliance<1>(a, b, {cross(arm_a, normal), shape.axis_1, shape.axis_2},
                               {cross(arm_b, normal), shape.axis_1, shape.axis_2}, {normal});
}

// Make the rows of a patch, where its bodies are now.
inline void prepare(const Patch& patch, const Moving& a, const Moving& b, const SubSteps& step,
                    Block& block) {
  block.normal = patch.normal;
  block.surface = patch.surface;
  block.shape = patch.shape;
  block.friction = patch.friction;
  block.normal_counted = block.friction_counted = {};
  block.depth = place(patch, a, b, step.length, block);
  weigh(a, b, block);
  soften(patch, step, a, b, block);
}

// `still`: rows stay where they are while their bodies turn by no more than this [rad], and slide by no
// more than this part of a patch. `alike`: the same for masses.
constexpr double still = 0x1p-30, alike = 0x1p-10;

// Let the rows go with bodies that have moved: impulses by the arms of before would change the angular
// momentum, and by the inertia of before the energy.
inline void follow(const Patch& patch, const Moving& a, const Moving& b, double h, Block& block) {
  double turned = std::max(length(a.angular), length(b.angular));
  double way = length(b.linear - a.linear);
  double moved = h * std::max(turned, way / block.shape.half_1);
  if (moved <= still) return;
  place(patch, a, b, h, block);
  if (moved <= alike) return;
  weigh(a, b, block);
  block.relaxed.mass = softened(block.across, block.relaxed.softness);
}

// Give B an impulse at the point and an angular impulse, and A the opposite.
inline void apply(const Block& block, const Vec<double>& impulse, const Vec<double>& turn,
                  Moving& a, Moving& b) {
  if (a.inverse_mass > 0.0) {
    a.linear = a.linear - a.inverse_mass * impulse;
    a.angular = a.angular - a.inverse_inertia * (cross(block.arm_a, impulse) + turn);
  }
  if (b.inverse_mass > 0.0) {
    b.linear = b.linear + b.inverse_mass * impulse;
    b.angular = b.angular + b.inverse_inertia * (cross(block.arm_b, impulse) + turn);
  }
}
inline void apply_normal(const Block& block, const Vec<double>& x, Moving& a, Moving& b) {
  apply(block, x[0] * block.normal, x[1] * block.shape.axis_1 + x[2] * block.shape.axis_2, a, b);
}
inline void apply_friction(const Block& block, const Vec<double>& x, Moving& a, Moving& b) {
  apply(block, x[0] * block.shape.axis_1 + x[1] * block.shape.axis_2,
        (block.shape.radius * x[2]) * block.normal, a, b);
}

// Add up the impulses that its bodies got since they were counted last.
inline void count(Block& block, Moving& a, Moving& b) {
  const Rectangle& shape = block.shape;
  Vec<double> normal = block.normal_impulses - block.normal_counted;
  Vec<double> friction = block.friction_impulses - block.friction_counted;
  block.normal_counted = block.normal_impulses;
  block.friction_counted = block.friction_impulses;
  Vec<double> impulse =
      normal[0] * block.normal + (friction[0] * shape.axis_1 + friction[1] * shape.axis_2);
  Vec<double> turn = (normal[1] * shape.axis_1 + normal[2] * shape.axis_2) +
                     (shape.radius * friction[2]) * block.normal;
  a.impulse = a.impulse - impulse;
  a.angular_impulse = a.angular_impulse - (cross(block.arm_a, impulse) + turn);
  b.impulse += impulse;
  b.angular_impulse += cross(block.arm_b, impulse) + turn;
}

// The impulses of the last window, about the point of this step.
inline void remember(const Patch& patch, const Block& block, Vec<double>& normal,
                     Vec<double>& friction) {
  const Rectangle& shape = block.shape;
  Vec<double> moved = patch.impulse_arm - block.arm_a;
  Vec<double> rocking = patch.rocking_impulse + cross(moved, patch.normal_impulse * patch.normal);
  double torsion = patch.torsion_impulse + dot(patch.normal, cross(moved, patch.friction_impulse));
  normal = {patch.normal_impulse,
            bounded_1(shape, patch.normal_impulse, dot(rocking, shape.axis_1)),
            bounded_2(shape, patch.normal_impulse, dot(rocking, shape.axis_2))};
  friction = {dot(patch.friction_impulse, shape.axis_1), dot(patch.friction_impulse, shape.axis_2),
              shape.radius > 0.0 ? torsion / shape.radius : 0.0};
  bound(friction, block.friction * normal[0]);
}

// Give a share of them again.
inline void warm_start(const Patch& patch, double share, Block& block, Moving& a, Moving& b) {
  remember(patch, block, block.normal_impulses, block.friction_impulses);
  block.normal_impulses = share * block.normal_impulses;
  block.friction_impulses = share * block.friction_impulses;
  apply_normal(block, block.normal_impulses, a, b);
  apply_friction(block, block.friction_impulses, a, b);
}

// Keep the impulses of this step, and a share of those before.
inline void store(Block& block, const SubSteps& steps, Patch& patch) {
  double kept = steps.kept(patch.window);
  patch.window = steps.window;
  block.normal_sum += block.normal_impulses;
  block.friction_sum += block.friction_impulses;
  if (kept > 0.0) {
    Vec<double> normal, friction;
    remember(patch, block, normal, friction);
    block.normal_impulses += kept * normal;
    block.friction_impulses += kept * friction;
  }
  const Rectangle& shape = block.shape;
  patch.normal_impulse = block.normal_impulses[0];
  patch.rocking_impulse =
      block.normal_impulses[1] * shape.axis_1 + block.normal_impulses[2] * shape.axis_2;
  patch.friction_impulse =
      block.friction_impulses[0] * shape.axis_1 + block.friction_impulses[1] * shape.axis_2;
  patch.torsion_impulse = shape.radius * block.friction_impulses[2];
  patch.impulse_arm = block.arm_a;
}

// Velocities of B relative to A: at the point, and angular.
inline Vec<double> speed(const Block& block, const Moving& a, const Moving& b) {
  return (b.linear + cross(b.angular, block.arm_b)) - (a.linear + cross(a.angular, block.arm_a));
}
inline Vec<double> turning(const Moving& a, const Moving& b) { return b.angular - a.angular; }

// Solve friction and torsion. Returns by how much a speed changed.
inline double solve_friction(Block& block, Moving& a, Moving& b) {
  const Rectangle& shape = block.shape;
  Vec<double> slip = speed(block, a, b) + block.surface;
  Vec<double> v{dot(slip, shape.axis_1), dot(slip, shape.axis_2),
                shape.radius * dot(turning(a, b), block.normal)};
  double limit = block.friction * block.normal_impulses[0];
  Vec<double> next = block.friction_impulses - block.friction_mass * v;
  if (dot(next, next) > limit * limit) {
    // It slides: one factor for all rows turns friction against the motion.
    next = block.friction_impulses - block.least_friction_mass * v;
    bound(next, limit);
  }
  Vec<double> change = next - block.friction_impulses;
  block.friction_impulses = next;
  apply_friction(block, change, a, b);
  return largest(abs(change)) / block.least_friction_mass;
}

// Velocities along the rows of pressing and rocking, beyond the bias.
inline Vec<double> pressing_speeds(const Block& block, const NormalRows& rows, const Moving& a,
                                   const Moving& b) {
  Vec<double> turns = turning(a, b);
  return Vec<double>{dot(speed(block, a, b), block.normal), dot(turns, block.shape.axis_1),
                     dot(turns, block.shape.axis_2)} +
         rows.bias;
}

// Solve pressing and rocking. Returns by how much the closing speed changed.
inline double solve_normal(Block& block, const NormalRows& rows, Moving& a, Moving& b) {
  Vec<double> before = block.normal_impulses;
  const Mat<double>& mass = rows.mass;
  auto error = [&] {
    return pressing_speeds(block, rows, a, b) + rows.softness * block.normal_impulses;
  };
  Vec<double> v = error(), next = block.normal_impulses - mass * v;
  if (!(bounded_1(block.shape, next[0], next[1]) == next[1] &&
        bounded_2(block.shape, next[0], next[2]) == next[2])) {
    // The pressure would be negative at a rim.
    Mat<double> soft = block.across;
    for (int i = 0; i < 3; ++i) soft[i][i] += rows.softness[i];
    next = OnTheRim(block.shape, soft, v - soft * block.normal_impulses).impulses();
  }
  apply_normal(block, next - block.normal_impulses, a, b);
  block.normal_impulses = next;
  return std::fabs(next[0] - before[0]) * block.across[0][0];
}

}  // namespace box_contact::BOX_CONTACT_SET::force
