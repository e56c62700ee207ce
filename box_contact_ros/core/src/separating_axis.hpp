// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The separating-axis test (SAT): which of 15 axes separates two boxes, or is the shallowest.
//
// Two boxes are disjoint exactly if one of 15 axes separates their projections: the three face
// normals of each box and the nine cross products of their edges (Gottschalk, Lin and Manocha
// 1996). The gap on a unit axis n is |t·n| − r_A(n) − r_B(n), with t = B − A and r the half widths.
// The largest of the 15 gaps is the separation. For boxes that overlap, its negative is the least
// translation that separates them.
//
// 1. Face axes. Their gaps need the entries of R alone.
// 2. Edge axes, normalised. Each gap is the exact gap along the axis AS ROUNDED: its half widths
//    are those of that very vector, not the textbook's |R| entries. For edges almost parallel the
//    axis is noise, but noise can then only make the overlap deeper, never invent a gap.
// 3. Ties. An axis replaces an earlier one only if its gap is larger by more than `tie`, in the
//    order faces of A, faces of B, edges. Aligned boxes get the normal of a face.
//
// The separation has the same bits when A and B are swapped: face gaps are symmetric formulas, and
// edge gaps are evaluated in the frame of the box that comes first in an order of the data.
#pragma once

#include "poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Gaps closer than this fraction of the size count as equal: the rounding error of a gap is below
// 12 · 2⁻⁵³ of the size, and twice that must not decide.
constexpr double tie = 0x1p-46;

// Edge axes shorter than this (the sine of the angle between the edges) are skipped. Boxes that
// share an edge direction are separated by a face axis if at all. Of an overlap, at most 1e-8 of
// the size is lost.
constexpr double parallel = 1e-8;

// Sine below which rounding costs an edge axis digits that may matter.
constexpr double almost_parallel = 1e-3;

// Error of a gap times that sine [of the size]: entries of R are good to 2⁻⁵¹, so at an angle θ the
// axis's direction is good to 2⁻⁵¹/θ, and levers are up to the size on both sides.
constexpr double edge_gap_error = 0x1p-47;

// By how many times sine · size a skipped axis may better the best face axis.
constexpr double skipped_gain = 8.0;

// Length of a cross product below which even double-double finds no axis: what it could better is
// less than the rounding of a gap.
constexpr double cross_product_min = 1e-15;

constexpr int first_edge_axis = 6;

template <class T>
struct SeparatingAxis {
  T separation;      // largest gap [m]
  T axis;            // 0–2 faces of A, 3–5 faces of B, 6 + 3 i + j for a_i × b_j
  T face;            // best face axis, 0–5, whatever wins
  Vec<T> normal;     // unit vector along the axis, from A to B, in A's frame
  Mask<T> doubtful;  // rounding of an edge axis may matter: see near_parallel_edges.hpp
};

// The best axis so far. The largest gap is kept apart, because ties keep the earlier axis.
template <class T>
struct BestAxis {
  T gap, axis, largest_gap;

  BC_INLINE void offer(T candidate_gap, T candidate, T tolerance) {
    Mask<T> wins = candidate_gap > gap + tolerance;
    gap = select<T>(wins, candidate_gap, gap);
    axis = select<T>(wins, candidate, axis);
    largest_gap = max(largest_gap, candidate_gap);
  }
};

// The gap on a face axis of a box: `offset` along the axis, `half` its half extent there, and
// `entries` the other box's axes along it.
template <class T>
BC_INLINE T face_gap(T offset, T half, const Vec<T>& other_half, const Vec<T>& entries) {
  return abs(offset) - (half + dot(other_half, abs(entries)));
}

// Both boxes in the frame of the one that comes first: its half extents, the offset to the other
// box, the other's half extents and its edges as columns.
template <class T>
struct FirstFrame {
  Vec<T> half, offset, other_half;
  Mat<T> edges;

  BC_INLINE explicit FirstFrame(const Pair<T>& pair)
      : half(select(pair.a_first, pair.half_a, pair.half_b)),
        offset(select(pair.a_first, pair.offset_a, pair.offset_b)),
        other_half(select(pair.a_first, pair.half_b, pair.half_a)),
        edges(select(pair.a_first, pair.rotation, transpose(pair.rotation))) {}
};

// The nine edge axes e_i × u_j. In this frame e_i × u_j is (−u_z, u_y) in the components y and z
// that follow i.
template <class T>
BC_INLINE void offer_edge_axes(const Pair<T>& pair, const FirstFrame<T>& frame, BestAxis<T>& best,
                               Mask<T>& doubtful) {
  T tolerance = tie * pair.size, error = edge_gap_error * pair.size;
  T none = splat<T>(-infinity);
  T largest_possible = none, longest_skipped2 = T{};
  Triple<T> half_k = rotated(triple(frame.other_half)), half_l = rotated(half_k);
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) {
    int y = (i + 1) % 3, z = (i + 2) % 3;
    // By j, and the other box's axes k and l that follow it.
    Triple<T> uy = triple(row(frame.edges, y)), uz = triple(row(frame.edges, z));
    Triple<T> ky = rotated(uy), kz = rotated(uz), ly = rotated(ky), lz = rotated(kz);
    Triple<T> length2 = uy * uy + uz * uz;
    Triple<T> width = (frame.half[y] * abs(uz) + frame.half[z] * abs(uy)) +
                      (half_k * abs(kz * uy - ky * uz) + half_l * abs(lz * uy - ly * uz));
    Triple<T> overlap = abs(frame.offset[z] * uy - frame.offset[y] * uz) - width;
    Triple<T> inverse = each([](auto x) { return 1.0 / sqrt(x); }, length2);
    Triple<T> gaps = overlap * inverse, highest_gaps = (overlap + error) * inverse;
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j) {
      Mask<T> used = length2[j] >= parallel * parallel;
      Mask<T> inaccurate = used & (length2[j] < almost_parallel * almost_parallel);
      largest_possible = max(largest_possible, select<T>(inaccurate, highest_gaps[j], none));
      longest_skipped2 = max(longest_skipped2, select<T>(used, T{}, length2[j]));
      T number = i == j ? splat<T>(first_edge_axis + 4 * i)
                        : select<T>(pair.a_first, splat<T>(first_edge_axis + 3 * i + j),
                                    splat<T>(first_edge_axis + 3 * j + i));
      best.offer(select<T>(used, gaps[j], none), number, tolerance);
    }
  }
  T gap = best.largest_gap, reach = skipped_gain * pair.size;
  Mask<T> skipped_may_win = (longest_skipped2 > cross_product_min * cross_product_min) &
                            ((gap >= 0.0) | (gap * gap < reach * reach * longest_skipped2));
  doubtful = (gap <= pair.touch) & ((largest_possible > gap) | skipped_may_win);
}

// The winning axis as a unit vector from A to B, in A's frame.
template <class T>
BC_INLINE Vec<T> axis_normal(const Pair<T>& pair, const FirstFrame<T>& frame, T axis) {
  // A face of A or of B: a unit vector, or a column of R.
  Vec<T> face{};
  T face_offset{};
  for (int k = 0; k < 3; ++k) {
    Mask<T> of_a = axis == double(k), of_b = axis == double(3 + k);
    face_offset = select<T>(of_a, pair.offset_a[k], select<T>(of_b, pair.offset_b[k], face_offset));
    face = select<T>(of_b, column(pair.rotation, k), face);
    face[k] = select<T>(of_a, splat<T>(1.0), face[k]);
  }
  // A pair of edges, in the very frame in which their gap was evaluated.
  T number = axis - double(first_edge_axis);
  T edge_a = select<T>(number < 3.0, T{}, select<T>(number < 6.0, splat<T>(1.0), splat<T>(2.0)));
  T edge_b = number - 3.0 * edge_a;
  T i = select<T>(pair.a_first, edge_a, edge_b), j = select<T>(pair.a_first, edge_b, edge_a);
  Vec<T> u = select(j == 0.0, column(frame.edges, 0),
                    select(j == 1.0, column(frame.edges, 1), column(frame.edges, 2)));
  Vec<T> n;
  n[0] = select<T>(i == 0.0, T{}, select<T>(i == 1.0, u[2], -u[1]));
  n[1] = select<T>(i == 0.0, -u[2], select<T>(i == 1.0, T{}, u[0]));
  n[2] = select<T>(i == 0.0, u[1], select<T>(i == 1.0, -u[0], T{}));

  Mask<T> edges = axis >= double(first_edge_axis);
  T length2 = dot(n, n);
  T along = select<T>(edges, dot(frame.offset, n), face_offset);
  T side = select<T>(along >= 0.0, splat<T>(1.0), splat<T>(-1.0));
  n = (side / sqrt(select<T>(length2 > 0.0, length2, splat<T>(1.0)))) * n;
  n = select(pair.a_first, n, pair.rotation * n);
  return select(edges, n, side * face);
}

// The best of the six face axes.
template <class T>
BC_INLINE BestAxis<T> best_face_axis(const Pair<T>& pair) {
  T tolerance = tie * pair.size;
  T gap = face_gap(pair.offset_a[0], pair.half_a[0], pair.half_b, row(pair.rotation, 0));
  BestAxis<T> best{gap, T{}, gap};
  for (int k = 1; k < 3; ++k)
    best.offer(face_gap(pair.offset_a[k], pair.half_a[k], pair.half_b, row(pair.rotation, k)),
               splat<T>(k), tolerance);
  for (int k = 0; k < 3; ++k)
    best.offer(face_gap(pair.offset_b[k], pair.half_b[k], pair.half_a, column(pair.rotation, k)),
               splat<T>(3 + k), tolerance);
  return best;
}

template <class T>
BC_INLINE SeparatingAxis<T> separating_axis(const Pair<T>& pair) {
  BestAxis<T> best = best_face_axis(pair);
  SeparatingAxis<T> found;
  found.face = best.axis;
  FirstFrame<T> frame(pair);
  offer_edge_axes(pair, frame, best, found.doubtful);
  found.separation = best.largest_gap;
  found.axis = best.axis;
  found.normal = axis_normal(pair, frame, best.axis);
  return found;
}

}  // namespace box_contact::BOX_CONTACT_SET
