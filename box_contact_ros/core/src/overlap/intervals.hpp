// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The overlap of parallel boxes: what three intervals have in common.
#pragma once

#include "../minimum_depth.hpp"
#include "moments.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Find the overlap of parallel boxes, pressed in where they are at exact touch.
template <class T, class Found>
BC_INLINE void overlap_by_intervals(const Pair<T>& pair, const Triple<T>& normal, Found& found) {
  PressedIntervals<T> pressed(pair, normal);
  Triple<T> reach = pressed.reach, offset = pressed.offset;
  Triple<T> high = min(pair.half_a, offset + reach), low = max(-pair.half_a, offset - reach);
  // The offset may be rounded by more than a thin plate has.
  Triple<T> width = choose(high > low, high - low, pressed.floor);
  found.volume = (width[0] * width[1]) * width[2];
  found.centroid = components<T>(point_in_common_frame(pair, Triple<T>(0.5 * (high + low))));
  if constexpr (std::is_same_v<Found, Moments<T>>) {
    Triple<T> variance = (1.0 / 12.0) * (width * width);
    found.covariance =
        rotated(pair.axes_a, Sym<T>{{variance[0], variance[1], variance[2], T{}, T{}, T{}}});
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
