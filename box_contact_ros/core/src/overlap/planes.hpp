// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which planes of two boxes meet their overlap A∩B.
//
// The overlap K is what the twelve half-spaces of both boxes have in common. A plane that does not
// meet K can be left out. From K, the first plane that is crossed on the way to any point outside
// touches K. Of two boxes in contact six or seven planes are left as a rule, so 15 to 20 lines.
//
// P is the box with the best face axis, D its depth, Q the other box.
//
// 1. The part of Q below the contact face reaches at most D / |q_kz| along Q's axis k, from Q's lowest
//    vertex. What bounds it along P's axes tells which sides of P cut through it.
// 2. P's part within these bounds tells which faces of Q may touch it.
#pragma once

#include "../separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace planes {

// Least magnitude of an entry of R that is inverted: an edge exactly along a slab must not give 0 · ∞.
constexpr double least_entry = 1e-90;
// Rounding of a coordinate [of the size] that may not decide whether a plane meets the overlap.
constexpr double coordinate_slack = 1e-14;
// Sides of P that cut off less than this [of the overlap's extent] count as flush: they are left out.
constexpr double flush_limit = 1e-10;
// Squared sine up to which two planes meet in no line.
constexpr double least_sine2 = 1e-26;
// Where a clipped line begins, and where one that is not there does [m].
constexpr double far_away = 1e300, nowhere = -1e300;
// The axis that follows.
constexpr int following[3] = {1, 2, 0};

// Reciprocals of the entries of a matrix, of magnitude `least` at least. One division for three entries,
// because it takes longer than all the products.
template <class T>
BC_INLINE Columns<T> reciprocals(const Columns<T>& m, double least) {
  auto inverted = [least](auto entry) {
    using N = decltype(entry);
    return select<N>(abs(entry) > least, entry, splat<N>(least));
  };
  Triple<T> a = each(inverted, m[0]), b = each(inverted, m[1]), c = each(inverted, m[2]);
  Triple<T> by_all = each([](auto product) { return 1.0 / product; }, (a * b) * c);
  Triple<T> by_two = by_all * c;
  return {{by_two * b, by_two * a, by_all * (a * b)}};
}

// One of two things: of a single pair the thing itself, without a copy.
template <class T, class Thing>
using OneOf = std::conditional_t<is_scalar<T>, const Thing&, Thing>;
template <class T, class Thing>
BC_INLINE OneOf<T, Thing> one_of(Mask<T> mask, const Thing& a, const Thing& b) {
  if constexpr (is_scalar<T>) {
    return pick(mask, a, b);
  } else if constexpr (std::is_same_v<Thing, Columns<T>>) {
    return select<T>(mask, a, b);
  } else {
    return select(mask, a, b);
  }
}

// The number of a triple, or the column of a matrix, at the axis `index` (0, 1 or 2).
template <class T, class Things>
BC_INLINE auto at(const Things& of, Index<T> index) {
  if constexpr (is_scalar<T>) {
    return of[index];
  } else {
    return one_of<T>(index == 0.0, of[0], one_of<T>(index == 1.0, of[1], of[2]));
  }
}

// A bit for each number that is chosen, of any pair.
template <class T>
BC_INLINE unsigned bits_of_any(const Flags<T>& chosen) {
  if constexpr (packed<T>) {
    return bits(chosen) & 7;
  } else {
    unsigned found = 0;
    for (int k = 0; k < 3; ++k) found |= unsigned(any(chosen[k])) << k;
    return found;
  }
}

// One plane across each axis of a box.
template <class T>
struct Planes {
  Triple<T> sign, distance;  // side of the box: ±1; distance from the origin along the axis [m]
  Triple<T> start;        // where its lines begin to be clipped; `nowhere`: there is no such plane
  unsigned axes;          // a bit for each axis that has one, of any pair
};

// A box, in its own frame.
template <class T>
struct Box {
  Triple<T> half;          // half extents [m]
  Triple<T> origin;        // of the sums [m]
  Triple<T> first;         // of the first planes along the axes [m]
  Triple<T> top, bottom;   // where the slabs end that clip lines [m]
  Triple<T> slab, middle;  // half widths of these slabs, and their middles from the origin [m]
  Planes<T> planes[2];     // two across an axis where both sides meet the overlap
  Flags<T> both;           // where they do

  // Which sides meet the overlap. The first plane is the positive side, where that one does. `most`,
  // `least`: what the overlap reaches at most [m]. A slab as small as the overlap keeps its digits.
  BC_INLINE void choose_planes(const Flags<T>& plus, const Flags<T>& minus, const Triple<T>& most,
                               const Triple<T>& least, T slack) {
    Triple<T> one = uniform(splat<T>(1.0)), here = uniform(splat<T>(far_away));
    Triple<T> room = 0.5 * (most - least) + slack;
    top = choose(plus, half, most + room);
    bottom = choose(minus, -half, least - room);
    both = plus & minus;
    first = choose(plus, half, -half);
    planes[0].sign = choose(plus, one, -one);
    planes[0].start = choose(plus | minus, here, -here);
    planes[0].axes = bits_of_any<T>(plus | minus);
    planes[1].sign = -one;
    planes[1].start = choose(both, here, -here);
    planes[1].axes = bits_of_any<T>(both);
  }
  BC_INLINE void measure_planes() {
    Triple<T> high = top - origin, low = bottom - origin;
    slab = 0.5 * (high - low);
    middle = 0.5 * (high + low);
    planes[0].distance = first - origin;
    planes[1].distance = -half - origin;
  }
};

// The depth of a pair on a face axis, 0 to 5 [m].
template <class T>
BC_INLINE T depth_on(const Pair<T>& pair, Index<T> face) {
  Mask<T> of_a = face < splat<Index<T>>(3);
  Index<T> z = select<Index<T>>(of_a, face, face - splat<Index<T>>(3));
  Triple<T> across = at<T>(one_of<T>(of_a, pair.a_in_b, pair.b_in_a), z);
  Triple<T> own = select(of_a, pair.half_a, pair.half_b);
  Triple<T> other = select(of_a, pair.half_b, pair.half_a);
  T offset = at<T>(select(of_a, pair.offset_a, pair.offset_b), z);
  return (at<T>(own, z) + dot(abs(across), other)) - abs(offset);
}

// A pair in the frames of the box P with the best face and of the other, Q.
template <class T>
struct PairOfBoxes {
  Mask<T> p_is_a;
  OneOf<T, Columns<T>> columns, rows;  // Q's axes in P's frame; P's axes in Q's frame
  Columns<T> by_columns, by_rows;      // their reciprocals
  Columns<T> scales;                   // 1 / sin² of the angles between P's axis i and Q's axes
  Triple<T> offset;                    // Q − P in P's frame [m]
  Box<T> p, q;

  // `from_a`, `from_b`: from each box to the other, in its own frame [m]. `depth`: on the best face axis
  // [m].
  BC_INLINE PairOfBoxes(const Pair<T>& pair, const SeparatingAxis<T>& axis, const Triple<T>& from_a,
                        const Triple<T>& from_b, T depth)
      : p_is_a(axis.face < splat<Index<T>>(3)),
        columns(one_of<T>(p_is_a, pair.b_in_a, pair.a_in_b)),
        rows(transposed_columns(pair)) {
    // By a division that does not wait for the best face.
    Columns<T> by_b = reciprocals(pair.b_in_a, least_entry), by_a = transpose(by_b);
    by_columns = select<T>(p_is_a, by_b, by_a);
    by_rows = select<T>(p_is_a, by_a, by_b);
    Columns<T> sines2;
    for (int i = 0; i < 3; ++i) {
      const Triple<T>&y = rows[following[i]], &z = rows[following[following[i]]];
      sines2[i] = y * y + z * z;
    }
    scales = reciprocals(sines2, 0.5 * least_sine2);
    p.half = one_of<T>(p_is_a, pair.half_a, pair.half_b);
    q.half = one_of<T>(p_is_a, pair.half_b, pair.half_a);
    offset = one_of<T>(p_is_a, from_a, from_b);
    find_planes(pair, axis, depth);
  }
  // Take the sums about a point, given in P's frame.
  BC_INLINE void take_sums_about(const Triple<T>& origin) {
    p.origin = origin;
    q.origin = rows * (origin - offset);
    p.measure_planes();
    q.measure_planes();
  }

 private:
  // Of a single pair a choice without a copy; of W pairs other names for the same numbers.
  BC_INLINE OneOf<T, Columns<T>> transposed_columns(const Pair<T>& pair) const {
    if constexpr (is_scalar<T>) {
      return one_of<T>(p_is_a, pair.a_in_b, pair.b_in_a);
    } else {
      return transpose(columns);
    }
  }

  BC_INLINE void find_planes(const Pair<T>& pair, const SeparatingAxis<T>& axis, T depth) {
    // 1. Q's part below the contact face.
    Index<T> z = select<Index<T>>(p_is_a, axis.face, axis.face - splat<Index<T>>(3));
    T slack = coordinate_slack * pair.size;
    Triple<T> zero{}, up = at<T>(rows, z), c = offset;
    T height = at<T>(c, z);
    // Of faces that tie, the best may be deeper by the tolerance.
    Triple<T> reach = min(q.half, (0.5 * (depth + tie * pair.size)) * abs(at<T>(by_rows, z)));
    Triple<T> middle_q = choose(height * up >= zero, reach - q.half, q.half - reach);
    Triple<T> centre = c + columns * middle_q, radius = abs(columns) * reach;
    Triple<T> high = centre + radius, low = centre - radius;
    // P's sides: strictly through it. The contact face counts, unless Q does not come out of it.
    Triple<T> comes_out = 2.0 * (abs(c) - p.half) + depth;
    Flags<T> contact_face = is_at<T>(z) & (comes_out > uniform(max(flush_limit * depth, slack)));
    Flags<T> top = contact_face & (c >= zero), bottom = contact_face & (zero > c);
    // Where a side is nearly flush, the overlap's extent is twice the less of the two.
    Triple<T> extent = 2.0 * min(radius, p.half);
    Triple<T> side = p.half + max(flush_limit * extent, uniform(slack));
    Triple<T> most = min(high, side), least = max(low, -side);
    p.choose_planes((high > side) | top, (-low > side) | bottom, most, least, slack);

    // 2. P's part within its bounds, and the faces of Q that touch it.
    Triple<T> middle = 0.5 * (most + least), in_q = rows * (middle - c);
    Triple<T> radius_q = abs(rows) * (0.5 * (most - least));
    Triple<T> most_q = min(in_q + radius_q, middle_q + reach);
    Triple<T> least_q = max(in_q - radius_q, middle_q - reach), edge = q.half + (-slack);
    q.choose_planes(most_q >= edge, -least_q >= edge, most_q, least_q, slack);

    // The origin: the middle of P's part. A contact of two edges may be small in it.
    Mask<T> by_edges = axis.axis >= splat<Index<T>>(first_edge_axis);
    if (any(by_edges)) middle = select(by_edges, crossing(pair, axis), middle);
    take_sums_about(middle);
  }

  // Where the two edges of an edge axis cross: the middle of the shortest way between them, in P's frame.
  BC_INLINE Triple<T> crossing(const Pair<T>& pair, const SeparatingAxis<T>& axis) const {
    Index<T> of_a = edge_of_a(axis.axis), of_b = edge_of_b(axis.axis);
    Index<T> i = select<Index<T>>(p_is_a, of_a, of_b), j = select<Index<T>>(p_is_a, of_b, of_a);
    Triple<T> zero{}, n_a = axis.normal, n_b = pair.a_in_b * n_a;
    Triple<T> n_p = select(p_is_a, n_a, -n_b), n_q = select(p_is_a, n_b, -n_a);
    auto corner = [&](const Triple<T>& half, const Triple<T>& direction) {
      return choose(direction >= zero, half, -half);
    };
    Triple<T> on_p = choose(is_at<T>(i), zero, corner(p.half, n_p));
    Triple<T> on_q = choose(is_at<T>(j), zero, corner(q.half, n_q));
    Triple<T> along = at<T>(columns, j), way = (offset - columns * on_q) - on_p;
    T cosine = at<T>(at<T>(rows, i), j), way_i = at<T>(way, i), way_j = dot(way, along);
    T scale = 1.0 / max(1.0 - cosine * cosine, splat<T>(1e-20));
    T s = (way_i - cosine * way_j) * scale, t = (cosine * way_i - way_j) * scale;
    return on_p + 0.5 * ((choose(is_at<T>(i), uniform(s), zero) + way) + t * along);
  }
};

}  // namespace planes

}  // namespace box_contact::BOX_CONTACT_SET
