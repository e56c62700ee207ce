// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pressing: the least depth at which the overlap of two boxes has a volume.
//
// At exact touch A∩B has no volume. One box is then moved against the normal, to a depth of
// `depth_floor` of the size. Where a corner touches a corner or an edge, several axes have gap zero.
// While any axis has less than half of that depth, the box is moved on, against the normal that the
// separating-axis test gives for the boxes as they stand. Model `exact` moves B, the second box in the
// order of the data (poses.hpp). The contact point is that of the moved boxes. The separation stays as
// it was.
#pragma once

#include "separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Least depth [of the size]: the heights of the overlap still have seven good digits there.
constexpr double depth_floor = 1e-9;

// Most moves: three axes at a corner, and more because they are not at right angles.
constexpr int most_presses = 9;

// Where some axis has less than half of the minimum depth. No winner is chosen.
template <class T>
BC_INLINE Mask<T> has_too_little_depth(const Pair<T>& pair) {
  BestAxis<T> best;
  Mask<T> doubtful;
  offer_face_axes(pair, best);
  offer_edge_axes(pair, best, doubtful);
  return best.largest() > -0.5 * depth_floor * pair.size;
}

// Move B of the pairs `moved` to the minimum depth. `axis`: of the pairs as they are given.
template <class T>
BC_INLINE void enforce_minimum_depth(Pair<T>& pair, SeparatingAxis<T> axis, Mask<T> moved) {
  for (int i = 0; i < most_presses; ++i) {
    T distance = select<T>(moved, depth_floor * pair.size + axis.separation, T{});
    pair.offset_a = pair.offset_a - distance * axis.normal;
    pair.offset_b = pair.offset_b - distance * (pair.a_in_b * axis.normal);
    moved &= has_too_little_depth(pair);
    if (!any(moved)) return;
    axis = separating_axis(pair);
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
