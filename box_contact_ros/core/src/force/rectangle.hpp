// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The rectangle that stands for a patch: the one that has its covariance across the normal.
#pragma once

#include <algorithm>
#include <cmath>

#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Width of a patch divided by its length, at least [1]: rounding spoils the lesser eigenvalue by
// 1e-16 of the greater one.
constexpr double thinnest = 1e-7;

// Mean distance from the centre of a rectangle, divided by √(e1 + e2): of a line and of a square.
// Between them it is linear in 2·√(e1·e2) / (e1 + e2), to 1 %.
constexpr double radius_of_line = 0.866025403784438647, radius_of_square = 0.937082;
// Torsion of the patches of real overlaps, divided by that of their rectangles [1]: the mean.
constexpr double torsion_share = 0.966;

// A patch is a square where its variances differ from their mean by less [1].
constexpr double square_slack = 1e-3;

// From where to where along an axis, with 0 within [m].
template <class T>
struct SpanOf {
  T low, high;

  SpanOf within(const SpanOf& other) const {
    return {std::min(0.0, std::max(low, other.low)), std::max(0.0, std::min(high, other.high))};
  }
};
using Span = SpanOf<double>;

template <class T>
struct RectangleOf {
  Vec<T> axis_1, axis_2;     // along its sides; with the normal a right-handed frame
  T half_1, half_2;          // half lengths along them [m]
  T radius;                  // at which friction resists a spin [m]
  SpanOf<T> span_1, span_2;  // where the centre of pressure may be along the axes [m]

  bool has_area() const {
    return half_1 > 0.0 && half_2 > 0.0 && half_1 <= place_max && half_2 <= place_max;
  }
};
using Rectangle = RectangleOf<double>;

// The edge of a box with such axes that is most along its patch, as a direction in the plane of that.
inline Vec<double> edge_in_plane(const Vec<double>& normal, const Mat<double>& axes) {
  Vec<double> edge = column(axes, 0);
  for (int k = 1; k < 3; ++k) {
    Vec<double> other = column(axes, k);
    if (std::fabs(dot(other, normal)) < std::fabs(dot(edge, normal))) edge = other;
  }
  edge = edge - dot(edge, normal) * normal;
  return (1.0 / length(edge)) * edge;
}

// box_axes: those of the box whose sides a square has, as all directions have its covariance.
inline Rectangle rectangle_of(const Vec<double>& normal, const double* covariance,
                              const Mat<double>& box_axes) {
  Vec<double> u, v;
  tangents(normal, u, v);
  auto moment = [&](const Vec<double>& p, const Vec<double>& q) {
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) sum += p[i] * dot(vector_at(covariance + 3 * i), q);
    return sum;
  };
  double uu = moment(u, u), vv = moment(v, v), uv = moment(u, v);
  double mean = 0.5 * (uu + vv), off = 0.5 * (uu - vv), spread = std::sqrt(off * off + uv * uv);
  // Axis 1 is at half the angle of (off, uv) from u. The larger of its two components comes first.
  double larger = spread > 0.0 ? std::sqrt(0.5 * (1.0 + std::fabs(off) / spread)) : 1.0;
  double lesser = spread > 0.0 ? 0.5 * std::fabs(uv) / (spread * larger) : 0.0;
  double along_v = uv < 0.0 ? -1.0 : 1.0;
  Vec<double> axis_1 =
      off < 0.0 ? lesser * u + (along_v * larger) * v : larger * u + (along_v * lesser) * v;
  if (spread < square_slack * mean) {
    axis_1 = edge_in_plane(normal, box_axes);
    spread = moment(axis_1, axis_1) - mean;
  }
  double e1 = std::max(0.0, mean + spread);
  double e2 = std::max(mean - spread, thinnest * thinnest * e1);
  double squareness = e1 > 0.0 ? 2.0 * std::sqrt(e1 * e2) / (e1 + e2) : 1.0;
  double radius = radius_of_line + (radius_of_square - radius_of_line) * squareness;
  double half_1 = std::sqrt(3.0 * e1), half_2 = std::sqrt(3.0 * e2);
  return {axis_1,
          cross(normal, axis_1),
          half_1,
          half_2,
          torsion_share * radius * std::sqrt(e1 + e2),
          {-half_1, half_1},
          {-half_2, half_2}};
}

}  // namespace box_contact::BOX_CONTACT_SET::force
