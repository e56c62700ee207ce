// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `exact`: the overlap of pairs that touch.
//
// 1. Parallel boxes: by intervals (intervals.hpp).
// 2. Others, pressed in where they are at exact touch: by the planes that meet the overlap
//    (overlap_by_planes.hpp).
// 3. Where that is not certain: once more about the centroid that was found where digits have
//    cancelled, else by clipping (clipping.hpp).
#pragma once

#include "../minimum_depth.hpp"
#include "../query.hpp"
#include "clipping.hpp"
#include "intervals.hpp"
#include "overlap_by_planes.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The way between the boxes, where pairs at exact touch are pressed in to the minimum depth.
template <class T>
struct Pressed {
  Triple<T> from_a, from_b;  // from each box to the other, in its own frame [m]
  Triple<T> origin_b;        // B's centre, common frame [m]
  T depth;                   // on the best face axis [m]

  BC_INLINE explicit Pressed(const Query<T>& q)
      : from_a(q.pair.offset_a),
        from_b(-q.pair.offset_b),
        origin_b(q.pair.origin_b),
        depth(-q.axis.face_gap) {
    Mask<T> shallow = are_shallow(q.pair, q.axis) & q.touching;
    if (any(shallow)) press(q, shallow);
  }

 private:
  BC_INLINE void press(const Query<T>& q, Mask<T> shallow) {
    Pair<T> pair = q.pair;
    enforce_minimum_depth(pair, q.axis, shallow);
    from_a = pair.offset_a;
    from_b = -pair.offset_b;
    depth = select<T>(shallow, planes::depth_on(pair, q.axis.face), depth);
    origin_b = origin_b - pair.axes_a * Triple<T>(q.pair.offset_a - pair.offset_a);
  }
};

// The depth that an overlap has at least [m], for its accuracy.
template <class T>
BC_INLINE T pressed_depth(const Query<T>& q) {
  return max(-q.axis.separation, depth_floor * q.pair.size);
}

// Find the overlap of a single pair by sums about a point near it. Returns whether they are right.
template <class Found>
bool find_about(const Query<double>& q, const Pressed<double>& pressed, const Vec<double>& near,
                Found& found) {
  planes::PairOfBoxes<double> boxes(q.pair, q.axis, pressed.from_a, pressed.from_b, pressed.depth);
  Columns<double> to_p = transpose(boxes.p_is_a ? q.pair.axes_a : q.pair.axes_b);
  Triple<double> origin = boxes.p_is_a ? q.pair.origin_a : pressed.origin_b;
  boxes.take_sums_about(to_p * (triple(near) - origin));
  return overlap_by_planes<true>(q.pair, boxes, pressed.origin_b, pressed_depth(q), found).holds;
}

// The overlap of a single pair that is not certain. Where sums about a point far from a thin overlap
// have cancelled, they are taken once more about the centroid that was found. Others are clipped: a piece
// is lost, or too long a lever moves its end, about any point.
template <class Found>
[[gnu::noinline]] void solve_uncertain(Query<double> q, const Vec<double>& near, bool cancelled,
                                       Found& found) {
  Pressed<double> pressed(q);
  if (cancelled && find_about(q, pressed, near, found)) return;
  q.pair.offset_a = pressed.from_a;
  q.pair.offset_b = -pressed.from_b;
  found = overlap_by_clipping<Found>(q.pair, int(q.axis.face));
}

// Shortest edge [of the size] of boxes whose second moments are sound. Of longer needles and thinner
// plates, rounding may leave a negative eigenvalue.
constexpr double least_edge = 1e-4;

// Keep the covariances of needles and plates free of negative eigenvalues.
template <class T, class Found>
BC_INLINE void mend_needles(const Pair<T>& pair, unsigned chosen, Found& found) {
  if constexpr (std::is_same_v<Found, Moments<T>>) {
    Triple<T> least = uniform((0.5 * least_edge) * pair.size);
    unsigned needles = chosen & ~bits(all_of(min(pair.half_a, pair.half_b) >= least));
    for (; needles; needles &= needles - 1) {
      int i = __builtin_ctz(needles);
      Sym<double> covariance;
      copy_lane<T, double>(found.covariance, i, covariance, 0);
      make_possible(covariance, {infinity, infinity, infinity});
      copy_lane<double, T>(covariance, 0, found.covariance, i);
    }
  }
}

// The overlaps of the chosen lanes, whose planes have been found.
template <bool two_sided, class T, template <class> class FoundOf>
BC_INLINE void solve_chosen(const Query<T>& q, const Pressed<T>& pressed,
                            const planes::PairOfBoxes<T>& boxes, unsigned chosen,
                            FoundOf<T>& found) {
  auto certificate =
      overlap_by_planes<two_sided>(q.pair, boxes, pressed.origin_b, pressed_depth(q), found);
  for (unsigned uncertain = chosen & ~bits(certificate.holds); uncertain;
       uncertain &= uncertain - 1) {
    int i = __builtin_ctz(uncertain);
    Vec<double> near;
    copy_lane<T, double>(found.centroid, i, near, 0);
    FoundOf<double> one;
    solve_uncertain(lane(q, i), near, lane(certificate.cancelled, i) != 0, one);
    copy_lane<double, T>(one, 0, found, i);
  }
  mend_needles(q.pair, chosen, found);
}
// Not inlined: most pairs do without.
template <class T, class Found>
[[gnu::noinline]] void solve_two_sided(const Query<T>& q, const Pressed<T>& pressed,
                                       const planes::PairOfBoxes<T>& boxes, unsigned chosen,
                                       Found& found) {
  solve_chosen<true>(q, pressed, boxes, chosen, found);
}
template <class T, class Found>
[[gnu::noinline]] void solve_parallel(const Query<T>& q, Mask<T> chosen, Found& found) {
  Found parallel;
  overlap_by_intervals(q.pair, q.axis.normal, parallel);
  mend_needles(q.pair, bits(chosen), parallel);
  put<T>(chosen, parallel, found);
}

// A model has three members for lanes T:
//
//   Found<T>: what it finds of an overlap: `Moments<T>`, or `PointAndVolume<T>`.
//   solve(query, found): fills `found` for the pairs that touch. It returns the bits of those that it
//     leaves; it leaves no pair alone.
//   solve_left(query, found): the same for pairs that were left, side by side; it leaves none.
//
// A model that leaves none may solve two blocks of pairs at once: `solves_two_blocks` says so. It then
// has solve_two(query, other, found, other_found) in their place, and `solve` for a pair alone.

// Model `exact`. `FoundOf`: Moments, or PointAndVolume. Of W pairs it leaves those that have two planes
// across an axis of a box, where these are at most a quarter: they take longer, and are solved together.
template <template <class> class FoundOf>
struct ExactModelOf {
  static constexpr bool solves_two_blocks = false;

  template <class T>
  using Found = FoundOf<T>;

  template <class T>
  BC_INLINE unsigned solve(const Query<T>& query, Found<T>& found) const {
    return solve_overlaps(query, false, found);
  }
  template <class T>
  BC_INLINE void solve_left(const Query<T>& query, Found<T>& found) const {
    solve_overlaps(query, true, found);
  }

 private:
  // `all`: leave none.
  template <class T>
  [[gnu::noinline]] static unsigned solve_overlaps(const Query<T>& q, bool all, Found<T>& found) {
    Mask<T> parallel = are_parallel(q.pair) & q.touching;
    unsigned chosen = bits(q.touching) & ~bits(parallel), left = 0;
    if (chosen) {
      Pressed<T> pressed(q);
      planes::PairOfBoxes<T> boxes(q.pair, q.axis, pressed.from_a, pressed.from_b, pressed.depth);
      unsigned two_sided = bits(any_of(boxes.p.both | boxes.q.both)) & chosen;
      if (all || 4 * __builtin_popcount(two_sided) > __builtin_popcount(chosen)) {
        solve_two_sided(q, pressed, boxes, chosen, found);
      } else {
        solve_chosen<false>(q, pressed, boxes, chosen & ~two_sided, found);
        left = two_sided;
      }
    }
    if (any(parallel)) solve_parallel(q, parallel, found);
    return left;
  }
};

using ExactModel = ExactModelOf<Moments>;
using ExactPointModel = ExactModelOf<PointAndVolume>;

}  // namespace box_contact::BOX_CONTACT_SET
