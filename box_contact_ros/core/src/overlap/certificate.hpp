// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The exact moments of the overlap A∩B by the planes that meet it, and a certificate that they are right.
//
// Rounding may decide twice, and differently, which plane a line meets first. Then a piece is lost, or
// counts twice. Over the surface of the overlap, ∫ n dA is zero and ∫ x nᵀ dA is the volume times the
// identity. These twelve equations hold to a share of the accuracy that is asked for. What does not
// pass is clipped (clipping.hpp).
#pragma once

#include "lines.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The centroid is accepted with an error of size · max(1e-9, 1e-14 · size / depth).
constexpr double least_centroid_error = 1e-9, centroid_rounding = 1e-14;
// And of the covariance: max(1e-8, 1e-14 · size / depth) of its trace.
constexpr double least_covariance_error = 1e-8;

namespace planes {

// Sums about a point far outside the overlap cancel: most magnitude of their parts [of the sum].
constexpr double most_cancelled = 4.0;
// Sums of squares do so about a nearer point: its squared distance from the centroid [of the trace].
constexpr double most_way2 = 0.25;

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

// Shares of the accuracy that the twelve equations may be off by. An origin of the sums that is far from
// the centroid makes the covariance more wrong than the diagonal: the square of the distance, divided by
// the trace. So does a piece that is lost at the tip of a pyramid: the square of its distance from the
// centroid is (3/4)² / (3/80) = 15 times the variance.
constexpr double off_diagonal_share = 0.01, diagonal_share = 0.3, closure_share = 0.1;
constexpr double covariance_diagonal_share = 1.0 / 16.0;

// Whether sums over planes are right.
template <class T>
struct Certificate {
  Mask<T> holds;      // they are
  Mask<T> cancelled;  // no piece is lost: sums about a nearer point may be right
};

// The twelve equations, that no line has too long a lever, and that the sum of parts of the magnitude
// `gross` has not cancelled. `x_n`, `normal`, `size` and `gross` as in Surface, over both boxes; `lever`:
// of the lines, times the length of the edges' pieces; `trace`: of the covariance; `way2`: squared
// distance of the centroid from the origin.
template <bool squares, class T>
BC_INLINE Certificate<T> certificate(const Columns<T>& x_n, const Triple<T>& normal,
                                     const Triple<T>& size, T lever, T volume, T gross, T trace,
                                     T way2, T pair_size, T depth) {
  T rounding = centroid_rounding * pair_size / depth;
  T error = pair_size * max(splat<T>(least_centroid_error), rounding);
  T covariance_error = max(splat<T>(least_covariance_error), rounding);
  T off_diagonal = (0.5 * off_diagonal_share) * error;
  T diagonal = diagonal_share * error, closure = closure_share * error;
  if constexpr (squares) {
    off_diagonal = min(off_diagonal, (0.5 * off_diagonal_share) * covariance_error * sqrt(trace));
    T share = covariance_diagonal_share * (trace / (trace + way2));
    diagonal = min(diagonal, (share * covariance_error) * pair_size);
  }
  Columns<T> entries = diagonals(x_n);
  Triple<T> own = abs(entries[0] + (-volume)) * uniform(pair_size);
  Triple<T> beside = max(abs(entries[1]), abs(entries[2]));
  Mask<T> closes = all_of(closure * size >= abs(normal) * uniform(pair_size));
  Mask<T> has_digits = gross <= (6.0 * most_cancelled) * volume;
  Mask<T> holds = closes & has_digits & (volume > 0.0);
  holds &= rounding_of_size * pair_size * lever <= lever_share * error * volume;
  holds &= all_of((uniform(T(diagonal * volume)) >= own) & (off_diagonal * size >= beside));
  Mask<T> cancelled = closes & ((has_digits == 0) | (way2 > most_way2 * trace));
  return {holds, cancelled};
}

// Move a point of P's frame into both boxes, by the nearest points of each in turn. Returns where
// that succeeds. Points that are in both already are left after one turn.
template <class T>
[[gnu::noinline]] Mask<T> move_inside(const PairOfBoxes<T>& boxes, Triple<T>& point, T size) {
  Triple<T> outside;
  for (int round = 0; round < 3; ++round) {
    point = clamp(point, boxes.p.half);
    Triple<T> in_q = boxes.rows * (point - boxes.offset);
    Triple<T> way = clamp(in_q, boxes.q.half) - in_q;
    outside = uniform(T{});
    if (!any(all_of(way == outside) == 0)) break;
    point += boxes.columns * way;
    outside = abs(point) - boxes.p.half;
  }
  return largest(outside) <= outside_by_rounding * size;
}

}  // namespace planes

// Find the overlap of a pair of boxes, `depth` deep [m], with its centroid in P's frame. Found:
// Moments<T>, or PointAndVolume<T>, without second moments and with the equations that the centroid needs
// alone. `two_sided`: an axis may have two planes.
template <bool two_sided, class Found, class T>
BC_INLINE planes::Certificate<T> overlap_by_planes(const Pair<T>& pair,
                                                   const planes::PairOfBoxes<T>& boxes, T depth,
                                                   Found& found) {
  using namespace planes;
  constexpr bool squares = std::is_same_v<Found, Moments<T>>;
  Sums<T> of_p, of_q;
  Triple<T> largest_lever2{};
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
  T trace{}, way2{};
  if constexpr (squares) {
    OneOf<T, Columns<T>> axes = one_of<T>(boxes.p_is_a, pair.axes_a, pair.axes_b);
    Squares<T> from_q = turned<T>(m, q.second);
    Squares<T> mean2{from_origin * from_origin, rotated(from_origin) * rotated_back(from_origin)};
    T by_20_volume = 0.05 * by_volume;
    Squares<T> covariance{by_20_volume * (p.second.diagonal + from_q.diagonal) - mean2.diagonal,
                          by_20_volume * (p.second.beside + from_q.beside) - mean2.beside};
    trace = max(sum(covariance.diagonal), T{});
    way2 = sum(mean2.diagonal);
    found.covariance = turned<T>(axes, covariance).sym();
  }
  T lever = sum(lengths) * sqrt(largest(largest_lever2));
  Triple<T> normal = p.normal + m * q.normal, area = p.size + abs(m) * q.size;
  Certificate<T> certain = certificate<squares>(x_n, normal, area, lever, volume, p.gross + q.gross,
                                                trace, way2, pair.size, depth);
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
