// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `mlp`: SAT decides and gives normal and depth; a multilayer perceptron gives the point, the
// volume and the covariance.
//
// 1. `bounds_by_slab`: a box about A∩B in one of the boxes' frames (overlap/bounds.hpp).
// 2. `describe`, `forward` and `ask`: centroid, volume and covariance in these bounds. Only these run
//    in float32.
// 3. `place`: the point is moved into both boxes.
//
// Guarantees, whatever the weights are:
//
// - The point lies in both boxes, to 2⁻⁴⁶ of the size. `place` ends with a clamp to the box of the
//   bounds' frame, and then tests the point against the other box.
// - The volume is positive, and at most that of the bounds. The covariance is positive definite, but
//   for rounding: it is the inverse of a matrix that is (`ask_for_patch`).
//
// Where the point fails its test, or volume or covariance is NaN, all three are the exact ones, and
// the contact is counted. With trained weights none of 600,000 points of the pose sets fails.
//
// Outside the range that the network was trained for the answer is the exact one, too.
#pragma once

#include "../contact.hpp"
#include "cube_moments.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The range: longest by shortest edge of either box, longest edge of one box by the other's, depth
// by the shortest edge of both. The limits belong to it, rounding included.
constexpr double aspect_max = 20.0, size_ratio_max = 20.0, depth_max = 0.1;
constexpr double range_slack = 1.0 + 1e-9;

// Half extent of the overlap's bounding box [of the size] below which pressing gave it no volume.
constexpr double flat = 0.25 * depth_floor;

// Farthest that an answer is from the middle of the bounds, in half extents. The centroid of a convex
// body is within 0.5 of the middle of its exact bounding box (Bonnesen and Fenchel 1934, §34). Bounds
// by the slab may be larger on one side.
constexpr double centroid_reach = 0.75;

// The point of `place` may lie outside the other box by this fraction of the size.
constexpr double place_tolerance = 0x1p-46;

// The answer [m] from the middle of the bounding box, cut to where a centroid can be.
template <class T>
BC_INLINE Triple<T> within_reach(const OverlapBounds<T>& bounds, const Triple<T>& answer) {
  return bounds.half * clamp(answer, uniform(splat<T>(centroid_reach)));
}

// A point in the bounds' frame [m], and whether it lies in both boxes.
template <class T>
struct Placed {
  Triple<T> point;
  Mask<T> inside;
};

// Move the network's answer into both boxes: twice to the nearest point of the other box, and back
// to the nearest point of the box whose frame it is.
template <class T>
BC_INLINE Placed<T> place(const OverlapBounds<T>& bounds, const Triple<T>& answer, T size) {
  Columns<T> to_other = bounds.other_axes, from_other = transpose(to_other);
  auto in_other = [&](const Triple<T>& point) -> Triple<T> {
    return bounds.other_offset + to_other * (point - bounds.middle);
  };
  Triple<T> point = clamp(bounds.middle + within_reach(bounds, answer), bounds.own_half);
#pragma GCC unroll 2
  for (int round = 0; round < 2; ++round) {
    Triple<T> at = in_other(point), back = clamp(at, bounds.other_half) - at;
    point = clamp(point + from_other * back, bounds.own_half);
  }
  // Each comparison fails for NaN.
  Triple<T> beyond = abs(in_other(point)) - bounds.other_half;
  Mask<T> inside = beyond[0] <= place_tolerance * size;
  inside &= beyond[1] <= place_tolerance * size;
  inside &= beyond[2] <= place_tolerance * size;
  return {point, inside};
}

// Whether the network may be asked: the pair is of the kind that it was trained for, and the
// overlap has a volume.
template <class T>
BC_INLINE Mask<T> in_range(const Pair<T>& pair, T separation, const OverlapBounds<T>& bounds) {
  T long_a = largest(pair.half_a), short_a = smallest(pair.half_a);
  T long_b = largest(pair.half_b), short_b = smallest(pair.half_b);
  // Each quantity by its limit: 1 at the border of the range.
  T excess = max(long_a / (aspect_max * short_a), long_b / (aspect_max * short_b));
  excess = max(excess, max(long_a, long_b) / (size_ratio_max * min(long_a, long_b)));
  excess = max(excess, -separation / (2.0 * depth_max * min(short_a, short_b)));
  return (excess <= range_slack) & (smallest(components<T>(bounds.half)) >= flat * pair.size);
}

// Volume and covariance of the overlap, bounds' frame.
template <class T>
BC_INLINE void scale_patch(const OverlapBounds<T>& bounds, const CubeMoments<T>& said,
                           Moments<T>& found) {
  Vec<T> half = components<T>(bounds.half);
  found.volume = (8.0 * said.volume[0]) * (half[0] * half[1] * half[2]);
  for (int k = 0; k < 3; ++k) {
    found.covariance(k, k) = said.variance[k] * (half[k] * half[k]);
    int i = (k + 1) % 3, j = (k + 2) % 3;
    found.covariance(i, j) = said.covariant[k] * (half[i] * half[j]);
  }
}

// The model for bounds of one method. With `asks_patch` it gives all moments, else the centroid alone.
// By the edges it gives the centroid alone, as it did formerly.
template <Network::Bounds method, bool asks_patch = true>
struct MlpModelBy {
  NetworkView network;

  static constexpr bool gives_patch = asks_patch && method == Network::Bounds::slab;
  template <class T>
  using Found = std::conditional_t<gives_patch, Moments<T>, Vec<T>>;
  // How many queries of T it takes at once: float32 lanes are twice as many.
  template <class T>
  static constexpr int group = is_scalar<T> ? 1 : 2;

  // The bounds of a pressed pair.
  template <class T>
  BC_INLINE static OverlapBounds<T> bounds_of(const Pair<T>& pair, const SeparatingAxis<T>& axis) {
    if constexpr (method == Network::Bounds::edges) {
      return bounds_by_edges(pair);
    } else {
      return bounds_by_slab(pair, axis.normal, max(-axis.separation, depth_floor * pair.size));
    }
  }

  // What it finds, for the pairs that touch.
  template <class T, int count>
  [[gnu::noinline]] void solve(const Query<T> (&queries)[count], Found<T> (&found)[count],
                               Counts& counts) const {
    OverlapBounds<T> bounds[count];
    CutCube<T> cubes[count];
    CubeMoments<T> answers[count];
    Triple<T> pressed_offset[count];
    for (int g = 0; g < count; ++g) {
      Pair<T> pair = queries[g].pair;
      enforce_minimum_depth(pair, queries[g].axis);
      pressed_offset[g] = triple(pair.offset_a);
      bounds[g] = bounds_of(pair, queries[g].axis);
      cubes[g] = cut_cube(bounds[g], pair.size);
    }
    ask<gives_patch ? site_outputs : point_outputs>(network, cubes, answers);
    for (int g = 0; g < count; ++g) {
      const Query<T>& q = queries[g];
      Placed<T> placed = place(bounds[g], answers[g].centroid, q.pair.size);
      Mask<T> answered = in_range(q.pair, q.axis.separation, bounds[g]) & placed.inside;
      Moments<T> one;
      Triple<T> from_b = pressed_offset[g] + columns(q.pair.rotation) * placed.point;
      one.centroid = components<T>(select(bounds[g].in_b, from_b, placed.point));
      if constexpr (gives_patch) {
        scale_patch(bounds[g], answers[g], one);
        answered &= (one.volume > 0.0) & (trace(one.covariance) > 0.0);
        Mat<T> axes = select(bounds[g].in_b, q.pair.axes_b, q.pair.axes_a);
        one.covariance = rotated(axes, one.covariance);
      }
      Mask<T> fallback = (answered == 0) & q.touching;
      if (any(fallback)) {
        for (int i = 0; i < width<T>; ++i) {
          if (!lane(fallback, i)) continue;
          ++counts.exact;
          Counts unused;
          set_lane(one, i, exact_overlap(lane(q, i), unused));
        }
      }
      if constexpr (gives_patch) {
        found[g] = one;
      } else {
        found[g] = one.centroid;
      }
    }
  }
};
// The model that is shipped. Bounds by the edges are kept as a measured baseline.
using MlpModel = MlpModelBy<Network::Bounds::slab>;
using MlpPointModel = MlpModelBy<Network::Bounds::slab, false>;

}  // namespace box_contact::BOX_CONTACT_SET
