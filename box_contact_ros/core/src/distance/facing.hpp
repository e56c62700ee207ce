// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Facing features: the centroid of what a face has in common with an edge or a face parallel to it.
#pragma once

#include "../overlap/clipping.hpp"
#include "slices.hpp"
#include "vertices.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace apart {

using clipping::Point3;
using clipping::Polygon;
using clipping::Slab;

// A point of a face, in the plane of the face.
struct Place2 {
  double x, y;
};

// The middle of the part of the edge middle ± half · edge that lies on a face of half extents
// `face`. Returns false if there is none.
inline bool middle_on_face(const Place2& middle, const Place2& edge, double half,
                           const Place2& face, double slack, Place2& found) {
  double low = -half, high = half;
  auto clip = [&](double at, double along, double most) {
    double one = (-most - at) / along, other = (most - at) / along;
    low = max(low, min(one, other)), high = min(high, max(one, other));
  };
  clip(middle.x, edge.x, face.x);
  clip(middle.y, edge.y, face.y);
  if (!(low <= high + slack)) return false;
  double at = 0.5 * (low + high);
  found = {middle.x + at * edge.x, middle.y + at * edge.y};
  return true;
}

// The centroid of the part of the rectangle middle ± edges[0] ± edges[1] that lies on a face.
// Returns false if there is none. Without an area it is the mean of the corners.
inline bool centroid_on_face(const Place2& middle, const Place2 (&edges)[2], const Place2& face,
                             double slack, Place2& found) {
  const auto& [u, w] = edges;
  Point3 centre = clipping::point3(middle.x, middle.y, 0.0);
  Point3 one = clipping::point3(u.x, u.y, 0.0), other = clipping::point3(w.x, w.y, 0.0);
  Polygon whole{
      4, {centre - one - other, centre + one - other, centre + one + other, centre - one + other}};
  Polygon half_way, part;
  clipping::clip(whole, {0, -face.x, face.x}, half_way);
  clipping::clip(half_way, {1, -face.y, face.y}, part);
  if (part.count == 0) return false;
  const Point3& first = part.corners[0];
  Point3 mean{}, moment{}, extent{};
  double area = 0.0;
  for (int i = 0; i < part.count; ++i) {
    mean += (1.0 / part.count) * (part.corners[i] - first);
    extent = max(extent, abs(part.corners[i] - first));
  }
  clipping::each_triangle(part,
                          [&](double twice, const Point3& a, const Point3& b, const Point3& c) {
                            area += twice;
                            moment += twice * ((b - a) + (c - a));
                          });
  if (std::fabs(area) > slack * max(extent[0], extent[1])) mean = (1.0 / (3.0 * area)) * moment;
  found = {first[0] + mean[0], first[1] + mean[1]};
  return true;
}

// Find the centroid where face k of the box is nearest, and edges of the other box are parallel to
// it. Returns false if these do not face each other. `on_box`, `on_other`: points in the boxes'
// frames.
inline bool find_facing(const View<double>& view, int k, double slack, Vec<double>& on_box,
                        Vec<double>& on_other) {
  int x = (k + 1) % 3, y = (k + 2) % 3, parallel[3], count = 0;
  double side = view.offset[k] >= 0.0 ? 1.0 : -1.0;
  for (int j = 0; j < 3; ++j) {
    double towards = side * view.axes[j][k];
    if (std::fabs(towards) <= flat) {
      on_other[j] = 0.0;
      parallel[count++] = j;
    } else {
      on_other[j] = towards >= 0.0 ? -view.other_half[j] : view.other_half[j];
    }
  }
  auto in_plane = [&](const Triple<double>& place) { return Place2{place[x], place[y]}; };
  Place2 middle = in_plane(view.bring(triple(on_other))), face = in_plane(view.half), found;
  Place2 directions[2], edges[2];
  for (int n = 0; n < min(count, 2); ++n) {
    double half = view.other_half[parallel[n]];
    directions[n] = in_plane(view.axes[parallel[n]]);
    edges[n] = {half * directions[n].x, half * directions[n].y};
  }
  bool is_there = count == 1   ? middle_on_face(middle, directions[0], view.other_half[parallel[0]],
                                                face, slack, found)
                  : count == 2 ? centroid_on_face(middle, edges, face, slack, found)
                               : false;
  if (!is_there) return false;
  for (int n = 0; n < count; ++n) {
    double half = view.other_half[parallel[n]];
    double along = directions[n].x * (found.x - middle.x) + directions[n].y * (found.y - middle.y);
    on_other[parallel[n]] = min(half, max(-half, along));
  }
  on_box[k] = side * view.half[k];
  on_box[x] = min(face.x, max(-face.x, found.x));
  on_box[y] = min(face.y, max(-face.y, found.y));
  return true;
}

}  // namespace apart

}  // namespace box_contact::BOX_CONTACT_SET
