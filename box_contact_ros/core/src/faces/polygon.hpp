// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Convex polygons in a plane, and their moments.
#pragma once

#include <array>
#include <cstddef>

#include "../lanes/target.hpp"

namespace box_contact::BOX_CONTACT_SET::faces {

struct Point {
  double x, y;
};
inline Point operator+(const Point& a, const Point& b) { return {a.x + b.x, a.y + b.y}; }
inline Point operator-(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y}; }
inline Point operator*(double factor, const Point& a) { return {factor * a.x, factor * a.y}; }
inline double dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y; }
inline double cross(const Point& a, const Point& b) { return a.x * b.y - a.y * b.x; }

// A convex polygon, counter-clockwise. Each cut by a line adds at most one corner.
struct Polygon {
  static constexpr int corners_max = 9;  // of a face, cut by four edges and by a gap

  std::array<Point, corners_max> corners;
  int count = 0;

  const Point& operator[](int k) const { return corners[size_t(k)]; }
  const Point& after(int k) const { return corners[size_t(k + 1 < count ? k + 1 : 0)]; }
  void add(const Point& corner) {
    if (count < corners_max) corners[size_t(count++)] = corner;
  }

  // Cut off where `value`, which is linear, is above 0.
  template <class Value>
  void cut(Value value) {
    std::array<double, corners_max> values;
    bool is_whole = true;
    for (int k = 0; k < count; ++k) {
      values[size_t(k)] = value((*this)[k]);
      is_whole = is_whole && values[size_t(k)] <= 0.0;
    }
    if (is_whole) return;
    Polygon left;
    for (int k = 0; k < count; ++k) {
      const Point &here = (*this)[k], &next = after(k);
      double v = values[size_t(k)], w = values[size_t(k + 1 < count ? k + 1 : 0)];
      if (v <= 0.0) left.add(here);
      if ((v <= 0.0) != (w <= 0.0)) left.add(here + (v / (v - w)) * (next - here));
    }
    *this = left;
  }
};

// Area and first and second moments of a polygon about a point, per density.
struct Moments {
  double area = 0.0;                    // [m²]
  Point first = {0.0, 0.0};             // ∫x, ∫y [m³]
  double xx = 0.0, yy = 0.0, xy = 0.0;  // [m⁴]

  void operator+=(const Moments& other) {
    area += other.area;
    first = first + other.first;
    xx += other.xx, yy += other.yy, xy += other.xy;
  }
};
inline Moments moments_of(const Polygon& polygon, const Point& about) {
  Moments sum;
  for (int k = 1; k + 1 < polygon.count; ++k) {
    Point a = polygon[0] - about, b = polygon[k] - about, c = polygon[k + 1] - about;
    double area = 0.5 * cross(b - a, c - a);
    Point all = a + b + c;
    auto second = [&](double a1, double b1, double c1, double s1, double a2, double b2, double c2,
                      double s2) { return (a1 * a2 + b1 * b2 + c1 * c2 + s1 * s2) / 12.0; };
    sum.area += area;
    sum.first = sum.first + (area / 3.0) * all;
    sum.xx += area * second(a.x, b.x, c.x, all.x, a.x, b.x, c.x, all.x);
    sum.yy += area * second(a.y, b.y, c.y, all.y, a.y, b.y, c.y, all.y);
    sum.xy += area * second(a.x, b.x, c.x, all.x, a.y, b.y, c.y, all.y);
  }
  return sum;
}

}  // namespace box_contact::BOX_CONTACT_SET::faces
