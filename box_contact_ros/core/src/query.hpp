// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From poses to a verdict: what a pair is asked for, and what the separating-axis test says of it.
//
// 1. `prepare`: poses and sizes become offsets and a rotation (poses.hpp).
// 2. `separating_axis`: verdict, separation and normal (separating_axis.hpp), again with 32 digits
//    where rounding could decide (near_parallel_edges.hpp).
#pragma once

#include "near_parallel_edges.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Pairs whose axis has been found.
template <class T>
struct Query {
  Pair<T> pair;
  SeparatingAxis<T> axis;
  Mask<T> touching;  // valid and in contact
};

template <class T>
BC_INLINE void query(const Pose<T>& a, const Pose<T>& b, const Vec<T>& half_a, const Vec<T>& half_b,
                     Query<T>& q) {
  prepare(a, b, half_a, half_b, q.pair);
  q.axis = separating_axis(q.pair);
  Mask<T> doubtful = q.axis.doubtful & q.pair.valid;
  if (any(doubtful)) {
    for (int i = 0; i < width<T>; ++i) {
      if (!lane(doubtful, i)) continue;
      bool swapped = lane(q.pair.swapped, i) != 0;
      const Pose<T>&first = swapped ? b : a, &second = swapped ? a : b;
      Pose<double> one_a{lane(first.position, i), {}}, one_b{lane(second.position, i), {}};
      for (int k = 0; k < 4; ++k) {
        one_a.quaternion[k] = lane(first.quaternion[k], i);
        one_b.quaternion[k] = lane(second.quaternion[k], i);
      }
      SeparatingAxis<double> one{lane(q.axis.separation, i), lane(q.axis.axis, i),
                                 lane(q.axis.face, i), triple_of_lane<T>(q.axis.normal, i), true};
      refine(lane(q.pair, i), one_a, one_b, one);
      set_lane(q.axis.separation, i, one.separation);
      set_lane(q.axis.axis, i, one.axis);
      set_triple_of_lane<T>(q.axis.normal, i, components<double>(one.normal));
    }
  }
  q.touching = (q.axis.separation <= q.pair.touch) & q.pair.valid;
}

template <class T>
BC_INLINE Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i),
          {lane(q.axis.separation, i), lane(q.axis.axis, i), lane(q.axis.face, i),
           triple_of_lane<T>(q.axis.normal, i), lane(q.axis.doubtful, i) != 0},
          lane(q.touching, i) != 0};
}

}  // namespace box_contact::BOX_CONTACT_SET
