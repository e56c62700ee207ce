// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Make the rows of a patch, where its bodies are, and let them go with bodies that move.
#pragma once

#include "block.hpp"
#include "carriers.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// How a body turns by an angular impulse. One that no force moves does not.
template <class T, class Body>
BC_INLINE Vec<T> angular_change(const Body& body, const Vec<T>& impulse) {
  Mask<T> is_free = body.inverse_mass > 0.0;
  if (!any(is_free)) return {};
  return select(is_free, body.inverse_inertia * impulse, Vec<T>{});
}

// How the velocities along three rows change by impulses along them. A row turns the bodies about an
// axis through their centres of mass, and the first `linear` rows have a direction as well.
template <int linear, class T, class Body>
BC_INLINE Mat<T> compliance(const Body& a, const Body& b, const Vec<T> (&about_a)[3],
                            const Vec<T> (&about_b)[3], const Vec<T> (&directions)[linear]) {
  Mat<T> m;
  for (int j = 0; j < 3; ++j) {
    Vec<T> spun_a = angular_change<T>(a, about_a[j]), spun_b = angular_change<T>(b, about_b[j]);
    for (int i = j; i < 3; ++i) {
      T moved{};
      if (i < linear)
        moved =
            (a.inverse_mass + b.inverse_mass) * dot(directions[i % linear], directions[j % linear]);
      m[i][j] = m[j][i] = moved + dot(about_a[i], spun_a) + dot(about_b[i], spun_b);
    }
  }
  return m;
}

// Catto's soft step: a spring and a damper, implicit in time. Relaxation is without them. Rocking is soft
// where answers are late: the wedge of the overlap, which levels a body, is late then. `rotated()`: by how much B has rotated more than A since.
template <class T, class Rotated>
BC_INLINE void soften(const SubSteps& step, const Rotated& rotated, Rows<T>& block) {
  const Mat<T>& compliance = block.across;
  T depth = block.depth, none{};
  double h = step.length;
  T apart = select<T>(depth < 0.0, -depth / h, none);
  NormalRows<T>&pushing = block.pushing, &relaxed = block.relaxed;
  relaxed.softness = pushing.softness = {none, none, none};
  relaxed.bias = block.closing;
  relaxed.bias[0] += apart;
  relaxed.mass = inverse(compliance);
  pushing.bias = relaxed.bias;
  Mask<T> pushes = (depth >= 0.0) & (block.age <= step.overdue);
  if (!any(pushes)) {
    pushing.mass = relaxed.mass;
    return;
  }
  T frequency = splat<T>(soft_frequency / step.window);
  T bearable = frequency_of(block.late, step.period);
  Mask<T> is_late = pushes & (bearable < frequency * step.window_share);
  frequency = select<T>(is_late, bearable, frequency);
  T damping = select<T>(is_late, splat<T>(slow_damping_ratio), splat<T>(soft_damping_ratio));
  T rate = frequency / (2.0 * damping + h * frequency);
  T softness = rate / (h * frequency * frequency);
  if (any(is_late)) {
    Vec<T> angles = rotated(), soft = softness * Vec<T>{none, compliance[1][1], compliance[2][2]};
    put<T>(is_late,
           NormalRows<T>{soft,
                         rate * Vec<T>{none, dot(angles, block.shape.axis_1),
                                       dot(angles, block.shape.axis_2)},
                         inverse(softened(compliance, soft))},
           relaxed);
    put<T>(is_late, relaxed, pushing);
  }
  T limit = select<T>(is_late, splat<T>(late_push_out_limit), splat<T>(push_out_limit));
  T slowed = min(limit / (rate * depth), splat<T>(1.0));
  pushing.softness[0] = select<T>(pushes, slowed * softness * compliance[0][0], none);
  pushing.bias[0] = select<T>(pushes, block.closing[0] - slowed * rate * depth, pushing.bias[0]);
  pushing.mass = inverse(softened(compliance, pushing.softness));
}

template <class T>
struct Place {
  Arms<T> arms;
  T depth;  // [m]
};
// Where the point of a patch is, and how deep the patch is there.
template <class T, class Body>
BC_INLINE Place<T> place(const Body& a, const Body& b, const Where<T>& at_a, const Where<T>& at_b,
                         double h, const Rows<T>& block) {
  // The patch goes with the body that no force moves, or with the mean of two that are free.
  auto way = [&](const PlacedOf<T>& at, const Vec<T>& local) __attribute__((always_inline)) {
    return (at.position + at.axes * local) - block.point;
  };
  Vec<T> way_a = way(at_a.placed, block.local_a), way_b = way(at_b.placed, block.local_b);
  T share = select<T>(b.inverse_mass > 0.0, splat<T>(0.5), splat<T>(1.0));
  share = select<T>(a.inverse_mass > 0.0, share, T{});
  Vec<T> point = block.point + (1.0 - share) * way_a + share * way_b;
  Vec<T> arm_a = point - at_a.placed.position, arm_b = point - at_b.placed.position;
  return {{arm_a, arm_b, along_chords(a, b, arm_a, arm_b, h)},
          block.asked_depth + dot(way_a - way_b, block.normal)};
}

// The masses of friction and torsion, and how pressing and rocking comply.
template <class T, class Body>
BC_INLINE void weigh(const Body& a, const Body& b, const Rows<T>& block, Masses<T>& masses) {
  const RectangleOf<T>& shape = block.shape;
  const Vec<T>&arm_a = block.arm_a, &arm_b = block.arm_b, &normal = block.normal;
  Vec<T> about = shape.radius * normal;
  Vec<T> lever = block.lever_1 * shape.axis_1 + block.lever_2 * shape.axis_2;
  Vec<T> rubbed_a = arm_a + lever, rubbed_b = arm_b + lever;
  Mat<T> along =
      compliance<2, T>(a, b, {cross(rubbed_a, shape.axis_1), cross(rubbed_a, shape.axis_2), about},
                       {cross(rubbed_b, shape.axis_1), cross(rubbed_b, shape.axis_2), about},
                       {shape.axis_1, shape.axis_2});
  masses.across = compliance<1, T>(a, b, {cross(arm_a, normal), shape.axis_1, shape.axis_2},
                                   {cross(arm_b, normal), shape.axis_1, shape.axis_2}, {normal});
  masses.friction_mass = inverse(along);
  masses.least_friction_mass = 1.0 / max(along[2][2], max(along[1][1], along[0][0]));
}

// Put friction where the patch pressed lately: see store.
template <class T>
BC_INLINE void centre_friction(Rows<T>& block) {
  Vec<T> arm = block.pressure_arm - block.arm_a;
  auto within = [&](const Vec<T>& axis, const SpanOf<T>& span) __attribute__((always_inline)) {
    return select<T>(block.pressure > 0.0, max<T>(min<T>(dot(arm, axis), span.high), span.low), T{});
  };
  block.lever_1 = within(block.shape.axis_1, block.shape.span_1);
  block.lever_2 = within(block.shape.axis_2, block.shape.span_2);
}

// Make the rows of a patch, where its bodies are now.
template <class T, class Body, class Rotated>
BC_INLINE void prepare(const SubSteps& step, const Body& a, const Body& b, const Where<T>& at_a,
                       const Where<T>& at_b, const Rotated& rotated, Rows<T>& block) {
  block.normal_counted = block.friction_counted = {};
  auto [arms, depth] = place(a, b, at_a, at_b, step.length, block);
  static_cast<Arms<T>&>(block) = arms;
  block.depth = depth;
  centre_friction(block);
  weigh<T>(a, b, block, block);
  soften(step, rotated, block);
}

// `still`: rows stay where they are while their bodies turn by no more than this [rad], and slide by no
// more than this part of a patch. `alike`: the same for masses.
constexpr double still = 0x1p-30, alike = 0x1p-10;

// Let the rows go with bodies that have moved: impulses by the arms of before would change the angular
// momentum, and by the inertia of before the energy.
template <class T, class Body>
BC_INLINE void follow(const Body& a, const Body& b, const Where<T>& at_a, const Where<T>& at_b,
                      double h, Rows<T>& block) {
  // What pressed across a gap has closed it, and touches: the rest of its closing speed goes, too. A late answer
  // does not know of it.
  Mask<T> has_met = (block.depth < 0.0) & (block.normal_impulses[0] > 0.0) & (block.late <= 0.0);
  block.relaxed.bias[0] = select<T>(has_met, block.closing[0], block.relaxed.bias[0]);
  T turned = max(length(b.angular), length(a.angular));
  T way = length(b.linear - a.linear);
  T moved = h * max(way / block.shape.half_1, turned);
  Mask<T> goes = moved > still;
  if (!any(goes)) return;
  put<T>(goes, place(a, b, at_a, at_b, -h, block).arms, static_cast<Arms<T>&>(block));
  Mask<T> weighs = moved > alike;
  if (!any(weighs)) return;
  Masses<T> masses;
  weigh(a, b, block, masses);
  put<T>(weighs, masses, static_cast<Masses<T>&>(block));
  put<T>(weighs, inverse(softened(block.across, block.relaxed.softness)), block.relaxed.mass);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
