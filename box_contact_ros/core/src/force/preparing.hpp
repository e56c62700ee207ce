// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Make the rows of a patch, where its bodies are, and let them go with bodies that move.
#pragma once

#include "block.hpp"

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

}  // namespace box_contact::BOX_CONTACT_SET::force
