// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pressing: the least depth at which the overlap of two boxes has a volume.
//
// At exact touch A∩B has no volume. One box is then moved against the normal, to a depth of
// `depth_floor` of the size. Where a corner touches a corner or an edge, several axes have gap zero.
// While any axis has less than half of that depth, the box is moved on, against the normal that the
// separating-axis test gives for the boxes as they stand. All models move B, the second box in the
// order of the data (poses.hpp). The contact point is that of the moved boxes. The separation stays as
// it was. Of parallel boxes all moves together have a closed form.
#pragma once

#include "separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Least depth [of the size]: the heights of the overlap still have seven good digits there.
constexpr double depth_floor = 1e-9;

// Most moves: three axes at a corner, and more because they are not at right angles.
constexpr int most_presses = 9;

// Angle up to which boxes count as parallel [rad]. It changes a height by a tenth of what rounding may.
constexpr double parallel_boxes = 1e-15;
// Cosine that tells a turn by right angles from a turn by 45 degrees.
constexpr double along_an_axis = 0.9;

// Where each axis of a box is along one of the other.
template <class T>
BC_INLINE Mask<T> are_parallel(const Pair<T>& pair) {
  auto across_or_along = [](const Triple<T>& x) {
    return (uniform(splat<T>(parallel_boxes)) >= abs(x)) |
           (abs(x) >= uniform(splat<T>(along_an_axis)));
  };
  const Columns<T>& r = pair.b_in_a;
  return all_of(across_or_along(r[0]) & across_or_along(r[1]) & across_or_along(r[2]));
}

// Parallel boxes, pressed in: to the minimum depth along the normal, and along the axes on which less
// than half of it is left. Plates thinner than the minimum depth are pressed in to their thickness, and
// not through each other.
template <class T>
struct PressedIntervals {
  Triple<T> reach;   // B's half extents along A's axes [m]
  Triple<T> floor;   // least overlap along each axis [m]
  Triple<T> offset;  // from A to B, in A's frame [m]

  BC_INLINE PressedIntervals(const Pair<T>& pair, const Triple<T>& normal)
      : reach(abs(pair.b_in_a) * pair.half_b) {
    Triple<T> zero{}, depth = (pair.half_a + reach) - abs(pair.offset_a);
    floor = min(uniform(T(depth_floor * pair.size)), 2.0 * min(pair.half_a, reach));
    Flags<T> is_normal = abs(normal) > uniform(splat<T>(0.5));
    Flags<T> is_shallow = choose(is_normal, floor, 0.5 * floor) > depth;
    Triple<T> closer = choose(is_shallow, floor - depth, zero);
    offset = pair.offset_a - choose(pair.offset_a >= zero, closer, -closer);
  }
};

// Where some axis has less than half of the minimum depth. No winner is chosen.
template <class T>
BC_INLINE Mask<T> has_too_little_depth(const Pair<T>& pair) {
  BestAxis<T> best;
  Mask<T> doubtful;
  offer_face_axes(pair, best);
  offer_edge_axes(pair, best, doubtful);
  return best.largest() > -0.5 * depth_floor * pair.size;
}

// Where pairs have less than the minimum depth along the normal.
template <class T>
BC_INLINE Mask<T> are_shallow(const Pair<T>& pair, const SeparatingAxis<T>& axis) {
  return depth_floor * pair.size + axis.separation > 0.0;
}

// Move B of the pairs `moved` to the minimum depth. `axis`: of the pairs as they are given. Not inlined:
// most pairs do without.
template <class T>
[[gnu::noinline]] void enforce_minimum_depth(Pair<T>& pair, SeparatingAxis<T> axis, Mask<T> moved) {
  Mask<T> parallel = are_parallel(pair) & moved;
  if (any(parallel)) {
    Triple<T> offset = PressedIntervals<T>(pair, axis.normal).offset;
    Triple<T> moves = select(parallel, pair.offset_a - offset, Triple<T>{});
    pair.offset_a = pair.offset_a - moves;
    pair.offset_b = pair.offset_b - pair.a_in_b * moves;
    moved = moved & !parallel;
  }
  for (int i = 0; i < most_presses && any(moved); ++i) {
    if (i > 0) axis = separating_axis(pair);
    T distance = select<T>(moved, depth_floor * pair.size + axis.separation, T{});
    pair.offset_a = pair.offset_a - distance * axis.normal;
    pair.offset_b = pair.offset_b - distance * (pair.a_in_b * axis.normal);
    moved &= has_too_little_depth(pair);
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
