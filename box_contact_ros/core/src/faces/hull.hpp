// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The convex hull of points in a plane, and how deep a point is inside it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "../minimum_depth.hpp"
#include "polygon.hpp"

namespace box_contact::BOX_CONTACT_SET::faces {

// Write the corners of the hull of points, counter-clockwise: the monotone chain. It sorts the points.
inline void make_hull(std::vector<Point>& points, std::vector<Point>& hull) {
  auto before = [](const Point& a, const Point& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  };
  auto same = [](const Point& a, const Point& b) { return a.x == b.x && a.y == b.y; };
  std::sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end(), same), points.end());
  hull.clear();
  auto chain = [&](auto begin, auto end) {
    size_t first = hull.size();
    for (auto point = begin; point != end; ++point) {
      while (hull.size() >= first + 2 &&
             cross(hull.back() - hull[hull.size() - 2], *point - hull[hull.size() - 2]) <= 0.0)
        hull.pop_back();
      hull.push_back(*point);
    }
    if (!hull.empty()) hull.pop_back();  // the other chain begins with it
  };
  chain(points.begin(), points.end());
  chain(points.rbegin(), points.rend());
  if (hull.empty() && !points.empty()) hull.push_back(points.front());
}

// How far a point is inside a hull; outside: minus how far; −infinity: there is no hull [m].
inline double depth_inside(const std::vector<Point>& hull, const Point& at) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  if (hull.empty()) return -infinite;
  size_t n = hull.size();
  double longest = 0.0, inside = infinite, outside = infinite;
  for (size_t k = 0; k < n; ++k) {
    Point edge = hull[(k + 1) % n] - hull[k];
    longest = std::max(longest, std::sqrt(dot(edge, edge)));
  }
  for (size_t k = 0; k < n; ++k) {
    Point edge = hull[(k + 1) % n] - hull[k], to = at - hull[k];
    double squared = dot(edge, edge), length = std::sqrt(squared);
    double along = squared > 0.0 ? std::clamp(dot(to, edge) / squared, 0.0, 1.0) : 0.0;
    Point apart = to - along * edge;
    outside = std::min(outside, std::sqrt(dot(apart, apart)));
    // An edge between corners that rounding parts has no direction.
    if (length >= depth_floor * longest) inside = std::min(inside, cross(edge, to) / length);
  }
  return n > 2 && inside >= 0.0 ? inside : -outside;
}

}  // namespace box_contact::BOX_CONTACT_SET::faces
