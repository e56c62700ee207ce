// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The distance and the nearest points of two boxes apart: candidates in closed form, proved by a
// gap.
//
// 1. Parallel edges: boxes are cut down to slices (slices.hpp).
// 2. The nearest vertex of either box (vertices.hpp), and the crossing of the winning edges
//    (crossings.hpp).
// 3. Proof. No points are nearer than a gap along any direction. So the candidate is nearest if
//    the separation, or the gap along the way between its points, is as large as its distance.
// 4. Pairs that are left, one by one: faces that oblique edges are parallel to (facing.hpp); and
//    all pairs of edges where the proof fails. Which edges the winning axis names depends on the
//    signs of R's entries. Where those are rounding, it may name others than the nearest. Of a vertex of
//    either box that are equally near but for rounding, the one is taken that is proved.
#pragma once

#include "../query.hpp"
#include "crossings.hpp"
#include "facing.hpp"
#include "slices.hpp"
#include "vertices.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace apart {

// By how much a gap may stay below the distance that it proves [of the size and of the way between
// the centres]: the rounding of both.
constexpr double proof_tolerance = 0x1p-50;

template <class T>
BC_INLINE Mask<T> is_proved(const Pair<T>& pair, const SeparatingAxis<T>& axis,
                            const NearestPoints<T>& found) {
  T tolerance = proof_tolerance * pair.size + proof_tolerance * sum(abs(pair.offset_a));
  // Not divided by the length of the way, so it holds for the least of gaps.
  const Triple<T>&way = found.way, way_b = pair.a_in_b * way;
  T gap = (dot(pair.offset_a, way) - dot(pair.half_a, abs(way))) - dot(pair.half_b, abs(way_b));
  return (found.distance <= axis.separation + tolerance) |
         (gap >= found.distance * (found.distance - tolerance));
}

// Find the centroid on the winning face of a single pair.
inline bool find_centroid(const Pair<double>& pair, const SeparatingAxis<double>& axis,
                          NearestPoints<double>& found) {
  double slack = proof_tolerance * (pair.size + sum(abs(pair.offset_a)));
  Vec<double> on_a, on_b;
  bool is_there = axis.axis < 3 ? find_facing(view_of_a(pair), axis.axis, slack, on_a, on_b)
                                : find_facing(view_of_b(pair), axis.axis - 3, slack, on_b, on_a);
  if (is_there)
    found = {axis.separation, triple(on_a), triple(on_b), axis.separation * axis.normal};
  return is_there;
}

// Take a vertex that is as near as the points found, and is proved: near edges that are almost parallel
// rounding chooses the other box's, and the way from there is not across both.
inline void take_proved_vertex(const Pair<double>& pair, const SeparatingAxis<double>& axis,
                               NearestPoints<double>& found) {
  double slack = proof_tolerance * (pair.size + sum(abs(pair.offset_a)));
  for (const NearestPoints<double>& other : {nearest_vertex_of_a(pair), nearest_vertex_of_b(pair)})
    if (other.distance <= found.distance + slack && is_proved(pair, axis, other)) {
      found = other;
      return;
    }
}

// Find what steps 1 to 3 leave of a pair.
[[gnu::noinline]] inline void finish(const Pair<double>& pair, const SeparatingAxis<double>& axis,
                                     bool is_facing, NearestPoints<double>& found) {
  if (is_facing && find_centroid(pair, axis, found)) return;
  if (is_proved(pair, axis, found)) return;
  try_all_edges(pair, found);
  if (!is_proved(pair, axis, found)) take_proved_vertex(pair, axis, found);
}

}  // namespace apart

// Find the nearest points of the pairs that `wanted` has a bit for: valid ones that do not touch.
// The points are in the frames of `pair`, whose origins it may move.
template <class T>
BC_INLINE NearestPoints<T> nearest_points(const SeparatingAxis<T>& axis, unsigned wanted,
                                          Pair<T>& pair) {
  Mask<T> parallel = apart::has_parallel_features(pair), facing = parallel;
  if (any(parallel)) {
    apart::Directions<T> shared(pair.b_in_a);
    facing = parallel & apart::faces_oblique_edge(axis, shared);
    apart::cut_to_slices(parallel, shared, pair);
  }
  NearestPoints<T> found = apart::try_vertices(pair);
  if (any(axis.axis >= splat<Index<T>>(first_edge_axis)))
    apart::try_winning_edges(pair, axis, found);
  Mask<T> proved = apart::is_proved(pair, axis, found);
  for (unsigned left = (~bits(proved) | bits(facing)) & wanted; left; left &= left - 1) {
    int i = __builtin_ctz(left);
    NearestPoints<double> one = lane(found, i);
    apart::finish(lane(pair, i), lane(axis, i), lane(facing, i) != 0, one);
    set_lane(found, i, one);
  }
  // The separation is a bound, rounding included.
  found.distance = max(found.distance, axis.separation);
  return found;
}

}  // namespace box_contact::BOX_CONTACT_SET
