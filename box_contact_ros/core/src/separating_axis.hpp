// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The separating-axis test (SAT): which of 15 axes separates two boxes, or is the shallowest.
//
// Two boxes are disjoint exactly if one of 15 axes separates their projections (Gottschalk, Lin and
// Manocha 1996). The axes are the three face normals of each box and the nine cross products of
// their edges. The gap on a unit axis n is |t·n| − r_A(n) − r_B(n), with t = B − A and r the half
// widths. The largest of the 15 gaps is the separation. For boxes that overlap, its negative is the
// least translation that separates them.
//
// 1. Face axes. Their gaps need the entries of R alone.
// 2. Edge axes, normalised. Each gap is the exact gap along the axis AS ROUNDED: its half widths
//    are those of that very vector, not the textbook's |R| entries. For edges almost parallel the
//    axis is noise, but noise can then only make the overlap deeper, never invent a gap.
// 3. Ties. An axis replaces an earlier one only if its gap is larger by more than `tie`, in the
//    order faces of A, faces of B, edges. Aligned boxes get the normal of a face.
//
// A is the first box in an order of the data (poses.hpp), so no bit depends on what the caller calls A.
#pragma once

#include "poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Gaps closer than this fraction of the size count as equal. The rounding error of a gap is below
// 12 · 2⁻⁵³ of the size, and twice that must not decide.
constexpr double tie = 0x1p-46;

// Edge axes shorter than this (the sine of the angle between the edges) are skipped. A face axis
// separates boxes that share an edge direction, if any axis does. The depth of an overlap changes
// by at most 1e-8 of the size.
constexpr double parallel = 1e-8;

// Sine below which rounding costs an edge axis digits that may matter.
constexpr double almost_parallel = 1e-3;

// Error of a gap times that sine [of the size]. Entries of R are good to 2⁻⁵¹. So at an angle θ the
// axis's direction is good to 2⁻⁵¹/θ. Levers are as long as the size, on both sides.
constexpr double edge_gap_error = 0x1p-47;

// By how many times sine · size a skipped axis may better the best face axis.
constexpr double skipped_gain = 8.0;

// Length of a cross product below which no rotation gives an axis: what it could better is less than
// the rounding of a gap.
constexpr double cross_product_min = 1e-15;

constexpr int first_edge_axis = 6;

template <class T>
struct SeparatingAxis {
  T separation;      // largest gap [m]
  Index<T> axis;     // 0–2 faces of A, 3–5 faces of B, 6 + 3 i + j for a_i × b_j
  Index<T> face;     // best face axis, 0–5, whatever wins
  T face_gap;        // largest gap of all face axes [m]
  Triple<T> normal;  // unit vector along the axis, from A to B, in A's frame
  Mask<T> doubtful;  // rounding of an edge axis may matter: see near_parallel_edges.hpp
};

template <class T>
BC_INLINE SeparatingAxis<double> lane(const SeparatingAxis<T>& axis, int i) {
  return {lane(axis.separation, i), int(lane(axis.axis, i)),           int(lane(axis.face, i)),
          lane(axis.face_gap, i),   triple_of_lane<T>(axis.normal, i), lane(axis.doubtful, i) != 0};
}

// The best axis so far. Axes are offered three at a time. The largest gap is kept apart, because ties
// keep the earlier axis.
template <class T, bool = packed<T>>
struct BestAxis {
  T gap, index, scale, largest_gap;

  // Offer the axes with the indices `first` to `first` + 2. `scales` give their vectors length one.
  BC_INLINE void offer(int first, const Triple<T>& gaps, const Triple<T>& scales, T tolerance) {
    if (first == 0) gap = largest_gap = gaps[0], index = T{}, scale = scales[0];
    for (int k = first == 0; k < 3; ++k)
      offer_one(gaps[k], splat<T>(first + k), scales[k], tolerance);
  }
  BC_INLINE T largest() const { return largest_gap; }
  BC_INLINE Index<T> winner(T) const { return Index<T>(index); }

 private:
  BC_INLINE void offer_one(T candidate_gap, T candidate, T candidate_scale, T tolerance) {
    Mask<T> wins = candidate_gap > gap + tolerance;
    gap = select<T>(wins, candidate_gap, gap);
    index = select<T>(wins, candidate, index);
    scale = select<T>(wins, candidate_scale, scale);
    largest_gap = max(largest_gap, candidate_gap);
  }
};

// Of a single pair the gaps are kept. An axis wins in whatever order they come if its gap exceeds all
// others by more than the tolerance.
template <class T>
struct BestAxis<T, true> {
  Triple<T> offered[5], scales[5], highest;
  int count = 0;

  BC_INLINE void offer(int first, const Triple<T>& gaps, const Triple<T>& their_scales, T) {
    highest = first == 0 ? gaps : max(highest, gaps);
    offered[count] = gaps;
    scales[count++] = their_scales;
  }
  BC_INLINE T largest() const { return largest_in_each(highest)[0]; }
  BC_INLINE int winner(T tolerance) const {
    Triple<T> limit = largest_in_each(highest);
    unsigned near = 0;
    auto note = [&](int n) { near |= (~bits(offered[n] + tolerance < limit) & 7) << (3 * n); };
    for (int n = 0; n < 2; ++n) note(n);
    for (int n = 2; n < 5 && count > 2; ++n) note(n);
    return (near & (near - 1)) == 0 ? __builtin_ctz(near) : first_of_near(tolerance);
  }

 private:
  [[gnu::noinline]] int first_of_near(T tolerance) const {
    T gap = offered[0][0];
    int index = 0;
    for (int n = 0; n < count; ++n)
      for (int k = 0; k < 3; ++k)
        if (offered[n][k] > gap + tolerance) gap = offered[n][k], index = 3 * n + k;
    return index;
  }
};

// The gaps on the face axes of a box: `offset` to the other box along them, its half extents, and the
// other's axes in its frame.
template <class T>
BC_INLINE Triple<T> face_gaps(const Triple<T>& offset, const Triple<T>& half,
                              const Triple<T>& other_half, const Columns<T>& axes) {
  return abs(offset) - (half + abs(axes) * other_half);
}

template <class T>
BC_INLINE void offer_face_axes(const Pair<T>& pair, BestAxis<T>& best) {
  T tolerance = tie * pair.size;
  Triple<T> one = uniform(splat<T>(1.0));
  best.offer(0, face_gaps<T>(pair.offset_a, pair.half_a, pair.half_b, pair.b_in_a), one, tolerance);
  best.offer(3, face_gaps<T>(pair.offset_b, pair.half_b, pair.half_a, pair.a_in_b), one, tolerance);
}

// The edge axes a_i × b_j of one i, by j. In A's frame such an axis is (−u_z, u_y) in the components y
// and z that follow i, with u = b_j.
template <class T>
struct EdgeAxes {
  Triple<T> length2;  // squares of the lengths of the cross products
  Triple<T> overlap;  // gaps times these lengths [m]

  BC_INLINE Triple<T> inverse_lengths() const {
    return each([](auto x) { return 1.0 / sqrt(x); }, length2);
  }
};

// `as_rounded`: B's half widths are those of the axes as rounded, not by the entries of R.
template <bool as_rounded, class T>
BC_INLINE EdgeAxes<T> edge_axes(const Pair<T>& pair, int i) {
  int y = i == 2 ? 0 : i + 1, z = i == 0 ? 2 : i - 1;
  const Triple<T>&half = pair.half_a, &offset = pair.offset_a;
  Triple<T> u = pair.a_in_b[i], uy = pair.a_in_b[y], uz = pair.a_in_b[z];
  // B's axes k and l that follow j.
  Triple<T> on_k = rotated_back(u), on_l = rotated(u);
  if constexpr (as_rounded) {
    on_k = rotated(uz) * uy - rotated(uy) * uz;
    on_l = rotated_back(uz) * uy - rotated_back(uy) * uz;
  }
  Triple<T> width = (half[y] * abs(uz) + half[z] * abs(uy)) +
                    (rotated(pair.half_b) * abs(on_k) + rotated_back(pair.half_b) * abs(on_l));
  return {uy * uy + uz * uz, abs(offset[z] * uy - offset[y] * uz) - width};
}

// Whether no edge axis of a single pair can win over the gap `best` of a face, or is doubtful.
// Overlap divided by length is at most `best` for all nine, which takes no root.
template <class T>
BC_INLINE bool edges_stay_below(const Pair<T>& pair, T best) {
  constexpr double least2 = cross_product_min * cross_product_min, used2 = parallel * parallel;
  constexpr double margin = 1e-12;
  T room = 2.0 * edge_gap_error * pair.size, limit = best * abs(best) - margin * (best * best);
  Triple<T> limits = uniform(limit);
  Flags<T> below = limits == limits;
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) {
    EdgeAxes<T> axes = edge_axes<false>(pair, i);
    Triple<T> overlap = axes.overlap + room;
    below &=
        ((overlap * abs(overlap) <= limits * axes.length2) & (axes.length2 >= uniform(used2))) |
        (axes.length2 < uniform(least2));
  }
  return all_of(below);
}

// Offer the nine edge axes.
template <class T>
BC_INLINE void offer_edge_axes(const Pair<T>& pair, BestAxis<T>& best, Mask<T>& doubtful) {
  if constexpr (packed<T>) {
    if (edges_stay_below(pair, best.largest())) {
      doubtful = false;
      return;
    }
  }
  T tolerance = tie * pair.size, error = edge_gap_error * pair.size;
  Triple<T> largest_possible = uniform(splat<T>(-infinity)), longest_skipped2{};
  for (int i = 0; i < opaque(3); ++i) {
    EdgeAxes<T> axes = edge_axes<true>(pair, i);
    Triple<T> length2 = axes.length2, inverse = axes.inverse_lengths();
    auto if_used = [](auto gap, auto length2) {
      return select<decltype(gap)>(length2 >= parallel * parallel, gap,
                                   splat<decltype(gap)>(-infinity));
    };
    auto if_inaccurate = [](auto gap, auto length2) {
      constexpr double least2 = parallel * parallel, most2 = almost_parallel * almost_parallel;
      return select<decltype(gap)>((length2 >= least2) & (length2 < most2), gap,
                                   splat<decltype(gap)>(-infinity));
    };
    auto if_skipped = [](auto length2) {
      using N = decltype(length2);
      return select<N>(length2 >= parallel * parallel, N{}, length2);
    };
    largest_possible =
        max(largest_possible, each(if_inaccurate, (axes.overlap + error) * inverse, length2));
    longest_skipped2 = max(longest_skipped2, each(if_skipped, length2));
    best.offer(first_edge_axis + 3 * i, each(if_used, axes.overlap * inverse, length2), inverse,
               tolerance);
  }
  T gap = best.largest(), reach = skipped_gain * pair.size, skipped2 = largest(longest_skipped2);
  Mask<T> skipped_may_win = (skipped2 > cross_product_min * cross_product_min) &
                            ((gap >= 0.0) | (gap * gap < reach * reach * skipped2));
  doubtful = (gap <= pair.touch) & ((largest(largest_possible) > gap) | skipped_may_win);
}

// The edges of A and of B, 0 to 2, of the edge axis with an index.
BC_INLINE int edge_of_a(int index) {
  static constexpr int8_t edges[15] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2};
  return edges[index];
}
BC_INLINE int edge_of_b(int index) {
  static constexpr int8_t edges[15] = {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2};
  return edges[index];
}
template <class T>
BC_INLINE T edge_of_a(T index) {
  return select<T>(index < double(first_edge_axis + 3), T{},
                   select<T>(index < double(first_edge_axis + 6), splat<T>(1.0), splat<T>(2.0)));
}
template <class T>
BC_INLINE T edge_of_b(T index) {
  return (index - double(first_edge_axis)) - 3.0 * edge_of_a(index);
}

// The winning axis, with its index, as a unit vector from A to B, in A's frame.
template <class T>
BC_INLINE Triple<T> axis_normal(const Pair<T>& pair, const BestAxis<T, false>& best, Index<T>) {
  T index = best.index;
  // A face of A or of B: a unit vector, or a column of R.
  Vec<T> face{};
  T face_offset{};
  for (int k = 0; k < 3; ++k) {
    Mask<T> of_a = index == double(k), of_b = index == double(3 + k);
    face_offset = select<T>(of_a, pair.offset_a[k], select<T>(of_b, pair.offset_b[k], face_offset));
    face = select(of_b, components<T>(pair.b_in_a[k]), face);
    face[k] = select<T>(of_a, splat<T>(1.0), face[k]);
  }
  // A pair of edges.
  T i = edge_of_a(index), j = edge_of_b(index);
  Vec<T> u;
  for (int k = 0; k < 3; ++k) {
    const Triple<T>& edges = pair.a_in_b[k];
    u[k] = select<T>(j == 0.0, edges[0], select<T>(j == 1.0, edges[1], edges[2]));
  }
  Vec<T> n;
  n[0] = select<T>(i == 0.0, T{}, select<T>(i == 1.0, u[2], -u[1]));
  n[1] = select<T>(i == 0.0, -u[2], select<T>(i == 1.0, T{}, u[0]));
  n[2] = select<T>(i == 0.0, u[1], select<T>(i == 1.0, -u[0], T{}));

  Mask<T> edges = index >= double(first_edge_axis);
  T along = select<T>(edges, dot(components<T>(pair.offset_a), n), face_offset);
  T side = select<T>(along >= 0.0, splat<T>(1.0), splat<T>(-1.0));
  return triple(select(edges, (side * best.scale) * n, side * face));
}

// The same for a single pair whose triples are vectors of the machine.
template <class T>
BC_INLINE Triple<T> axis_normal(const Pair<T>& pair, const BestAxis<T, true>& best, int index) {
  int group = index / 3, k = index % 3;
  Triple<T> zero{}, n, offset = pair.offset_a;
  T along;
  if (index < 6) {
    n = select(index < 3, choose(is_at<T>(k), uniform(1.0), zero), pair.b_in_a[k]);
    along = pick(index < 3, pair.offset_a, pair.offset_b)[k];
  } else {
    int i = group - 2, y = (i + 1) % 3, z = (i + 2) % 3;
    Triple<T> u = pair.b_in_a[k];
    n = choose(is_at<T>(y), -rotated(u), choose(is_at<T>(z), rotated_back(u), zero));
    along = dot(offset, n);
  }
  T scale = best.scales[group][k];
  return (along >= 0.0 ? scale : -scale) * n;
}

// The number of an axis when the boxes change names.
BC_INLINE int swapped_axis(int axis) {
  static constexpr int8_t swapped[15] = {3, 4, 5, 0, 1, 2, 6, 9, 12, 7, 10, 13, 8, 11, 14};
  return swapped[axis];
}
template <class T>
BC_INLINE T swapped_axis(T axis) {
  T i = edge_of_a(axis), j = edge_of_b(axis);
  T face = select<T>(axis < 3.0, axis + 3.0, axis - 3.0);
  return select<T>(axis < double(first_edge_axis), face, (double(first_edge_axis) + 3.0 * j) + i);
}

template <class T>
BC_INLINE SeparatingAxis<T> separating_axis(const Pair<T>& pair) {
  T tolerance = tie * pair.size;
  BestAxis<T> best;
  offer_face_axes(pair, best);
  SeparatingAxis<T> found;
  found.face = best.winner(tolerance);
  found.face_gap = best.largest();
  offer_edge_axes(pair, best, found.doubtful);
  found.separation = best.largest();
  found.axis = best.winner(tolerance);
  found.normal = axis_normal(pair, best, found.axis);
  return found;
}

}  // namespace box_contact::BOX_CONTACT_SET
