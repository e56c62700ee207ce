// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Crossings: points of an edge of A and of an edge of B, along the common normal of both.
//
// If the nearest points are such a crossing, the gap along its normal is the largest of all. So the
// winning axis names the edges, unless rounding decides which: then all 144 pairs of edges are
// tried.
#pragma once

#include "vertices.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace apart {

// Try the edges of the winning axis. A crossing counts if it is within both.
template <class T>
BC_INLINE void try_winning_edges(const Pair<T>& pair, const SeparatingAxis<T>& axis,
                                 NearestPoints<T>& best) {
  Triple<T> zero{}, one = uniform(splat<T>(1.0));
  const Triple<T>&normal = axis.normal, normal_b = pair.a_in_b * normal;
  Flags<T> along_a = is_at<T>(edge_of_a(axis.axis)), along_b = is_at<T>(edge_of_b(axis.axis));
  auto part_along = [&](const Flags<T>& along, const Triple<T>& x) {
    return sum(choose(along, x, zero));
  };
  // The middles of the edges.
  Triple<T> on_a = choose(along_a, zero, choose(normal >= zero, pair.half_a, -pair.half_a));
  Triple<T> on_b = choose(along_b, zero, choose(normal_b >= zero, -pair.half_b, pair.half_b));
  Triple<T> edge = pair.b_in_a * choose(along_b, one, zero);
  Triple<T> across = choose(along_a, zero, edge);
  Triple<T> between = view_of_a(pair).bring(on_b) - on_a;
  T place_b = -dot(between, across) / dot(across, across);
  T place_a = part_along(along_a, between + place_b * edge);
  T length = abs(dot(between, normal));
  Mask<T> within = (abs(place_a) <= part_along(along_a, pair.half_a)) &
                   (abs(place_b) <= part_along(along_b, pair.half_b));
  Mask<T> are_edges = axis.axis >= splat<Index<T>>(first_edge_axis);
  best.take(are_edges & within & (length < best.distance),
            {length, choose(along_a, uniform(place_a), on_a),
             choose(along_b, uniform(place_b), on_b), length * normal});
}

// Try all pairs of edges of a single pair, some side by side.
[[gnu::noinline]] inline void try_all_edges(const Pair<double>& pair, NearestPoints<double>& best) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      // Components along A's edge and the axes that follow; B's edge and those that follow.
      int x[3] = {i, (i + 1) % 3, (i + 2) % 3}, y[3] = {j, (j + 1) % 3, (j + 2) % 3};
      double half_a[3], half_b[3], u[3];
      Vec<Wide> offset, edges[3];
      for (int k = 0; k < 3; ++k) {
        half_a[k] = pair.half_a[x[k]], half_b[k] = pair.half_b[y[k]];
        u[k] = pair.b_in_a[j][x[k]];
        offset[k] = splat<Wide>(pair.offset_a[x[k]]);
        for (int l = 0; l < 3; ++l) edges[k][l] = splat<Wide>(half_b[k] * pair.b_in_a[y[k]][x[l]]);
      }
      double length2 = u[1] * u[1] + u[2] * u[2], length = std::sqrt(length2);
      for (int first = 0; first < 16; first += width<Wide>) {
        Wide side[4];
        for (int k = 0; k < 4; ++k) side[k] = signs(first, k);
        Vec<Wide> between = (offset + side[2] * edges[1]) + side[3] * edges[2];
        between[1] -= side[0] * half_a[1];
        between[2] -= side[1] * half_a[2];
        Wide place_b = -(between[1] * u[1] + between[2] * u[2]) / length2;
        Wide place_a = between[0] + place_b * u[0];
        Wide gap = (between[2] * u[1] - between[1] * u[2]) / length;
        unsigned nearer = bits((abs(place_a) <= splat<Wide>(half_a[0])) &
                               (abs(place_b) <= splat<Wide>(half_b[0])) &
                               (abs(gap) < splat<Wide>(best.distance)));
        for (; nearer; nearer &= nearer - 1) {
          int n = __builtin_ctz(nearer);
          if (!(std::fabs(gap[n]) < best.distance)) continue;
          best.distance = std::fabs(gap[n]);
          Vec<double> on_a, on_b, way;
          double places_a[3] = {place_a[n], side[0][n] * half_a[1], side[1][n] * half_a[2]};
          double places_b[3] = {place_b[n], side[2][n] * half_b[1], side[3][n] * half_b[2]};
          double along[3] = {0.0, -u[2] / length, u[1] / length};
          for (int k = 0; k < 3; ++k) {
            on_a[x[k]] = places_a[k], on_b[y[k]] = places_b[k];
            way[x[k]] = gap[n] * along[k];
          }
          best.on_a = triple(on_a), best.on_b = triple(on_b), best.way = triple(way);
        }
      }
    }
}

}  // namespace apart

}  // namespace box_contact::BOX_CONTACT_SET
