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
#include <utility>

#include "../placed.hpp"
#include "polygon.hpp"

namespace box_contact::BOX_CONTACT_SET::faces {

// The largest gap within the patch of a load [m]: a simulation at rest errs by 1 to 250 µm.
constexpr double face_tolerance = 1e-4;
// Cosine between a normal and the nearest of both faces' below which edges meet: of 0.1 rad. Edges also win
// where nearly parallel faces meet.
constexpr double along_a_face = 0.995;

// A face of a box, relative to a point: its centre, its outward normal and its half edges.
struct Face {
  Vec<double> centre, outward, half_1, half_2;

  double area() const { return 4.0 * length(half_1) * length(half_2); }
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

// Which axis is most along a direction.
inline int axis_along(const Mat<double>& axes, const Vec<double>& direction) {
  Vec<double> along = transposed_times(axes, direction);
  int k = 0;
  for (int other = 1; other < 3; ++other)
    if (std::fabs(along[other]) > std::fabs(along[k])) k = other;
  return k;
}

// The face of a box most along a direction.
inline Face face_along(const Placed& box, const bc_size& size, const Vec<double>& origin,
                       const Vec<double>& direction) {
  const Mat<double>& axes = box.axes;
  int k = axis_along(axes, direction), next = (k + 1) % 3, last = (k + 2) % 3;
  Vec<double> outward = (dot(column(axes, k), direction) < 0.0 ? -1.0 : 1.0) * column(axes, k);
  auto half = [&](int axis) { return 0.5 * size.extent[axis]; };
  return {(box.position - origin) + half(k) * outward, outward, half(next) * column(axes, next),
          half(last) * column(axes, last)};
}

// The patch of two faces. Its axes are along the edges of the smaller face; with the normal from A to B
// they are a right-handed frame.
struct FacePatch {
  Vec<double> origin, axis_1, axis_2, normal;  // the origin is the centre of A
  Point slope = {0.0, 0.0};                    // height of the patch above the origin, along the
  double height = 0.0;                         // normal: height + slope · place
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
  if (std::max(dot(a.outward, normal), -dot(b.outward, normal)) < along_a_face) return patch;
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

static_assert(Polygon::corners_max == BC_CORNERS_MAX);

// The patch in the common frame. Behind the last corner the first one comes again; without corners, places
// are NaN.
inline bc_polygon in_common_frame(FacePatch patch) {
  bc_polygon polygon{sizeof(bc_polygon), patch.polygon.count, {}, patch.area, {}};
  if (polygon.count == 0) patch.height = not_a_number;
  for (int k = 0; k < BC_CORNERS_MAX; ++k) {
    auto corner = patch.in_common_frame(patch.polygon[k < polygon.count ? k : 0]);
    std::copy_n(corner.v, 3, polygon.corners[k]);
  }
  std::copy_n(patch.in_common_frame(patch.centroid).v, 3, polygon.centre);
  return polygon;
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

}  // namespace box_contact::BOX_CONTACT_SET::faces
