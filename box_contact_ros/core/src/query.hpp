// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From poses to a verdict: what a pair is asked for, and what the separating-axis test says of it.
//
// 1. `prepare`: poses and sizes become offsets and a rotation (poses.hpp).
// 2. `separating_axis`: verdict, separation and normal (separating_axis.hpp), again from a more precise
//    rotation where rounding could decide (near_parallel_edges.hpp).
#pragma once

#include "lanes/floats.hpp"
#include "near_parallel_edges.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Pairs whose axis has been found.
template <class T>
struct Query {
  Pair<T> pair;
  SeparatingAxis<T> axis;
  Mask<T> touching;  // valid and in contact
};
// What a network is asked together: a pair alone, or two blocks of pairs.
template <class T>
using Queries = const Query<T>* const (&)[blocks_together<T>];

// Not inlined: most pairs do without.
template <class T>
[[gnu::noinline]] void refine(const Pose<T>& a, const Pose<T>& b, Query<T>& q) {
  find_precise_axis(q.pair, a, b, q.axis);
}

// Sizes: full extents [m].
template <class T>
BC_INLINE void query(const Pose<T>& a, const Pose<T>& b, const Vec<T>& size_a, const Vec<T>& size_b,
                     Query<T>& q) {
  prepare(a, b, size_a, size_b, q.pair);
  q.axis = separating_axis(q.pair);
  if (any(q.axis.doubtful & q.pair.valid)) refine(a, b, q);
  q.touching = (q.axis.separation <= q.pair.touch) & q.pair.valid;
}

template <class T>
BC_INLINE Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i), lane(q.axis, i), lane(q.touching, i) != 0};
}

}  // namespace box_contact::BOX_CONTACT_SET
