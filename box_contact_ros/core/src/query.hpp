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

// Evaluate the chosen pairs anew, with 32 digits.
template <class T>
[[gnu::noinline]] void refine(const Pose<T>& a, const Pose<T>& b, unsigned chosen, Query<T>& q) {
  for (; chosen; chosen &= chosen - 1) {
    int i = __builtin_ctz(chosen);
    bool swapped = lane(q.pair.swapped, i) != 0;
    const Pose<T>&first = swapped ? b : a, &second = swapped ? a : b;
    Pose<double> one_a{lane(first.position, i), {}}, one_b{lane(second.position, i), {}};
    for (int k = 0; k < 4; ++k) {
      one_a.quaternion[k] = lane(first.quaternion[k], i);
      one_b.quaternion[k] = lane(second.quaternion[k], i);
    }
    SeparatingAxis<double> one = lane(q.axis, i);
    refine(lane(q.pair, i), one_a, one_b, one);
    set_lane(q.axis.separation, i, one.separation);
    set_lane(q.axis.axis, i, one.axis);
    set_triple_of_lane<T>(q.axis.normal, i, components<double>(one.normal));
  }
}

// Sizes: full extents [m].
template <class T>
BC_INLINE void query(const Pose<T>& a, const Pose<T>& b, const Vec<T>& size_a, const Vec<T>& size_b,
                     Query<T>& q) {
  prepare(a, b, size_a, size_b, q.pair);
  q.axis = separating_axis(q.pair);
  unsigned doubtful = bits(q.axis.doubtful & q.pair.valid);
  if (doubtful) refine(a, b, doubtful, q);
  q.touching = (q.axis.separation <= q.pair.touch) & q.pair.valid;
}

template <class T>
BC_INLINE Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i), lane(q.axis, i), lane(q.touching, i) != 0};
}

}  // namespace box_contact::BOX_CONTACT_SET
