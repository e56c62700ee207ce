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
