// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The overlap of parallel boxes: what three intervals have in common.
#pragma once

#include "../minimum_depth.hpp"
#include "moments.hpp"

namespace box_contact::BOX_CONTACT_SET {

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

// Find the overlap of parallel boxes. It is pressed in as `enforce_minimum_depth` does: to the minimum
// depth along the normal, and along the axes on which less than half of it is left. Plates thinner than
// the minimum depth are pressed in to their thickness, and not through each other.
template <class T, class Found>
BC_INLINE void overlap_by_intervals(const Pair<T>& pair, const Triple<T>& normal, Found& found) {
  Triple<T> zero{}, offset = pair.offset_a, reach = abs(pair.b_in_a) * pair.half_b;
  Triple<T> depth = (pair.half_a + reach) - abs(offset);
  Triple<T> floor = min(uniform(T(depth_floor * pair.size)), 2.0 * min(pair.half_a, reach));
  Flags<T> is_normal = abs(normal) > uniform(splat<T>(0.5));
  Flags<T> is_shallow = choose(is_normal, floor, 0.5 * floor) > depth;
  Triple<T> closer = choose(is_shallow, floor - depth, zero);
  offset = offset - choose(offset >= zero, closer, -closer);
  Triple<T> high = min(pair.half_a, offset + reach), low = max(-pair.half_a, offset - reach);
  // The offset may be rounded by more than a thin plate has.
  Triple<T> width = choose(high > low, high - low, floor);
  found.volume = (width[0] * width[1]) * width[2];
  found.centroid = components<T>(point_in_common_frame(pair, Triple<T>(0.5 * (high + low))));
  if constexpr (std::is_same_v<Found, Moments<T>>) {
    Triple<T> variance = (1.0 / 12.0) * (width * width);
    found.covariance =
        rotated(pair.axes_a, Sym<T>{{variance[0], variance[1], variance[2], T{}, T{}, T{}}});
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
