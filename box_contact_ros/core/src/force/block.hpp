// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A patch as a block of six velocity constraints, and the bodies that its impulses move.
//
// The blocks are solved by sequential impulses (projected Gauss-Seidel) with warm start (Catto,
// "Iterative dynamics with temporal coherence", 2005). A patch has the normal n from A to B, the
// centroid c, and the rectangle of its covariance, with the half lengths l1 and l2. Its rows
// constrain the velocity of B relative to A:
//
//     pressing  N  along n at c            N ≥ 0
//     rocking   τ  about the axes 1 and 2  the centre of N in the rectangle and on both faces
//     friction  f  in the plane at p       |f|² + (m/r)² ≤ (μ·N)²
//     torsion   m  about n through p       r: the radius at which friction resists a spin
//
// Here p is the centre of pressure of the last while: one that followed each iteration would shake piles.
// Pressing and rocking are solved as one block, friction and torsion as another. Overlaps are pushed
// out by soft constraints; relaxation removes the speed of pushing out again (Catto, "Solver2D",
// 2024). Between answers, depth, centroid and tilt follow the bodies.
//
// Functions are templates over T: `double` for a block alone, or lanes for blocks side by side, and over
// what the bodies are then: `Moving`, or `Side<T>`. Each lane has the bits of a block alone.
#pragma once

#include <cstdint>

#include "../lanes/triples.hpp"
#include "clock.hpp"
#include "patch.hpp"
#include "pressing.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// What blocks need of a body.
template <class T>
struct Speeds {
  Vec<T> linear;
  T last_change;  // the last iteration that changed them
  Vec<T> angular;
  T inverse_mass;
};
template <class T>
struct Where {
  Mat<T> inverse_inertia;  // common frame
  PlacedOf<T> placed;
};
template <class T>
struct Sums {
  Vec<T> impulse, angular_impulse;  // of contacts, since the advance began [N s], [N m s]
};

// How much finer the sub-steps of a body's island were, as a patch may be lost for a step: see fineness.hpp.
struct Fineness {
  double factor = 1.0;
  double calm = 0.0;    // for how long less was needed [s]
  double swayed = 0.0;  // for how long it has swayed [s]

  // What rests has not swayed, still bears its load, and is to stay where it is.
  Fineness asleep() const { return {factor}; }
};

// For how long a body's island was slow [s], and the least square of its speed since then [m²/s²].
struct SlowTime {
  double time = 0.0, least = 0.0;
};

// A body in a step, on lines of a cache of its own: other threads may move its neighbours.
struct alignas(64) Moving : Speeds<double>, Where<double>, Sums<double> {
  int32_t body;
  int32_t side;          // the first group side by side that may have its next block
  double quaternion[4];  // of length 1
  Fineness fineness;
  SlowTime slow;
  Motion pushed;         // its velocities before relaxation, at the end of the advance
  double load;           // weights that it bears and its own [N]
  int carriers;          // how many patches bear it
  double speed_squared;  // twice its energy by its mass, at the end of an advance [m²/s²]
  bool is_supported;     // whether friction holds it
};

// The bodies of blocks side by side.
template <class T>
struct Side : Speeds<T> {
  const Mat<T>& inverse_inertia;
};

// How pressing and rocking are solved: the impulses change by −mass·(v + bias + softness·impulses).
template <class T>
struct NormalRows {
  Vec<T> softness, bias;
  Mat<T> mass;
};

// A patch as an answer has it, and what its island makes of it.
template <class T>
struct Asked {
  Vec<T> normal, point, surface;
  RectangleOf<T> shape;
  T friction, asked_depth, late, age;
  Vec<T> local_a, local_b;  // its point in the frames of its bodies
  Vec<T> closing;           // velocities along N, τ1 and τ2 that close the faces: see closing.hpp
  T over_relaxation;        // of pressing and rocking: see iterations.hpp [1]
};
template <class T>
struct Arms {
  Vec<T> arm_a, arm_b;  // from the centres of mass to the point
  Vec<T> carried;       // velocity of B at the point relative to A, beside what arms tell [m/s]
};
// What is known of it at the end of a sub-step.
template <class T>
struct Reached : Arms<T> {
  T depth;                          // [m]
  T lever_1, lever_2;               // from the point to where friction acts, along the axes [m]
  Vec<T> normal_sum, friction_sum;  // impulses of the sub-steps
};
template <class T>
struct Masses {
  Mat<T> across;  // how pressing and rocking change the velocities along their rows
  Mat<T> friction_mass;
  T least_friction_mass;  // of any row of friction and torsion
};
// A patch in a step. Impulses are components: N, τ1, τ2 and f1, f2, m / r.
template <class T>
struct Rows : Asked<T>, Kept<T>, Reached<T>, Masses<T> {
  NormalRows<T> pushing, relaxed;
  Vec<T> normal_impulses, friction_impulses;
  Vec<T> normal_counted, friction_counted;  // what of them is in the sums of the bodies
};
struct Block : Rows<double> {
  int32_t a, b;   // places of its bodies among those that move
  int32_t patch;  // its place
  int32_t side;   // its place side by side with others
  double height, rises,
      load;  // of its point; of its normal, upward; of the weights above [m], [1], [N]
};

// Rocking whose centre of pressure is within the span.
template <class T>
BC_INLINE T bounded(const SpanOf<T>& per_pressing, T normal, T rocking) {
  return max<T>(min<T>(rocking, normal * per_pressing.high), normal * per_pressing.low);
}
template <class T>
BC_INLINE void bound(Vec<T>& impulses, T limit) {
  T squared = dot(impulses, impulses);
  Mask<T> is_beyond = squared > limit * limit;
  if (any(is_beyond)) impulses = select(is_beyond, (limit / sqrt(squared)) * impulses, impulses);
}

// Read what an answer, and the last window, say of a patch.
inline void read_patch(const Patch& patch, double over_relaxation, Block& block) {
  auto local = [&](const Placed& asked) {
    return transposed_times(asked.axes, patch.point - asked.position);
  };
  // The zeros are written out: `{}` would clear the whole of it first.
  static_cast<Asked<double>&>(block) = {
      patch.normal,         patch.point,          patch.surface,              patch.shape,
      patch.friction,       patch.depth,          patch.late,                 patch.age,
      local(patch.asked_a), local(patch.asked_b), Vec<double>{0.0, 0.0, 0.0}, over_relaxation};
  static_cast<Kept<double>&>(block) = patch.kept;
}

// Give B an impulse at the point and an angular impulse, and A the opposite.
template <class T, class Body>
BC_INLINE void apply(const Rows<T>& block, const Vec<T>& impulse, const Vec<T>& angular, Body& a,
                     Body& b) {
  if (any(a.inverse_mass > 0.0)) {
    a.linear = a.linear - a.inverse_mass * impulse;
    a.angular = a.angular - a.inverse_inertia * (cross(block.arm_a, impulse) + angular);
  }
  if (any(b.inverse_mass > 0.0)) {
    b.linear = b.linear + b.inverse_mass * impulse;
    b.angular = b.angular + b.inverse_inertia * (cross(block.arm_b, impulse) + angular);
  }
}
template <class T, class Body>
BC_INLINE void apply_normal(const Rows<T>& block, const Vec<T>& x, Body& a, Body& b) {
  apply<T>(block, x[0] * block.normal, x[1] * block.shape.axis_1 + x[2] * block.shape.axis_2, a, b);
}
// The torsion of friction and torsion, about the point instead of the centre of pressure.
template <class T>
BC_INLINE T torsion_at_point(const Rows<T>& block, const Vec<T>& x) {
  return block.shape.radius * x[2] + (block.lever_1 * x[1] - block.lever_2 * x[0]);
}
template <class T, class Body>
BC_INLINE void apply_friction(const Rows<T>& block, const Vec<T>& x, Body& a, Body& b) {
  apply<T>(block, x[0] * block.shape.axis_1 + x[1] * block.shape.axis_2,
           torsion_at_point(block, x) * block.normal, a, b);
}

// Add up the impulses that its bodies got since they were counted last.
template <class T>
BC_INLINE void count(Rows<T>& block, Sums<T>& a, Sums<T>& b) {
  const RectangleOf<T>& shape = block.shape;
  Vec<T> normal = block.normal_impulses - block.normal_counted;
  Vec<T> friction = block.friction_impulses - block.friction_counted;
  block.normal_counted = block.normal_impulses;
  block.friction_counted = block.friction_impulses;
  Vec<T> impulse =
      normal[0] * block.normal + (friction[0] * shape.axis_1 + friction[1] * shape.axis_2);
  Vec<T> angular = (normal[1] * shape.axis_1 + normal[2] * shape.axis_2) +
                   torsion_at_point(block, friction) * block.normal;
  a.impulse = a.impulse - impulse;
  a.angular_impulse = a.angular_impulse - (cross(block.arm_a, impulse) + angular);
  b.impulse += impulse;
  b.angular_impulse += cross(block.arm_b, impulse) + angular;
}

// The impulses of the last window: what pressed, about the point of this step.
template <class T>
BC_INLINE Vec<T> remembered_pressing(const Rows<T>& block) {
  const RectangleOf<T>& shape = block.shape;
  T pressing = block.normal_impulse;
  Vec<T> moved = block.impulse_arm - block.arm_a;
  Vec<T> rocking = block.rocking_impulse + cross<T>(moved, pressing * block.normal);
  return {pressing, bounded<T>(rocking_1(shape), pressing, dot(rocking, shape.axis_1)),
          bounded<T>(rocking_2(shape), pressing, dot(rocking, shape.axis_2))};
}
// What rubbed, about the centre of pressure.
template <class T>
BC_INLINE Vec<T> remembered_friction(const Rows<T>& block) {
  const RectangleOf<T>& shape = block.shape;
  Vec<T> moved = block.impulse_arm - block.arm_a;
  T torsion = block.torsion_impulse + dot(block.normal, cross(moved, block.friction_impulse));
  Vec<T> friction{dot(block.friction_impulse, shape.axis_1),
                  dot(block.friction_impulse, shape.axis_2), T{}};
  torsion -= torsion_at_point(block, friction);
  friction[2] = select<T>(shape.radius > 0.0, torsion / shape.radius, T{});
  bound<T>(friction, block.friction * block.normal_impulse);
  return friction;
}

// Give a share of them again.
template <class T, class Body>
BC_INLINE void warm_start(const SubSteps& steps, Rows<T>& block, Body& a, Body& b) {
  T share = steps.again(block.window);
  block.normal_impulses = share * remembered_pressing(block);
  block.friction_impulses = share * remembered_friction(block);
  apply_normal(block, block.normal_impulses, a, b);
  apply_friction(block, block.friction_impulses, a, b);
}

// The mean centre of what pressed lately. N·n at x·e1 + y·e2 has the moment N·(y·e1 − x·e2).
template <class T>
BC_INLINE void follow_pressure(const SubSteps& steps, Rows<T>& block) {
  const RectangleOf<T>& shape = block.shape;
  const Vec<T>& pressed = block.normal_impulses;
  T before = splat<T>(max<double>(0.0, 1.0 - steps.length / steps.pressure_span())) * block.pressure;
  block.pressure = before + pressed[0];
  Vec<T> moment = before * (block.pressure_arm - block.arm_a) +
                  (pressed[1] * shape.axis_2 - pressed[2] * shape.axis_1);
  Mask<T> has_pressed = block.pressure > 0.0;
  auto centre = [&](T along) { return select<T>(has_pressed, along / block.pressure, T{}); };
  block.pressure_arm = block.arm_a + Vec<T>{centre(moment[0]), centre(moment[1]), centre(moment[2])};
}

// Keep the impulses of this step, and a share of those before.
template <class T>
BC_INLINE void store(const SubSteps& steps, Rows<T>& block) {
  T kept = steps.kept(block.window);
  block.window = splat<T>(steps.window);
  block.normal_sum += block.normal_impulses;
  block.friction_sum += block.friction_impulses;
  Vec<T> pressed = block.normal_impulses, rubbed = block.friction_impulses;
  Mask<T> is_kept = kept > 0.0;
  if (any(is_kept)) {
    pressed = select(is_kept, pressed + kept * remembered_pressing(block), pressed);
    rubbed = select(is_kept, rubbed + kept * remembered_friction(block), rubbed);
  }
  const RectangleOf<T>& shape = block.shape;
  block.normal_impulse = pressed[0];
  block.rocking_impulse = pressed[1] * shape.axis_1 + pressed[2] * shape.axis_2;
  block.friction_impulse = rubbed[0] * shape.axis_1 + rubbed[1] * shape.axis_2;
  block.torsion_impulse = torsion_at_point(block, rubbed);
  block.impulse_arm = block.arm_a;
  follow_pressure(steps, block);
}

// Velocities of B relative to A: at the point, and angular.
template <class T, class Body>
BC_INLINE Vec<T> speed(const Rows<T>& block, const Body& a, const Body& b) {
  return ((b.linear + cross(b.angular, block.arm_b)) - (a.linear + cross(a.angular, block.arm_a))) +
         block.carried;
}

// Solve friction and torsion of the blocks that are due. Returns by how much a speed changed.
template <class T, class Body>
BC_INLINE T solve_friction(Rows<T>& block, Mask<T> due, Body& a, Body& b) {
  const RectangleOf<T>& shape = block.shape;
  Vec<T> slip = speed(block, a, b) + block.surface;
  T spin = dot(b.angular - a.angular, block.normal);
  Vec<T> v{dot(slip, shape.axis_1) - block.lever_2 * spin,
           dot(slip, shape.axis_2) + block.lever_1 * spin, shape.radius * spin};
  T limit = block.friction * block.normal_impulses[0];
  Vec<T> next = block.friction_impulses - block.friction_mass * v;
  Mask<T> slides = due & (dot(next, next) > limit * limit);
  if (any(slides)) {
    // It slides: one factor for all rows turns friction against the motion.
    Vec<T> sliding = block.friction_impulses - block.least_friction_mass * v;
    bound<T>(sliding, limit);
    next = select(slides, sliding, next);
  }
  Vec<T> change = next - block.friction_impulses;
  block.friction_impulses = select(due, next, block.friction_impulses);
  apply_friction(block, change, a, b);
  return largest(abs(change)) / block.least_friction_mass;
}

template <class T, class Body>
BC_INLINE T closing_speed(const Rows<T>& block, const Body& a, const Body& b) {
  return -dot(speed(block, a, b), block.normal);
}

// Velocities along the rows of pressing and rocking, beyond the bias.
template <class T, class Body>
BC_INLINE Vec<T> pressing_speeds(const Rows<T>& block, const NormalRows<T>& rows, const Body& a,
                                 const Body& b) {
  Vec<T> spin = b.angular - a.angular;
  return Vec<T>{dot(speed(block, a, b), block.normal), dot(spin, block.shape.axis_1),
                dot(spin, block.shape.axis_2)} +
         rows.bias;
}

// Written out, as a copy of a matrix of lanes is a call.
template <class T>
BC_INLINE Mat<T> softened(const Mat<T>& m, const Vec<T>& softness) {
  return {{{m[0][0] + softness[0], m[0][1], m[0][2]},
           {m[1][0], m[1][1] + softness[1], m[1][2]},
           {m[2][0], m[2][1], m[2][2] + softness[2]}}};
}

// Solve pressing and rocking of those. Returns by how much the closing speed changed.
template <class T, class Body>
BC_INLINE T solve_normal(Rows<T>& block, const NormalRows<T>& rows, Mask<T> due, Body& a, Body& b) {
  const Vec<T> before = block.normal_impulses;
  Vec<T> v = pressing_speeds(block, rows, a, b) + rows.softness * before;
  auto is_within = [&](const Vec<T>& x) __attribute__((always_inline)) {
    return (bounded<T>(rocking_1(block.shape), x[0], x[1]) == x[1]) &
           (bounded<T>(rocking_2(block.shape), x[0], x[2]) == x[2]);
  };
  Vec<T> change = rows.mass * v, next = before - change;
  Mask<T> within = is_within(next);
  T reach = max<T>(block.shape.half_1, block.shape.half_2);
  T fastest = max<T>(abs(v[0]), reach * max<T>(abs(v[1]), abs(v[2])));
  Mask<T> sways = within & (fastest > least_over_relaxed);
  if (any(sways)) {
    Vec<T> beyond = before - block.over_relaxation * change;
    next = select(sways & is_within(beyond), beyond, next);
  }
  if (bits(due) & ~bits(within)) {
    // The pressure would be negative at a rim.
    Mat<T> soft = softened(block.across, rows.softness);
    next = select(within, next, OnTheRim<T>(block.shape, soft, v - soft * before, next).impulses());
  }
  apply_normal(block, next - before, a, b);
  block.normal_impulses = select(due, next, before);
  return abs(next[0] - before[0]) * block.across[0][0];
}

}  // namespace box_contact::BOX_CONTACT_SET::force
