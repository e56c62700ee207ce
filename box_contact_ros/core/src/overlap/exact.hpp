// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `exact`: the overlap of pairs that touch, by its planes or by clipping.
//
// 1. `press`: pairs at exact touch get their least depth (minimum_depth.hpp).
// 2. The moments of the overlap by the planes that meet it (planes.hpp).
// 3. Once more about the centroid that was found, or by clipping, where that is not certain.
#pragma once

#include "../kernel.hpp"
#include "../minimum_depth.hpp"
#include "../query.hpp"
#include "planes.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::Counts;

// The exact overlap of a single pair that `enforce_minimum_depth` has moved, by clipping; the centroid
// in A's frame.
inline Moments<double> clipped_overlap(Pair<double> pair, int face, bool pressed) {
  if (pressed) enforce_on_further_axes(pair);
  return overlap_by_clipping(pair, face);
}

// The way between the boxes, where pairs at exact touch are pressed in to the minimum depth.
template <class T>
struct Pressed {
  Triple<T> from_a, from_b;  // from each box to the other, in its own frame [m]
  Triple<T> origin_b;        // B's centre, common frame [m]
  T depth;                   // on the best face axis [m]
  Mask<T> moved;             // and touching
  Mask<T> too_shallow;       // along another axis: `enforce_on_further_axes` has work to do

  BC_INLINE explicit Pressed(const Query<T>& q)
      : from_a(q.pair.offset_a),
        from_b(-q.pair.offset_b),
        origin_b(q.pair.origin_b),
        depth(-q.axis.face_gap),
        moved((depth_floor * q.pair.size + q.axis.separation > 0.0) & q.touching),
        too_shallow(moved) {
    if (any(moved)) press(q);
  }

 private:
  [[gnu::noinline]] void press(const Query<T>& q) {
    Pair<T> pair = q.pair;
    moved &= enforce_minimum_depth(pair, q.axis);
    too_shallow = moved & has_too_little_depth(pair);
    from_a = pair.offset_a;
    from_b = -pair.offset_b;
    depth = select<T>(moved, planes::depth_on(pair, q.axis.face), depth);
    T distance = max(depth_floor * pair.size + q.axis.separation, T{});
    origin_b = pair.origin_b - distance * direction_in_common_frame(pair, q.axis.normal);
  }
};

// The overlap of a pair whose planes have been found, with its centroid in the common frame.
template <bool two_sided, class T, class Found>
BC_INLINE Mask<T> overlap_of(const Query<T>& q, const Pressed<T>& pressed,
                             const planes::PairOfBoxes<T>& boxes, Found& found) {
  const Pair<T>& pair = q.pair;
  T depth = max(-q.axis.separation, depth_floor * pair.size);
  Mask<T> certain = overlap_by_planes<two_sided>(pair, boxes, depth, found);
  found.centroid = components<T>(planes::one_of<T>(boxes.p_is_a, pair.origin_a, pressed.origin_b) +
                                 planes::one_of<T>(boxes.p_is_a, pair.axes_a, pair.axes_b) *
                                     triple(found.centroid));
  return certain;
}

// What is not certain of a single pair: once more about the centroid that was found, because sums
// about a point far from a thin overlap cancel. Or by clipping.
template <class Found>
[[gnu::noinline]] void solve_uncertain(Query<double> q, const Vec<double>& near, Found& found,
                                       Counts& counts) {
  Pressed<double> pressed(q);
  planes::PairOfBoxes<double> boxes(q.pair, q.axis);
  planes::find_planes(q.pair, q.axis, pressed.from_a, pressed.from_b, pressed.depth, boxes);
  Columns<double> to_p = transpose(boxes.p_is_a ? q.pair.axes_a : q.pair.axes_b);
  Triple<double> origin = boxes.p_is_a ? q.pair.origin_a : pressed.origin_b;
  planes::move_origin(boxes, to_p * (triple(near) - origin));
  if (!pressed.too_shallow && overlap_of<true>(q, pressed, boxes, found)) return;
  ++counts.clipped;
  enforce_minimum_depth(q.pair, q.axis);
  Moments<double> clipped = clipped_overlap(q.pair, int(q.axis.face), pressed.moved);
  clipped.centroid = components<double>(point_in_common_frame(q.pair, triple(clipped.centroid)));
  found = static_cast<const Found&>(clipped);
}

// Shortest edge [of the size] of boxes whose second moments are sound. Of longer needles and thinner
// plates, rounding may leave a negative eigenvalue.
constexpr double least_edge = 1e-4;

// Keep the covariances of needles and plates free of negative eigenvalues.
template <class T>
BC_INLINE void mend_needles(const Pair<T>& pair, unsigned chosen, Moments<T>& found) {
  Triple<T> least = uniform((0.5 * least_edge) * pair.size);
  unsigned needles = chosen & ~bits(all_of(min(pair.half_a, pair.half_b) >= least));
  for (; needles; needles &= needles - 1) {
    int i = __builtin_ctz(needles);
    Sym<double> covariance = lane(found.covariance, i);
    make_possible(covariance, {infinity, infinity, infinity});
    set_lane(found.covariance, i, covariance);
  }
}
template <class T>
BC_INLINE void mend_needles(const Pair<T>&, unsigned, PointAndVolume<T>&) {}

// The overlaps of the chosen lanes, whose planes have been found.
template <bool two_sided, class T, template <class> class FoundOf>
BC_INLINE void solve_overlaps(const Query<T>& q, const Pressed<T>& pressed,
                              const planes::PairOfBoxes<T>& boxes, unsigned chosen,
                              FoundOf<T>& found, Counts& counts) {
  unsigned certain = bits(overlap_of<two_sided>(q, pressed, boxes, found));
  unsigned uncertain = chosen & (bits(pressed.too_shallow) | ~certain);
  for (; uncertain; uncertain &= uncertain - 1) {
    int i = __builtin_ctz(uncertain);
    FoundOf<Number<T>> one;
    solve_uncertain(lane(q, i), lane(found.centroid, i), one, counts);
    set_lane(found, i, one);
  }
  mend_needles(q.pair, chosen, found);
}
// Not inlined: most pairs do without.
template <class T, class Found>
[[gnu::noinline]] void solve_two_sided(const Query<T>& q, const Pressed<T>& pressed,
                                       const planes::PairOfBoxes<T>& boxes, Found& found,
                                       Counts& counts) {
  solve_overlaps<true>(q, pressed, boxes, bits(q.touching), found, counts);
}

// The overlaps by planes of the pairs that touch. Of W pairs those that have two planes across an axis
// of a box are left, unless they are more than a quarter, or `all` are wanted. Returns which are left.
template <class T, class Found>
[[gnu::noinline]] unsigned solve_by_planes(const Query<T>& q, bool all, Found& found,
                                           Counts& counts) {
  Pressed<T> pressed(q);
  planes::PairOfBoxes<T> boxes(q.pair, q.axis);
  planes::find_planes(q.pair, q.axis, pressed.from_a, pressed.from_b, pressed.depth, boxes);
  unsigned touching = bits(q.touching);
  unsigned two_sided = bits(any_of(boxes.p.both | boxes.q.both)) & touching;
  if (all || 4 * __builtin_popcount(two_sided) > __builtin_popcount(touching)) {
    solve_two_sided(q, pressed, boxes, found, counts);
    return 0;
  }
  solve_overlaps<false>(q, pressed, boxes, touching & ~two_sided, found, counts);
  return two_sided;
}

// A model has three members for lanes T:
//
//   Found<T>: what it finds of an overlap: `Moments<T>`, or `PointAndVolume<T>`.
//   Rest: the model to which it leaves pairs, or void.
//   solve(query, found, counts): fills `found` for the pairs that touch, with the centroid in the
//     common frame. It returns the bits of those that it leaves.

// Model `exact`: the moments of A∩B by the planes that meet it, or by clipping where these are not
// certain. `FoundOf`: Moments, or PointAndVolume. `leaves`: few pairs of W that have two planes across
// an axis wait for others of their kind.
template <template <class> class FoundOf, bool leaves = true>
struct ExactModelOf {
  template <class T>
  using Found = FoundOf<T>;
  using Rest = std::conditional_t<leaves, ExactModelOf<FoundOf, false>, void>;

  template <class T>
  BC_INLINE unsigned solve(const Query<T>& query, Found<T>& found, Counts& counts) const {
    return solve_by_planes(query, !leaves, found, counts);
  }
};

using ExactModel = ExactModelOf<Moments>;
using ExactPointModel = ExactModelOf<PointAndVolume>;

// All moments. What a model does not find is NaN.
template <class T>
BC_INLINE const Moments<T>& all_moments(const Moments<T>& found) {
  return found;
}
template <class T>
BC_INLINE Moments<T> all_moments(const PointAndVolume<T>& found) {
  T unknown = splat<T>(not_a_number);
  return {found, {{unknown, unknown, unknown, unknown, unknown, unknown}}};
}

}  // namespace box_contact::BOX_CONTACT_SET
