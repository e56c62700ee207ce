// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The exact moments of the overlap A∩B by the planes that meet it, and a certificate that they are
// right.
//
// The overlap K is what the twelve half-spaces of both boxes have in common. A plane that does not
// meet K can be left out. From K, the first plane that is crossed on the way to any point outside
// touches K. Of two boxes in contact six or seven planes are left as a rule, so 15 to 20 lines.
//
// Which are left. P is the box with the best face axis, D its depth, Q the other box.
//
// 1. The part of Q below the contact face reaches at most D / |q_kz| along Q's axis k, from Q's lowest
//    vertex. What bounds it along P's axes tells which sides of P cut through it.
// 2. P's part within these bounds tells which faces of Q may touch it.
//
// What they sum to. A line f × g of two planes is clipped by the slabs of both boxes (Kay and Kajiya
// 1986). The sides of the slabs that do not meet K are moved away, so that a line may lie in such a
// side. With o any point near K, f and g the distances of the planes from o along the axes n_f, n_g,
// c = n_f · n_g, D = n_f × n_g, m the middle of a piece and `span` its length in units of D, each piece
// adds to both its planes (Stokes; Lasserre 1998)
//
//   twice the area:               span · (g − c f),  span · (f − c g)
//   three times its first moment: the same · m
//
// with the signs of both planes, and to the sums over K
//
//   w = f · (its part of the area of f) + g · (its part of the area of g),  six times the volume
//   w m,  w (m mᵀ + span² / 12 · D Dᵀ).
//
// Planes add what belongs to them once. The edges of one box are the case c = 0.
//
// Whether they are right. Rounding may decide twice, and differently, which plane a line meets first.
// Then a piece is lost, or counts twice. Over the surface of K, ∫ n dA is zero and ∫ x nᵀ dA is the
// volume times the identity. These twelve equations hold to a share of the accuracy that is asked
// for. What does not pass is clipped (clipping.hpp).
#pragma once

#include "../separating_axis.hpp"
#include "clipping.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The centroid is accepted with an error of size · max(1e-9, 1e-14 · size / depth).
constexpr double least_centroid_error = 1e-9, centroid_rounding = 1e-14;
// And of the covariance: max(1e-8, 1e-14 · size / depth) of its trace.
constexpr double least_covariance_error = 1e-8;

namespace planes {

// Least magnitude of an entry of R that is inverted: an edge exactly along a slab must not give 0 · ∞.
constexpr double least_entry = 1e-90;
// Rounding of a place [of the size] that may not decide whether a plane meets the overlap.
constexpr double place_slack = 1e-14;
// Sides of P that cut off less than this [of the overlap's extent] count as flush: they are left out.
constexpr double flush_limit = 1e-10;
// Squared sine up to which two planes meet in no line.
constexpr double least_sine2 = 1e-26;
// Where a clipped line begins, and where one that is not there does [m].
constexpr double far_away = 1e300, nowhere = -1e300;
// Sums about a point far outside the overlap cancel: most magnitude of their parts [of the sum].
constexpr double most_cancelled = 4.0;

// Rounding shifts a line of two planes by 2⁻⁵³ · size / sine of their angle, or moves the end of a piece
// of it by as much. An area changes by a length L times that, and the volume by the distance of the
// plane times the change. Areas may change by opposite amounts, which no equation shows. So what the
// line with the largest lever may change counts, in shares of the accuracy: 0.5 is allowed. Pairs whose
// error exceeded the accuracy had at least 7, and those that exceeded 0.3 of it at least 0.7. Columns
// stay below 0.08, other sets below 0.6, goods at rest below 1 but for 7 in 6,179.
constexpr double rounding_of_size = 0x1p-53, lever_share = 0.5;

// Depth [of the size] below which the centroid may be outside a box by rounding. The centroid is at
// least 0.14 · depth from every face, and off by at most 1.4e-15 · size² / depth. The two are equal
// at a depth of 1e-7 of the size.
constexpr double safely_inside = 1e-6;
// Distance from a box [of the size] up to which rounding alone puts a point outside.
constexpr double outside_by_rounding = 0x1p-48;

// Shares of the accuracy that the twelve equations may be off by. A piece that is lost at the tip of a
// column moves the covariance by up to 30 times as much as the diagonal.
constexpr double off_diagonal_share = 0.01, diagonal_share = 0.3, closure_share = 0.1;
constexpr double covariance_diagonal_share = 0.03;

// The axis that follows.
constexpr int following[3] = {1, 2, 0};

// Reciprocals of the entries of a matrix.
template <class T>
BC_INLINE Columns<T> reciprocals(const Columns<T>& m) {
  auto reciprocal = [](auto entry) {
    using N = decltype(entry);
    return 1.0 / select<N>(abs(entry) > least_entry, entry, splat<N>(least_entry));
  };
  return {{each(reciprocal, m[0]), each(reciprocal, m[1]), each(reciprocal, m[2])}};
}

// The sums of each triple's numbers, side by side.
template <class T>
BC_INLINE Triple<T> totals(const Triple<T>& a, const Triple<T>& b, const Triple<T>& c) {
  Columns<T> by_number = transpose(Columns<T>{{a, b, c}});
  return (by_number[0] + by_number[1]) + by_number[2];
}

// The number of a triple, and the column of a matrix, at the axis `place` (0, 1 or 2).
template <class T>
BC_INLINE T at(const Triple<T>& x, Place<T> place) {
  if constexpr (is_scalar<T>) {
    return x[place];
  } else {
    return select<T>(place == 0.0, x[0], select<T>(place == 1.0, x[1], x[2]));
  }
}
template <class T>
BC_INLINE Triple<T> at(const Columns<T>& m, Place<T> place) {
  if constexpr (is_scalar<T>) {
    return m[place];
  } else {
    return select(place == 0.0, m[0], select(place == 1.0, m[1], m[2]));
  }
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
  Triple<T> sign, place;  // side of the box: ±1; distance from the origin along the axis [m]
  Triple<T> start;        // where its lines begin to be clipped; `nowhere`: there is no such plane
  unsigned axes;          // a bit for each axis that has one, of any pair
};

// A box, in its own frame.
template <class T>
struct Box {
  Triple<T> half;          // half extents [m]
  Triple<T> origin;        // of the sums [m]
  Triple<T> first;         // the places of the first planes along the axes [m]
  Triple<T> slab, middle;  // half widths of the slabs that clip lines, and their middles [m]
  Triple<T> from;          // the origin, from these middles [m]
  Planes<T> planes[2];     // two across an axis where both sides meet the overlap
  Flags<T> both;           // where they do

  // Which sides meet the overlap. The first plane is the positive side, where that one does.
  BC_INLINE void choose_planes(const Flags<T>& plus, const Flags<T>& minus) {
    Triple<T> zero{}, one = uniform(splat<T>(1.0)), here = uniform(splat<T>(far_away));
    Triple<T> up = choose(plus, zero, 0.5 * half), down = choose(minus, zero, 0.5 * half);
    slab = half + (up + down);
    middle = up - down;
    both = plus & minus;
    first = choose(plus, half, -half);
    planes[0].sign = choose(plus, one, -one);
    planes[0].start = choose(plus | minus, here, -here);
    planes[0].axes = bits_of_any<T>(plus | minus);
    planes[1].sign = -one;
    planes[1].start = choose(both, here, -here);
    planes[1].axes = bits_of_any<T>(both);
  }
  BC_INLINE void place_planes() {
    from = origin - middle;
    planes[0].place = first - origin;
    planes[1].place = -half - origin;
  }
};

// A pair in the frames of the box P with the best face and of the other, Q.
template <class T>
struct PairOfBoxes {
  Mask<T> p_is_a;
  OneOf<T, Columns<T>> columns, rows;  // Q's axes in P's frame; P's axes in Q's frame
  Columns<T> by_columns, by_rows;      // their reciprocals
  Columns<T> scales;                   // 1 / sin² of the angles between P's axis i and Q's axes
  Triple<T> offset;                    // Q − P in P's frame [m]
  Box<T> p, q;

  BC_INLINE explicit PairOfBoxes(const Pair<T>& pair, const SeparatingAxis<T>& axis)
      : p_is_a(axis.face < splat<Place<T>>(3)),
        columns(one_of<T>(p_is_a, pair.b_in_a, pair.a_in_b)),
        rows(transposed_columns(pair)) {
    if constexpr (packed<T>) {
      // By a division that does not wait for the best face.
      Columns<T> by_b = reciprocals(pair.b_in_a), by_a = transpose(by_b);
      by_columns = select<T>(p_is_a, by_b, by_a);
      by_rows = select<T>(p_is_a, by_a, by_b);
    } else {
      by_columns = reciprocals(columns);
      by_rows = transpose(by_columns);
    }
    for (int i = 0; i < 3; ++i) {
      const Triple<T>&y = rows[following[i]], &z = rows[following[following[i]]];
      scales[i] =
          each([](auto sine2) { return 1.0 / max(sine2, splat<decltype(sine2)>(least_sine2)); },
               y * y + z * z);
    }
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
};

// The depth of a pair on a face axis, 0 to 5 [m].
template <class T>
BC_INLINE T depth_on(const Pair<T>& pair, Place<T> face) {
  Mask<T> of_a = face < splat<Place<T>>(3);
  Place<T> z = select<Place<T>>(of_a, face, face - splat<Place<T>>(3));
  Triple<T> across = at<T>(one_of<T>(of_a, pair.a_in_b, pair.b_in_a), z);
  Triple<T> own = select(of_a, pair.half_a, pair.half_b);
  Triple<T> other = select(of_a, pair.half_b, pair.half_a);
  T offset = at<T>(select(of_a, pair.offset_a, pair.offset_b), z);
  return (at<T>(own, z) + dot(abs(across), other)) - abs(offset);
}

// Where the two edges of an edge axis cross: the middle of the shortest way between them, in P's frame.
template <class T>
BC_INLINE Triple<T> crossing(const Pair<T>& pair, const SeparatingAxis<T>& axis,
                             const PairOfBoxes<T>& boxes) {
  Mask<T> is_a = boxes.p_is_a;
  Place<T> of_a = edge_of_a(axis.axis), of_b = edge_of_b(axis.axis);
  Place<T> i = select<Place<T>>(is_a, of_a, of_b), j = select<Place<T>>(is_a, of_b, of_a);
  Triple<T> zero{}, n_a = axis.normal, n_b = pair.a_in_b * n_a;
  Triple<T> n_p = select(is_a, n_a, -n_b), n_q = select(is_a, n_b, -n_a);
  auto corner = [&](const Triple<T>& half, const Triple<T>& direction) {
    return choose(direction >= zero, half, -half);
  };
  Triple<T> on_p = choose(is_at<T>(i), zero, corner(boxes.p.half, n_p));
  Triple<T> on_q = choose(is_at<T>(j), zero, corner(boxes.q.half, n_q));
  Triple<T> along = at<T>(boxes.columns, j), way = (boxes.offset - boxes.columns * on_q) - on_p;
  T cosine = at<T>(at<T>(boxes.rows, i), j), way_i = at<T>(way, i), way_j = dot(way, along);
  T scale = 1.0 / max(1.0 - cosine * cosine, splat<T>(1e-20));
  T s = (way_i - cosine * way_j) * scale, t = (cosine * way_i - way_j) * scale;
  return on_p + 0.5 * ((choose(is_at<T>(i), uniform(s), zero) + way) + t * along);
}

// Find the planes that may meet the overlap. `from_a`, `from_b`: from each box to the other, in its own
// frame [m]. `depth`: on the best face axis [m].
template <class T>
BC_INLINE void find_planes(const Pair<T>& pair, const SeparatingAxis<T>& axis,
                           const Triple<T>& from_a, const Triple<T>& from_b, T depth,
                           PairOfBoxes<T>& boxes) {
  Box<T>&p = boxes.p, &q = boxes.q;
  Mask<T> is_a = boxes.p_is_a;
  const Columns<T>& m = boxes.columns;
  p.half = one_of<T>(is_a, pair.half_a, pair.half_b);
  q.half = one_of<T>(is_a, pair.half_b, pair.half_a);
  OneOf<T, Triple<T>> c = one_of<T>(is_a, from_a, from_b);
  boxes.offset = c;

  // 1. Q's part below the contact face.
  Place<T> z = select<Place<T>>(is_a, axis.face, axis.face - splat<Place<T>>(3));
  T slack = place_slack * pair.size;
  Triple<T> zero{}, up = at<T>(boxes.rows, z);
  T height = at<T>(c, z);
  // Of faces that tie, the best may be deeper by the tolerance.
  Triple<T> reach = min(q.half, (0.5 * (depth + tie * pair.size)) * abs(at<T>(boxes.by_rows, z)));
  Triple<T> middle_q = choose(height * up >= zero, reach - q.half, q.half - reach);
  Triple<T> centre = c + m * middle_q, radius = abs(m) * reach;
  Triple<T> high = centre + radius, low = centre - radius;
  // P's sides: strictly through it. The contact face counts, unless Q does not come out of it.
  Triple<T> comes_out = 2.0 * (abs(c) - p.half) + depth;
  Flags<T> contact_face = is_at<T>(z) & (comes_out > uniform(max(flush_limit * depth, slack)));
  Flags<T> top = contact_face & (c >= zero), bottom = contact_face & (zero > c);
  // Where a side is nearly flush, the overlap's extent is twice the less of the two.
  Triple<T> extent = 2.0 * min(radius, p.half);
  Triple<T> side = p.half + max(flush_limit * extent, uniform(slack));
  Flags<T> plus = (high > side) | top, minus = (-low > side) | bottom;
  p.choose_planes(plus, minus);

  // 2. P's part within its bounds, and the faces of Q that touch it.
  Triple<T> most = min(high, side), least = max(low, -side);
  p.origin = 0.5 * (most + least);
  Triple<T> in_q = boxes.rows * (p.origin - c), radius_q = abs(boxes.rows) * (0.5 * (most - least));
  Triple<T> edge = q.half + (-slack);
  q.choose_planes(min(in_q + radius_q, middle_q + reach) >= edge,
                  min(radius_q - in_q, reach - middle_q) >= edge);

  // The origin: the middle of P's part. A contact of two edges may be small in it.
  Mask<T> by_edges = axis.axis >= splat<Place<T>>(first_edge_axis);
  if (any(by_edges)) {
    p.origin = select(by_edges, crossing(pair, axis, boxes), p.origin);
    in_q = boxes.rows * (p.origin - c);
  }
  q.origin = in_q;
  p.place_planes();
  q.place_planes();
}

// Take the sums about another point, given in P's frame.
template <class T>
BC_INLINE void move_origin(PairOfBoxes<T>& boxes, const Triple<T>& origin) {
  boxes.p.origin = origin;
  boxes.q.origin = boxes.rows * (origin - boxes.offset);
  boxes.p.place_planes();
  boxes.q.place_planes();
}

// Clip a line from −back to `to` by a slab: it is `at` from the slab's middle there, and its
// direction's component is 1 / inverse.
template <class N, class Slab>
BC_INLINE void clip(const N& at, const Slab& slab, const N& inverse, N& back, N& to) {
  N by = at * inverse, width = slab * abs(inverse);
  back = min(back, width + by);
  to = min(to, width - by);
}

// What pieces of lines add to the planes of a box. N: one plane, or one across each axis.
template <class N>
struct Faces {
  N area{};           // twice the area, with the side's sign [m²]
  N next{}, after{};  // three times its first moments along the two axes that follow, likewise
};

// And to the sums over the overlap, for the planes across an axis of P and its lines with Q's.
template <class N, bool squares>
struct Weighted {
  N w{}, y{}, z{};  // Σ w, and w times the middles' places along the two axes that follow
  N yy{}, zz{}, yz{};
};

// Symmetric tensors: xx yy zz, and yz xz xy off the diagonal.
template <class T>
struct Squares {
  Triple<T> diagonal{}, beside{};
};

template <class T>
BC_INLINE Squares<T> square_of(const Triple<T>& x) {
  return {x * x, rotated(x) * rotated_back(x)};
}
template <class T>
BC_INLINE Sym<T> sym(const Squares<T>& s) {
  return {{s.diagonal[0], s.diagonal[1], s.diagonal[2], s.beside[0], s.beside[1], s.beside[2]}};
}
// A tensor of the frame with these axes.
template <class T>
BC_INLINE Squares<T> turned(const Columns<T>& axes, const Squares<T>& s) {
  Columns<T> c = from_diagonals<T>({{s.diagonal, rotated_back(s.beside), rotated(s.beside)}});
  Columns<T> half_way{{axes * c[0], axes * c[1], axes * c[2]}}, rows = transpose(axes);
  Columns<T> found = diagonals<T>({{half_way * rows[0], half_way * rows[1], half_way * rows[2]}});
  return {found[0], rotated(found[1])};
}

// Sums over one box: its planes, and the pieces of its edges.
template <class T>
struct Sums {
  Faces<Triple<T>> faces[2];
  Triple<T> first{};  // Σ w · middle
  Squares<T> squares;
};

// The numbers of Q's axes for one line or for three.
template <class T>
BC_INLINE auto& of_axis(Triple<T>& x, int j) {
  if constexpr (packed<T>) {
    return x;
  } else {
    return x[j];
  }
}
template <class T>
BC_INLINE const auto& of_axis(const Triple<T>& x, int j) {
  if constexpr (packed<T>) {
    return x;
  } else {
    return x[j];
  }
}

// For W pairs, one line of a plane of P with one of Q. For a single pair, three: with the planes
// across all of Q's axes.
template <class T>
using Line = std::conditional_t<packed<T>, Triple<T>, T>;

// What is left of the line of two planes within the slabs.
template <class N>
struct Piece {
  N span, middle;            // its length in units of D, and the place of its middle
  N u, v;                    // g − c f, and f − c g [m]
  N at_y, at_z, at_k, at_l;  // the line's nearest point to the origin, in P and in Q [m]
};

// The line of P's plane s across axis i with Q's plane t across axis j, clipped.
template <class T>
BC_INLINE Piece<Line<T>> clipped_line(const PairOfBoxes<T>& boxes, int i, int s, int j, int t,
                                      Line<T>& largest_lever2) {
  using N = Line<T>;
  const Box<T>&p = boxes.p, &q = boxes.q;
  const Planes<T>&of_p = p.planes[s], &of_q = q.planes[t];
  int y = following[i], z = following[y];
  const Triple<T>&row_i = boxes.rows[i], &by_i = boxes.by_rows[i];
  auto on = [&](const Triple<T>& x) { return of_axis<T>(x, j); };
  // Components: of n_g along y and z; of n_f along the axes k and l of Q that follow j.
  N c = on(row_i), qy = on(boxes.rows[y]), qz = on(boxes.rows[z]);
  N pk = on(rotated(row_i)), pl = on(rotated_back(row_i));
  N by_y = on(boxes.by_rows[y]), by_z = on(boxes.by_rows[z]);
  N by_k = on(rotated(by_i)), by_l = on(rotated_back(by_i));

  N f = spread(of_p.place, i), g = on(of_q.place), scale = on(boxes.scales[i]);
  Piece<N> piece;
  piece.u = g - c * f;
  piece.v = f - c * g;
  N by_q = piece.u * scale, by_p = piece.v * scale;
  piece.at_y = by_q * qy, piece.at_z = by_q * qz;
  piece.at_k = by_p * pk, piece.at_l = by_p * pl;
  N start = min(spread(of_p.start, i), on(of_q.start));
  // The line's direction: −qz and qy in P, pl and −pk in Q.
  N back = select<N>(scale < 1.0 / least_sine2, start, splat<N>(nowhere)), to = back;
  clip(spread(p.from, y) + piece.at_y, spread(p.slab, y), by_z, to, back);
  clip(spread(p.from, z) + piece.at_z, spread(p.slab, z), by_y, back, to);
  clip(on(rotated(q.from)) + piece.at_k, on(rotated(q.slab)), by_l, back, to);
  clip(on(rotated_back(q.from)) + piece.at_l, on(rotated_back(q.slab)), by_k, to, back);
  piece.span = max(to + back, N{});
  piece.middle = 0.5 * (to - back);
  N lever2 = (f * f) * (piece.u * by_q) + (g * g) * (piece.v * by_p);
  largest_lever2 = max(largest_lever2, select<N>(piece.span > 0.0, lever2, N{}));
  return piece;
}

// What this piece adds.
template <bool squares, class T>
BC_INLINE void add_piece(const PairOfBoxes<T>& boxes, int i, int s, int j, int t,
                         const Piece<Line<T>>& piece, Faces<Line<T>>& face_p,
                         Weighted<Line<T>, squares>& sums, Faces<Triple<T>>& faces_q) {
  using N = Line<T>;
  const Planes<T>&of_p = boxes.p.planes[s], &of_q = boxes.q.planes[t];
  int y = following[i], z = following[y];
  const Triple<T>& row_i = boxes.rows[i];
  auto on = [&](const Triple<T>& x) { return of_axis<T>(x, j); };
  N qy = on(boxes.rows[y]), qz = on(boxes.rows[z]);
  N pk = on(rotated(row_i)), pl = on(rotated_back(row_i));
  N f = spread(of_p.place, i), g = on(of_q.place), span = piece.span, middle = piece.middle;
  N side = span * (spread(of_p.sign, i) * on(of_q.sign));
  N area_p = side * piece.u, area_q = side * piece.v;
  N my = piece.at_y - middle * qz, mz = piece.at_z + middle * qy;
  N w = f * area_p + g * area_q;
  face_p.area += area_p;
  face_p.next += area_p * my;
  face_p.after += area_p * mz;
  of_axis<T>(faces_q.area, j) += area_q;
  of_axis<T>(faces_q.next, j) += area_q * (piece.at_k + middle * pl);
  of_axis<T>(faces_q.after, j) += area_q * (piece.at_l - middle * pk);
  N wy = w * my, wz = w * mz;
  sums.w += w;
  sums.y += wy;
  sums.z += wz;
  if constexpr (squares) {
    N along = (1.0 / 12.0) * (w * (span * span)), along_y = along * qy;
    sums.yy += wy * my + along * (qz * qz);
    sums.zz += wz * mz + along_y * qy;
    sums.yz += wy * mz - along_y * qz;
  }
}

// Put numbers of the lines of P's axis i where they belong, or add them up over Q's axes.
template <class T>
struct Gathered {
  Triple<T> by_axis[3];  // of a single pair: three lines of each axis of P
  Triple<T> total;       // of W pairs

  BC_INLINE void put(int i, int j, const Line<T>& x) {
    if constexpr (packed<T>) {
      by_axis[i] = x;
    } else {
      total[i] = j == 0 ? x : total[i] + x;
    }
  }
  BC_INLINE Triple<T> sum() const {
    if constexpr (packed<T>) {
      return totals<T>(by_axis[0], by_axis[1], by_axis[2]);
    } else {
      return total;
    }
  }
};

// What the lines of P's planes on one side add up to, by P's axes.
template <bool squares, class T>
struct SideSums {
  Gathered<T> area, next, after, w, y, z, yy, zz, yz;

  BC_INLINE void put(int i, int j, const Faces<Line<T>>& face,
                     const Weighted<Line<T>, squares>& sums) {
    area.put(i, j, face.area);
    next.put(i, j, face.next);
    after.put(i, j, face.after);
    w.put(i, j, sums.w);
    y.put(i, j, sums.y);
    z.put(i, j, sums.z);
    if constexpr (squares) {
      yy.put(i, j, sums.yy);
      zz.put(i, j, sums.zz);
      yz.put(i, j, sums.yz);
    }
  }
};

// The lines of P's planes s across `count` axes with Q's planes. All that belong to one side of Q are
// clipped before any is added up: few steps then wait for the one before.
template <int count, bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, int first, int s,
                         SideSums<squares, T>& of_side, Sums<T>& of_q, Line<T>& largest_lever2) {
  constexpr int lines = packed<T> ? 1 : 3;  // of an axis of P
  auto each_line = [](auto work) __attribute__((always_inline)) {
#pragma GCC unroll 3
    for (int k = 0; k < count; ++k)
#pragma GCC unroll 3
      for (int j = 0; j < lines; ++j) work(k, j);
  };
  Faces<Line<T>> face[count][lines];
  Weighted<Line<T>, squares> sums[count][lines];
  unsigned axes_p = boxes.p.planes[s].axes;
  for (int t = 0; t < (two_sided && boxes.q.planes[1].axes ? 2 : 1); ++t) {
    unsigned axes_q = packed<T> || !two_sided ? 7 : boxes.q.planes[t].axes;
    auto is_there = [&](int k, int j) { return axes_p >> (first + k) & axes_q >> j & 1; };
    Piece<Line<T>> pieces[count][lines];
    each_line([&](int k, int j) __attribute__((always_inline)) {
      pieces[k][j] = is_there(k, j) ? clipped_line(boxes, first + k, s, j, t, largest_lever2)
                                    : Piece<Line<T>>{};
    });
    each_line([&](int k, int j) __attribute__((always_inline)) {
      if (is_there(k, j))
        add_piece<squares>(boxes, first + k, s, j, t, pieces[k][j], face[k][j], sums[k][j],
                           of_q.faces[t]);
    });
  }
  each_line([&](int k, int j) __attribute__((always_inline)) {
    of_side.put(first + k, j, face[k][j], sums[k][j]);
  });
}

// All lines of P's planes with Q's. Code that does not fit the first cache takes up to twice the time:
// no loop over two sides is unrolled, and of W pairs none over P's axes.
template <bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, Sums<T>& of_p, Sums<T>& of_q,
                         Line<T>& largest_lever2) {
  int sides_p = two_sided && boxes.p.planes[1].axes ? 2 : 1;
  for (int s = 0; s < sides_p; ++s) {
    SideSums<squares, T> side;
    if constexpr (packed<T>) {
      add_lines<3, squares, two_sided>(boxes, 0, s, side, of_q, largest_lever2);
    } else {
#pragma GCC unroll 1
      for (int i = 0; i < 3; ++i)
        add_lines<1, squares, two_sided>(boxes, i, s, side, of_q, largest_lever2);
    }
    const Triple<T>& f = boxes.p.planes[s].place;
    Faces<Triple<T>>& faces = of_p.faces[s];
    faces.area = side.area.sum();
    faces.next = side.next.sum();
    faces.after = side.after.sum();
    Triple<T> wx = f * side.w.sum(), wy = side.y.sum(), wz = side.z.sum();
    of_p.first += ((wx + rotated_back(wy)) + rotated(wz));
    if constexpr (squares) {
      of_p.squares.diagonal += ((f * wx + rotated_back(side.yy.sum())) + rotated(side.zz.sum()));
      of_p.squares.beside += ((side.yz.sum() + rotated(f * wy)) + rotated_back(f * wz));
    }
  }
}

// The edges of a box x along its axes k, in its planes s across the axis that follows k and t across
// the next. `axes`: y's axes in x's frame.
template <bool squares, class T>
BC_INLINE void add_edges(const Box<T>& x, int s, int t, const Box<T>& y, const Columns<T>& axes,
                         const Columns<T>& inverse, Sums<T>& sums, Triple<T>& length) {
  const Planes<T>&of_f = x.planes[s], &of_g = x.planes[t];
  Triple<T> f = rotated(of_f.place), g = rotated_back(of_g.place);
  Triple<T> start = min(rotated(of_f.start), rotated_back(of_g.start));
  Triple<T> back = min(start, x.slab + x.from), to = min(start, x.slab - x.from);
#pragma GCC unroll 3
  for (int m = 0; m < 3; ++m) {
    Triple<T> place = (f * rotated(axes[m]) + g * rotated_back(axes[m])) + spread(y.from, m);
    clip(place, spread(y.slab, m), inverse[m], back, to);
  }
  Triple<T> span = max(to + back, Triple<T>{}), middle = 0.5 * (to - back);
  length += span;
  Triple<T> side = span * (rotated(of_f.sign) * rotated_back(of_g.sign));
  Triple<T> area_f = side * g, area_g = side * f;
  Faces<Triple<T>>& faces_f = sums.faces[s];
  faces_f.area += rotated_back(area_f);
  faces_f.next += rotated_back(area_f * g);
  faces_f.after += rotated_back(area_f * middle);
  Faces<Triple<T>>& faces_g = sums.faces[t];
  faces_g.area += rotated(area_g);
  faces_g.next += rotated(area_g * middle);
  faces_g.after += rotated(area_g * f);
  Triple<T> w = 2.0 * (area_f * f), along = w * middle, at_f = w * f, at_g = w * g;
  sums.first += ((along + rotated_back(at_f)) + rotated(at_g));
  if constexpr (squares) {
    Triple<T> own = along * middle + (1.0 / 12.0) * (w * (span * span));
    sums.squares.diagonal += ((own + rotated_back(at_f * f)) + rotated(at_g * g));
    sums.squares.beside += ((at_f * g + rotated(at_f * middle)) + rotated_back(at_g * middle));
  }
}

template <bool squares, bool two_sided, class T>
BC_INLINE void add_edges(const Box<T>& x, const Box<T>& y, const Columns<T>& axes,
                         const Columns<T>& inverse, Sums<T>& sums, Triple<T>& length) {
  if constexpr (packed<T>) {
    // Without two planes there is no edge.
    unsigned there = x.planes[0].axes;
    if ((there & (there - 1)) == 0) return;
  }
  add_edges<squares>(x, 0, 0, y, axes, inverse, sums, length);
  int ways = two_sided && x.planes[1].axes ? 4 : 1;
  for (int c = 1; c < ways; ++c)
    if (any(any_of(min(rotated(x.planes[c & 1].start), rotated_back(x.planes[c >> 1].start)) >
                   Triple<T>{})))
      add_edges<squares>(x, c & 1, c >> 1, y, axes, inverse, sums, length);
}

// The same of W pairs: not inlined, because the code is long.
template <bool squares, bool two_sided, class T>
[[gnu::noinline]] void add_edges_apart(const Box<T>& x, const Box<T>& y, const Columns<T>& axes,
                                       const Columns<T>& inverse, Sums<T>& sums,
                                       Triple<T>& length) {
  add_edges<squares, two_sided>(x, y, axes, inverse, sums, length);
}

// What the planes of a box add up to, in its frame, about the origin.
template <class T>
struct Surface {
  Triple<T> normal{}, size{};  // twice ∫ n dA and ∫ |n| dA, by axis
  Columns<T> x_n;              // ∫ x nᵀ dA by its columns
  Triple<T> first{};           // twelve times ∫ x dV
  Squares<T> second;           // twenty times ∫ x xᵀ dV
  T volume{}, gross{};         // six times ∫ dV; Σ |distance| · twice the area
};

template <bool squares, bool two_sided, class T>
BC_INLINE Surface<T> surface(const Box<T>& box, const Sums<T>& sums) {
  Surface<T> s;
  s.first = sums.first;
  s.second = sums.squares;
  Triple<T> own{}, next{}, after{}, gross{};
#pragma GCC unroll 2
  for (int n = 0; n < (two_sided ? 2 : 1); ++n) {
    const Faces<Triple<T>>& faces = sums.faces[n];
    Triple<T> f = box.planes[n].place, by_f = f * faces.area, by_f2 = f * by_f;
    s.normal += faces.area;
    s.size += abs(faces.area);
    own += by_f;
    next += faces.next;
    after += faces.after;
    gross += abs(by_f);
    s.first += 0.5 * by_f2;
    if constexpr (squares) {
      Triple<T> third = (1.0 / 3.0) * (f * f);
      s.second.diagonal += f * by_f2;
      s.second.beside =
          s.second.beside + (rotated(third * faces.next) + rotated_back(third * faces.after));
    }
  }
  // Column k has its own component from the places of the planes, and two from the moments.
  s.volume = sum(own);
  s.gross = sum(gross);
  s.x_n = from_diagonals<T>({{0.5 * own, (1.0 / 3.0) * next, (1.0 / 3.0) * after}});
  return s;
}

// Whether sums over planes are right.
template <class T>
struct Certificate {
  Mask<T> holds;  // they are
  Mask<T>
      closes;  // the areas of the planes agree: no piece is lost, and only digits may be missing
};

// The twelve equations, and that no line has too long a lever. `x_n`, `normal` and `size` as in Surface,
// over both boxes; `lever`: of the lines, times the length of the edges' pieces; `radius`: √trace of the
// covariance.
template <bool squares, class T>
BC_INLINE Certificate<T> certificate(const Columns<T>& x_n, const Triple<T>& normal,
                                     const Triple<T>& size, T lever, T volume, T radius,
                                     T pair_size, T depth) {
  T rounding = centroid_rounding * pair_size / depth;
  T error = pair_size * max(splat<T>(least_centroid_error), rounding);
  T covariance_error = max(splat<T>(least_covariance_error), rounding);
  T off_diagonal = (0.5 * off_diagonal_share) * min(error, covariance_error * radius);
  T diagonal = diagonal_share * error, closure = closure_share * error;
  if constexpr (squares) {
    diagonal = min(diagonal, covariance_diagonal_share * covariance_error * pair_size);
  }
  Columns<T> entries = diagonals(x_n);
  Triple<T> own = abs(entries[0] + (-volume)) * uniform(pair_size);
  Triple<T> beside = max(abs(entries[1]), abs(entries[2]));
  Mask<T> closes = all_of(abs(normal) * uniform(pair_size) <= closure * size);
  Mask<T> holds = closes & (volume > 0.0);
  holds &= rounding_of_size * pair_size * lever <= lever_share * error * volume;
  holds &= all_of((own <= uniform(diagonal * volume)) & (beside <= off_diagonal * size));
  return {holds, closes};
}

// Move a point of P's frame into both boxes, by the nearest points of each in turn. Returns where
// that succeeds.
template <class T>
[[gnu::noinline]] Mask<T> move_inside(const PairOfBoxes<T>& boxes, Triple<T>& point, T size) {
  Triple<T> outside;
  for (int round = 0; round < 3; ++round) {
    point = clamp(point, boxes.p.half);
    Triple<T> in_q = boxes.rows * (point - boxes.offset);
    point += boxes.columns * (clamp(in_q, boxes.q.half) - in_q);
    outside = abs(point) - boxes.p.half;
  }
  return largest(outside) <= outside_by_rounding * size;
}

}  // namespace planes

// Find the overlap of a pair of boxes that `planes::find_planes` has found the planes of, `depth` deep
// [m], with its centroid in P's frame. Found: Moments<T>, or PointAndVolume<T>, without second moments
// and with the equations that the centroid needs alone. `two_sided`: an axis may have two planes.
template <bool two_sided, class Found, class T>
BC_INLINE planes::Certificate<T> overlap_by_planes(const Pair<T>& pair,
                                                   const planes::PairOfBoxes<T>& boxes, T depth,
                                                   Found& found) {
  using namespace planes;
  constexpr bool squares = std::is_same_v<Found, Moments<T>>;
  Sums<T> of_p, of_q;
  Line<T> largest_lever2{};
  add_lines<squares, two_sided>(boxes, of_p, of_q, largest_lever2);
  Triple<T> lengths{};
  constexpr auto edges =
      packed<T> ? add_edges<squares, two_sided, T> : add_edges_apart<squares, two_sided, T>;
  edges(boxes.p, boxes.q, boxes.columns, boxes.by_columns, of_p, lengths);
  edges(boxes.q, boxes.p, boxes.rows, boxes.by_rows, of_q, lengths);
  Surface<T> p = surface<squares, two_sided>(boxes.p, of_p);
  Surface<T> q = surface<squares, two_sided>(boxes.q, of_q);

  const Columns<T>& m = boxes.columns;
  Columns<T> x_n, half_way{{m * q.x_n[0], m * q.x_n[1], m * q.x_n[2]}};
  for (int i = 0; i < 3; ++i) x_n[i] = p.x_n[i] + half_way * boxes.rows[i];
  T volume = (1.0 / 6.0) * (p.volume + q.volume), by_volume = 1.0 / volume;
  Triple<T> from_origin = ((1.0 / 12.0) * by_volume) * (p.first + m * q.first);
  Triple<T> centroid = boxes.p.origin + from_origin;
  T radius = splat<T>(infinity);
  if constexpr (squares) {
    OneOf<T, Columns<T>> axes = one_of<T>(boxes.p_is_a, pair.axes_a, pair.axes_b);
    Squares<T> from_q = turned<T>(m, q.second), mean2 = square_of<T>(from_origin);
    T by_20_volume = 0.05 * by_volume;
    Squares<T> covariance{by_20_volume * (p.second.diagonal + from_q.diagonal) - mean2.diagonal,
                          by_20_volume * (p.second.beside + from_q.beside) - mean2.beside};
    radius = sqrt(max(sum(covariance.diagonal), T{}));
    found.covariance = sym<T>(turned<T>(axes, covariance));
  }
  T lever2;
  if constexpr (packed<T>) {
    lever2 = largest(largest_lever2);
  } else {
    lever2 = largest_lever2;
  }
  T lever = sum(lengths) * sqrt(lever2);
  Triple<T> normal = p.normal + m * q.normal, area = p.size + abs(m) * q.size;
  Certificate<T> certain =
      certificate<squares>(x_n, normal, area, lever, volume, radius, pair.size, depth);
  certain.holds &= p.gross + q.gross <= (6.0 * most_cancelled) * volume;
  Mask<T> shallow = depth < safely_inside * pair.size;
  if (any(shallow)) {
    Triple<T> moved = centroid;
    Mask<T> inside = move_inside(boxes, moved, pair.size);
    centroid = select(shallow, moved, centroid);
    certain.holds &= inside | (shallow == 0);
  }
  found.volume = volume;
  found.centroid = components<T>(centroid);
  return certain;
}

}  // namespace box_contact::BOX_CONTACT_SET
