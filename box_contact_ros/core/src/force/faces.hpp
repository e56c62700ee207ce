// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The patch of two faces: where the faces by which two boxes meet are within a tolerance of each other.
//
// Of each box it is the face most parallel to the normal. Both are projected along the normal and
// intersected; what is left is cut where the gap of their planes exceeds the tolerance. No volume enters,
// so a tilt of a micron, a depth and a gap change nothing. The overlap of such boxes is a wedge, whose
// moments tell little of the patch.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "rectangle.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// The largest gap within the patch of a load [m]: a simulation at rest errs by 1 to 250 µm.
constexpr double face_tolerance = 1e-4;

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

// A face of a box, relative to a point: its centre, its outward normal and its half edges.
struct Face {
  Vec<double> centre, outward, half_1, half_2;

  double area() const { return 4.0 * length(half_1) * length(half_2); }
  Span span_along(const Vec<double>& axis) const {
    double middle = dot(centre, axis);
    double half = std::fabs(dot(half_1, axis)) + std::fabs(dot(half_2, axis));
    return {middle - half, middle + half};
  }
};

// Its plane along a normal, above a place: height + slope · place.
struct Plane {
  Point slope;
  double height;
};
template <class Flat>
Plane plane_of(const Face& face, const Vec<double>& normal, const Flat& flat) {
  double along = dot(face.outward, normal);
  return {(-1.0 / along) * flat(face.outward), dot(face.centre, face.outward) / along};
}

// The face of a box most along a direction.
inline Face face_along(const Placed& box, const bc_size& size, const Vec<double>& origin,
                       const Vec<double>& direction) {
  const Mat<double>& axes = box.axes;
  Vec<double> along = transposed_times(axes, direction);
  int k = 0;
  for (int other = 1; other < 3; ++other)
    if (std::fabs(along[other]) > std::fabs(along[k])) k = other;
  int next = (k + 1) % 3, last = (k + 2) % 3;
  Vec<double> outward = (along[k] < 0.0 ? -1.0 : 1.0) * column(axes, k);
  auto half = [&](int axis) { return 0.5 * size.extent[axis]; };
  return {(box.position - origin) + half(k) * outward, outward, half(next) * column(axes, next),
          half(last) * column(axes, last)};
}

// The patch of two faces. Its axes are along the edges of the smaller face; with the normal from A to B
// they are a right-handed frame.
struct FacePatch {
  Vec<double> origin, axis_1, axis_2, normal;  // the origin is the centre of A
  Point slope;                                 // height of the patch above the origin, along the
  double height;                               // normal: height + slope · place
  Polygon polygon;                             // along the axes, from the origin [m]
  double area = 0.0;                           // across the normal [m²]
  Point centroid = {0.0, 0.0};

  Point flat(const Vec<double>& v) const { return {dot(v, axis_1), dot(v, axis_2)}; }
  Vec<double> in_common_frame(const Point& at) const {
    double along = height + dot(slope, at);
    return origin + ((at.x * axis_1 + at.y * axis_2) + along * normal);
  }
  // The same, at the height of the centroid.
  Vec<double> level(const Point& at) const {
    double along = height + dot(slope, centroid);
    return origin + ((at.x * axis_1 + at.y * axis_2) + along * normal);
  }
  // The corners of the bounding rectangle: ++, +-, --, -+ along axes 1 and 2.
  std::array<Point, 4> rectangle() const {
    Point low = polygon[0], high = polygon[0];
    for (int k = 1; k < polygon.count; ++k) {
      low = {std::min(low.x, polygon[k].x), std::min(low.y, polygon[k].y)};
      high = {std::max(high.x, polygon[k].x), std::max(high.y, polygon[k].y)};
    }
    return {high, {high.x, low.y}, low, {low.x, high.y}};
  }
};

// `normal`: from A to B, of length 1. `tolerance`: the largest gap of the planes within the patch [m].
inline FacePatch patch_of_faces(const bc_pose& pose_a, const bc_size& size_a, const bc_pose& pose_b,
                                const bc_size& size_b, const Vec<double>& normal,
                                double tolerance) {
  FacePatch patch;
  patch.origin = vector(pose_a.position);
  patch.normal = normal;
  Face a = face_along(box_at(pose_a), size_a, patch.origin, normal);
  Face b = face_along(box_at(pose_b), size_b, patch.origin, -normal);
  const Vec<double>& edge = (b.area() < a.area() ? b : a).half_1;
  Vec<double> level = edge - dot(edge, normal) * normal;
  patch.axis_1 = (1.0 / length(level)) * level;
  patch.axis_2 = cross(normal, patch.axis_1);
  auto flat = [&](const Vec<double>& v) { return patch.flat(v); };

  Point middle = flat(a.centre), u = flat(a.half_1), v = flat(a.half_2);
  if (cross(u, v) < 0.0) v = -1.0 * v;
  for (const Point& corner : {middle + u + v, middle - u + v, middle - u - v, middle + u - v})
    patch.polygon.add(corner);
  middle = flat(b.centre), u = flat(b.half_1), v = flat(b.half_2);
  for (const auto& [along, across] : {std::pair{u, v}, std::pair{v, u}}) {
    Point side = {-across.y, across.x};
    double reach = std::fabs(dot(side, along));
    for (double sign : {1.0, -1.0})
      patch.polygon.cut([&](const Point& at) { return sign * dot(side, at - middle) - reach; });
  }

  // Heights of both planes along the normal.
  auto [slope_a, height_a] = plane_of(a, normal, flat);
  auto [slope_b, height_b] = plane_of(b, normal, flat);
  Point slope = slope_b - slope_a;
  double gap = height_b - height_a;
  patch.polygon.cut([&](const Point& at) { return gap + dot(slope, at) - tolerance; });
  patch.slope = 0.5 * (slope_a + slope_b);
  patch.height = 0.5 * (height_a + height_b);
  if (patch.polygon.count == 0) return patch;
  Point about = patch.polygon[0];
  Moments moments = moments_of(patch.polygon, about);
  patch.area = std::max(0.0, moments.area);
  patch.centroid = moments.area > 0.0 ? about + (1.0 / moments.area) * moments.first : about;
  return patch;
}

// The parts of a load at the corners of a rectangle, by its centre at `at`: bilinear, so none is below 0.
inline std::array<double, 4> corner_shares(const std::array<Point, 4>& rectangle, const Point& at) {
  const Point &high = rectangle[0], &low = rectangle[2];
  auto share = [](double x, double from, double to) {
    return to > from ? std::clamp((x - from) / (to - from), 0.0, 1.0) : 0.5;
  };
  double x = share(at.x, low.x, high.x), y = share(at.y, low.y, high.y);
  return {x * y, x * (1.0 - y), (1.0 - x) * (1.0 - y), (1.0 - x) * y};
}

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

}  // namespace box_contact::BOX_CONTACT_SET::force
