// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Beds of equal stiffness that do not pull: how a load presses on polygons.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "polygon.hpp"

namespace box_contact::BOX_CONTACT_SET::faces {

// The pressure of a unit load on beds of equal stiffness that do not pull [1/m²]: a + g · (place − at)
// where that is above zero, with the load's centre at `at`.
struct Pressure {
  double a = 0.0;
  Point g = {0.0, 0.0};
  bool holds = false;  // whether there is one: the centre is within what the beds span

  double operator()(const Point& from_centre) const { return a + dot(g, from_centre); }
  // What presses of a bed.
  Polygon under(const Polygon& bed, const Point& at) const {
    Polygon left = bed;
    left.cut([&](const Point& place) { return -(*this)(place - at); });
    return left;
  }
};

// Newton's method: the equations are the gradient of a convex function, whose second derivatives are
// the moments of what presses.
template <class Beds>
Pressure pressure_on(const Beds& beds, const Point& at) {
  constexpr int steps_max = 100;
  constexpr double precise = 1e-12;
  Pressure pressure;
  for (int step = 0; step < steps_max; ++step) {
    Moments m;
    for (const Polygon& bed : beds) m += moments_of(step > 0 ? pressure.under(bed, at) : bed, at);
    // a·(area, first) + g·(first, second) = (1, 0)
    double determinant = m.xx * m.yy - m.xy * m.xy;
    if (!(m.area > 0.0 && determinant > 0.0)) return {};
    Point tilt = {(m.yy * m.first.x - m.xy * m.first.y) / determinant,
                  (m.xx * m.first.y - m.xy * m.first.x) / determinant};
    double left = m.area - dot(tilt, m.first);
    if (!(left > 0.0)) return {};
    double before = pressure.a;
    pressure.a = 1.0 / left;
    pressure.g = -pressure.a * tilt;
    pressure.holds = std::fabs(pressure.a - before) <= precise * pressure.a;
    if (pressure.holds) break;
  }
  return pressure;
}

// The greatest pressure of a unit load with its centre at `at` on a bed of equal stiffness that does not
// pull [1/m²]: infinite where the centre is on the rim or outside.
inline double greatest_pressure(const Polygon& polygon, const Point& at) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  for (int k = 0; k < polygon.count; ++k)
    if (!(cross(polygon.after(k) - polygon[k], at - polygon[k]) >= 0.0)) return infinite;
  Pressure pressure = pressure_on(std::array{polygon}, at);
  if (!(pressure.a > 0.0)) return infinite;
  double greatest = 0.0;
  for (int k = 0; k < polygon.count; ++k) greatest = std::max(greatest, pressure(polygon[k] - at));
  return greatest;
}

}  // namespace box_contact::BOX_CONTACT_SET::faces
