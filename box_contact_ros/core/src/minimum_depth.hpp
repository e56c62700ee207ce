// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pressing: the least depth at which the overlap of two boxes has a volume.
//
// At exact touch A∩B has no volume. One box is then moved against the normal, to a depth of
// `depth_floor` of the size. Model `exact` moves B, the second box in the order of the data
// (poses.hpp). The contact point is that of the moved boxes. The separation stays as it was.
#pragma once

#include "separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Least depth [of the size]: the heights of the overlap still have seven good digits there.
constexpr double depth_floor = 1e-9;

// Most moves of `enforce_on_further_axes`: three axes at a corner, and more because they are not at
// right angles.
constexpr int most_presses = 8;

// Enforce the minimum depth along the normal. Returns where a box had to be moved.
template <class T>
BC_INLINE Mask<T> enforce_minimum_depth(Pair<T>& pair, const SeparatingAxis<T>& axis) {
  T distance = max(depth_floor * pair.size + axis.separation, T{});
  move_against(pair, distance, axis.normal);
  return distance > 0.0;
}

struct Gap {
  double gap;             // [m]
  Vec<double> direction;  // unit vector from A to B, in A's frame
};

// The largest gap over the fifteen axes, as the pair stands.
inline Gap largest_gap(const Pair<double>& pair) {
  Gap best{-infinity, {}};
  Vec<double> half_a = components<double>(pair.half_a), half_b = components<double>(pair.half_b);
  Vec<double> offset = components<double>(pair.offset_a);
  Mat<double> rotation = matrix(pair.b_in_a);
  auto offer = [&](const Vec<double>& n) {
    double half_width = dot(abs(n), half_a) + dot(abs(transposed_times(rotation, n)), half_b);
    double along = dot(n, offset), gap = std::fabs(along) - half_width;
    if (gap > best.gap) best = {gap, along >= 0.0 ? n : -n};
  };
  for (int k = 0; k < 3; ++k) offer({k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 1.0 : 0.0});
  for (int k = 0; k < 3; ++k) offer(column(rotation, k));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      int y = (i + 1) % 3, z = (i + 2) % 3;
      Vec<double> n{};
      n[y] = -rotation[z][j];
      n[z] = rotation[y][j];
      double length = std::sqrt(dot(n, n));
      if (length >= parallel) offer((1.0 / length) * n);
    }
  return best;
}

// Go on where `enforce_minimum_depth` has left a pair with less than half of the minimum depth.
// Where a corner touches a corner or an edge, several axes have gap zero: the box is moved along
// each in turn. Returns whether it was moved.
inline bool enforce_on_further_axes(Pair<double>& pair) {
  double floor = depth_floor * pair.size;
  bool moved = false;
  for (int i = 0; i < most_presses; ++i) {
    Gap worst = largest_gap(pair);
    if (!(worst.gap > -0.5 * floor)) break;
    move_against(pair, floor + worst.gap, triple(worst.direction));
    moved = true;
  }
  return moved;
}

// Whether `enforce_on_further_axes` has work to do, for all lanes at once. The widths of edge axes
// are those of the vectors as rounded, as in the separating-axis test.
template <class T>
inline Mask<T> has_too_little_depth(const Pair<T>& pair) {
  BestAxis<T> best;
  Mask<T> doubtful;
  offer_face_axes(pair, best);
  offer_edge_axes(pair, best, doubtful);
  return best.largest() > -0.5 * depth_floor * pair.size;
}

}  // namespace box_contact::BOX_CONTACT_SET
