// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The exact moments of the overlap A∩B by the planes that meet it.
//
// The lines of the planes of both boxes add up to sums over the planes (lines.hpp, sums.hpp), and these
// to the moments. A certificate says whether rounding has lost a piece (certificate.hpp).
#pragma once

#include "certificate.hpp"
#include "lines.hpp"

namespace box_contact::BOX_CONTACT_SET {
namespace planes {

// Depth [of the size] below which the centroid may be outside a box by rounding. The centroid is at
// least 0.14 · depth from every face, and off by at most 1.4e-15 · size² / depth. The two are equal
// at a depth of 1e-7 of the size.
constexpr double safely_inside = 1e-6;
// Distance from a box [of the size] up to which rounding alone puts a point outside.
constexpr double outside_by_rounding = 0x1p-48;

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

// Find the overlap of a pair of boxes, `depth` deep [m]. `origin_b`: B's centre, where it is pressed in,
// common frame [m]. Found: Moments<T>, or PointAndVolume<T>, without second moments and with the
// equations that the centroid needs alone. `two_sided`: an axis may have two planes.
template <bool two_sided, class Found, class T>
BC_INLINE planes::Certificate<T> overlap_by_planes(const Pair<T>& pair,
                                                   const planes::PairOfBoxes<T>& boxes,
                                                   const Triple<T>& origin_b, T depth,
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
  OneOf<T, Columns<T>> axes = one_of<T>(boxes.p_is_a, pair.axes_a, pair.axes_b);
  if constexpr (squares) {
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
  found.centroid =
      components<T>(one_of<T>(boxes.p_is_a, pair.origin_a, origin_b) + axes * centroid);
  return certain;
}

}  // namespace box_contact::BOX_CONTACT_SET
