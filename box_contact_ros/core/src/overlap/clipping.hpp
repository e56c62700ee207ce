// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The exact moments of the overlap A∩B by clipping: the fallback where the planes are not certain.
//
// The frame is that of the reference box, the one with the best face axis. Its contact face is the
// plane w = 0, the box lies below, and (u, v) run along the face. Over each (u, v) the incident box
// is a column from w_bottom to w_top. Clamped to [−thickness, 0], the difference of the two is the
// part inside the reference box. So volume and moments of A∩B are sums, over the incident box's six
// faces, of integrals of the clamped height over the face's projection:
//
// 1. Corners of the incident box in (u, v, w). A face wholly outside contributes nothing.
// 2. Each other face is clipped by w ≤ 0 and by the rectangle's sides (Sutherland–Hodgman), two
//    parallel ones at once.
// 3. What comes out below the reference box counts with the height −thickness. It is cut triangle by
//    triangle, because no part of a face may count twice.
// 4. Signed integrals of w, u w, v w and w²/2 over the polygon, triangle by triangle.
// 5. The same polygons once more, about the centroid, for the second moments. Squares of distances
//    to any other point would cancel in a small overlap.
//
// No face of the reference box is clipped, and every integrand vanishes on the plane w = 0. Coplanar
// faces need no case: they contribute nothing, in exact arithmetic and in rounded.
//
// Accuracy: heights carry a few roundings of the size, so the centroid is off by about
// 1e-16 · size / depth of the size. A∩B holds a ball of radius depth / (2√3).
#pragma once

#include <cmath>

#include "../poses.hpp"
#include "moments.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Part of the volume's integrals that has to be left in their sum. Of thin plates through each
// other's edges less is left; then the other five faces are tried as the reference.
constexpr double cancelled = 1e-3;

// Faces that add less than this part of the volume are left out: steep sides of a shallow overlap.
constexpr double negligible_face = 1e-11;

namespace clipping {

// A point (u, v, w) in the reference box's frame. The fourth number repeats the third.
using Point3 = Lanes<double, 4>;
// A flag for each of its numbers.
using Flags3 = Mask<Point3>;

BC_INLINE Point3 point3(double u, double v, double w) { return Point3{u, v, w, w}; }

// Up to the first order, about the middle of a rectangle in the contact plane.
struct FirstMoments {
  double volume = 0.0;  // six times ∫ w
  Point3 first{};       // 24 times ∫ (u w, v w, w²)

  FirstMoments& operator+=(const FirstMoments& other) {
    volume += other.volume;
    first += other.first;
    return *this;
  }
};

// A quadrilateral clipped by three slabs has at most ten corners. One more is written and not counted. A
// face along a side of a slab may wind about it by rounding, which leaves some more.
struct Polygon {
  int count = 0;
  Point3 corners[16];
};

// What lies between two parallel planes: least ≤ point[axis] ≤ most.
struct Slab {
  int axis;
  double least, most;
};

// Keep what is within the slab. No branch asks whether a corner is, which no processor predicts.
inline void clip(const Polygon& from, const Slab& slab, Polygon& kept) {
  static const Flags3 on_axis[3] = {{-1}, {0, -1}, {0, 0, -1, -1}};
  Flags3 axis = on_axis[slab.axis];
  kept.count = 0;
  if (from.count == 0) return;
  Point3 before = from.corners[from.count - 1];
  double x_before = before[slab.axis];
  bool below_before = x_before < slab.least;
  bool above_before = x_before > slab.most;
  int count = 0;
  for (int i = 0; i < from.count; ++i) {
    Point3 here = from.corners[i], way = here - before;
    double x = here[slab.axis], step = x - x_before;
    bool below = x < slab.least;
    bool above = x > slab.most;
    bool rises = step > 0.0;
    // The edge crosses one plane on its way in, and then the other on its way out.
    bool at_least = below != below_before, at_most = above != above_before;
    auto crossing = [&](double plane) {
      return choose(axis, splat<Point3>(plane), before + ((plane - x_before) / step) * way);
    };
    kept.corners[count] = crossing(rises ? slab.least : slab.most);
    count += rises ? at_least : at_most;
    kept.corners[count] = crossing(rises ? slab.most : slab.least);
    count += rises ? at_most : at_least;
    kept.corners[count] = here;
    count += !(below | above);
    before = here, x_before = x;
    below_before = below, above_before = above;
  }
  kept.count = count;
}

// Call visit(twice the area, a, b, c) for the triangles of a polygon. The area is that of the projection
// on (u, v), with a sign.
template <class Visit>
BC_INLINE void each_triangle(const Polygon& polygon, Visit visit) {
  const Point3& a = polygon.corners[0];
  for (int i = 1; i + 1 < polygon.count; ++i) {
    const Point3 &b = polygon.corners[i], &c = polygon.corners[i + 1];
    Point3 ab = b - a, ac = c - a;
    visit(ab[0] * ac[1] - ac[0] * ab[1], a, b, c);
  }
}

// The moments of the columns between a polygon and the plane w = 0.
inline FirstMoments integrate(const Polygon& polygon) {
  FirstMoments sum;
  each_triangle(polygon, [&](double area, const Point3& a, const Point3& b, const Point3& c) {
    Point3 total = (a + b) + c;
    sum.volume += area * total[2];
    sum.first += area * (total[2] * total + ((a[2] * a + b[2] * b) + c[2] * c));
  });
  return sum;
}

// Call visit(polygon) for parts of a polygon that lie on one side of w = floor, those below lifted to
// there. The corners of a face are not in one plane to the last bit; of such a saddle both parts
// have the middle, hence the triangles.
template <class Visit>
inline void lifted(const Polygon& polygon, double floor, Visit visit) {
  each_triangle(polygon, [&](double, const Point3& a, const Point3& b, const Point3& c) {
    Polygon triangle{3, {a, b, c}}, part;
    double low = min(min(a[2], b[2]), c[2]), high = max(max(a[2], b[2]), c[2]);
    // A triangle in the plane, to the last bit, is a part below it and none above.
    if (high > floor) {
      clip(triangle, {2, floor, infinity}, part);
      visit(part);
    }
    if (low < floor || !(high > floor)) {
      clip(triangle, {2, -infinity, floor}, part);
      for (int k = 0; k < part.count; ++k) part.corners[k][2] = floor;
      visit(part);
    }
  });
}

// 120 times the second moments of the columns between a polygon and the plane w = 0 about a point, by
// uu vv ww and by vw uw uv. With c the point's height, a column has ∫ dw = w, ∫ (w − c) dw = w (w/2 − c)
// and ∫ (w − c)² dw = w ((w/2 − c)² + w²/12). These are products of three linear functions. With the
// sums X, Y, Z of their values x, y, z at a triangle's corners, the integral is
//   area/60 · (X Y Z + X Σ y z + Y Σ x z + Z Σ x y + 2 Σ x y z).
struct SecondMoments {
  Point3 diagonal{}, beside{};

  BC_INLINE void add(const Polygon& polygon, const Point3& about) {
    each_triangle(polygon, [&](double area, const Point3& a, const Point3& b, const Point3& c) {
      const Point3 halved{1.0, 1.0, 0.5, 0.5};
      Point3 corners[3] = {halved * a - about, halved * b - about, halved * c - about};
      double heights[3] = {a[2], b[2], c[2]}, height = (a[2] + b[2]) + c[2];
      Point3 total = (corners[0] + corners[1]) + corners[2], weighted{};
      Point3 own = height * (total * total);
      Point3 others = height * (rotated(total) * rotated_back(total));
      double squares = 0.0, cubes = 0.0;
      for (int k = 0; k < 3; ++k) {
        const Point3& x = corners[k];
        double h = heights[k], weight = height + 2.0 * h;
        weighted += h * x;
        own += weight * (x * x);
        others += weight * (rotated(x) * rotated_back(x));
        squares += h * h;
        cubes += h * (h * h);
      }
      own += 2.0 * (total * weighted);
      others += rotated(total) * rotated_back(weighted) + rotated_back(total) * rotated(weighted);
      double along = height * (height * height) + (3.0 * height * squares + 2.0 * cubes);
      own += (1.0 / 12.0) * along * Point3{0.0, 0.0, 1.0, 1.0};
      diagonal += area * own;
      beside += area * others;
    });
  }
};

// Corner c of a box has the signs of the bits 1, 2, 4 of c; faces turn counter-clockwise outside.
constexpr int face_corners[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

// The overlap with a face axis (0–5) as the reference, with its centroid in A's frame. `kept`: what part
// of the integrals' volume is left in their sum.
template <class Found>
inline Found overlap_from(const Pair<double>& pair, int face, double& kept) {
  bool of_a = face < 3;
  int w = face % 3, axes[3] = {(w + 1) % 3, (w + 2) % 3, w};
  Vec<double> own = components<double>(of_a ? pair.half_a : pair.half_b);
  Vec<double> other = components<double>(of_a ? pair.half_b : pair.half_a);
  Vec<double> offset = components<double>(of_a ? pair.offset_a : -pair.offset_b);
  Mat<double> turn = matrix(of_a ? pair.b_in_a : pair.a_in_b);
  double side = offset[w] >= 0.0 ? 1.0 : -1.0;

  // The incident box in (u, v, w): its centre, and its half axes.
  Point3 centre = point3(offset[axes[0]], offset[axes[1]], side * offset[w]);
  Point3 half = point3(own[axes[0]], own[axes[1]], own[w]), edges[3], radius{};
  for (int j = 0; j < 3; ++j) {
    edges[j] = other[j] * point3(turn[axes[0]][j], turn[axes[1]][j], side * turn[w][j]);
    radius += abs(edges[j]);
  }
  // Moments are taken about the middle of the rectangle that bounds both projections, so that a
  // small box on a large one keeps its digits. Heights count from the contact face.
  Point3 low = max(centre - radius, -half), high = min(centre + radius, half);
  const Flags3 heights{0, 0, -1, -1};
  Point3 middle = choose(heights, half, Point3(0.5 * (low + high)));
  Point3 most = half - middle, least = -half - middle;

  // 1. Corners. Bits of `outside`: above w = 0, beyond the most u and v, and the least.
  Point3 corners[8] = {centre - middle};
  unsigned outside[8];
  for (int j = 0, count = 1; j < 3; ++j, count *= 2)
    for (int c = 0; c < count; ++c) {
      corners[count + c] = corners[c] + edges[j];
      corners[c] -= edges[j];
    }
  double lowest = 0.0, floor = -2.0 * half[2];
  for (int c = 0; c < 8; ++c) {
    lowest = min(corners[c][2], lowest);
    unsigned above = bits(corners[c] > most), below = bits(corners[c] < least);
    outside[c] = (above >> 2 & 1) | (above & 3) << 1 | (below & 3) << 3;
  }
  const Slab slabs[3] = {{2, -infinity, 0.0}, {0, least[0], most[0]}, {1, least[1], most[1]}};

  FirstMoments sum;
  double gross = 0.0;
  Polygon polygons[6], clipped;
  int count = 0;
  bool through = lowest < floor;
  Vec<double> flatness = abs(row(turn, w));
  int flattest = flatness[0] > flatness[1] ? 0 : 1;
  if (flatness[2] > flatness[flattest]) flattest = 2;
  for (int k = 0; k < 6; ++k) {
    int j = (flattest + k / 2) % 3;
    const int* f = face_corners[2 * j + k % 2];
    // A face is twice as long as the size at most, and as deep as the overlap.
    double most_volume = (2.0 * pair.size) * (lowest * lowest) * flatness[j];
    if (6.0 * most_volume <= negligible_face * std::fabs(sum.volume)) continue;
    if (outside[f[0]] & outside[f[1]] & outside[f[2]] & outside[f[3]]) continue;
    // 2. Clip by the slabs that cut the face.
    unsigned beyond = outside[f[0]] | outside[f[1]] | outside[f[2]] | outside[f[3]];
    unsigned cut = (beyond & 7) | beyond >> 3 << 1;
    Polygon* polygon = &polygons[count];
    Polygon* other_polygon = &clipped;
    if (__builtin_popcount(cut) & 1) std::swap(polygon, other_polygon);  // the last one is kept
    polygon->count = 4;
    for (int k = 0; k < 4; ++k) polygon->corners[k] = corners[f[k]];
    for (; cut; cut &= cut - 1) {
      clip(*polygon, slabs[__builtin_ctz(cut)], *other_polygon);
      std::swap(polygon, other_polygon);
    }
    // 3. and 4. Integrate.
    FirstMoments part;
    if (through) {
      lifted(*polygon, floor, [&](const Polygon& lift) { part += integrate(lift); });
    } else {
      part = integrate(*polygon);
    }
    sum += part;
    gross += std::fabs(part.volume);
    ++count;
  }

  // The sign of the volume is that of the frame's handedness, and cancels in the ratios. Boxes
  // thinner than the rounding of their sizes have no volume.
  Point3 zero{}, bottom = choose(heights, splat<Point3>(max(floor, lowest)), Point3(low - middle));
  Point3 top = choose(heights, zero, Point3(high - middle));
  Point3 found = choose(heights, Point3(0.5 * bottom), zero);
  if (sum.volume != 0.0) {
    Point3 mean = (1.0 / sum.volume) * (Point3{0.25, 0.25, 0.125, 0.125} * sum.first);
    found = min(top, max(bottom, mean));
  }
  Point3 at = found + middle;
  Vec<double> centroid;
  centroid[axes[0]] = at[0];
  centroid[axes[1]] = at[1];
  centroid[w] = side * at[2];
  kept = gross > 0.0 ? std::fabs(sum.volume) / gross : 0.0;
  Found overlap;
  overlap.volume = (1.0 / 6.0) * std::fabs(sum.volume);
  Triple<double> in_a = of_a ? triple(centroid) : pair.offset_a + pair.b_in_a * triple(centroid);
  overlap.centroid = components<double>(point_in_common_frame(pair, in_a));

  // 5. Second moments about the centroid.
  if constexpr (std::is_same_v<Found, Moments<double>>) {
    SecondMoments squares;
    for (int i = 0; i < count && sum.volume != 0.0; ++i) {
      if (through) {
        lifted(polygons[i], floor, [&](const Polygon& lift) { squares.add(lift, found); });
      } else {
        squares.add(polygons[i], found);
      }
    }
    double scale = sum.volume != 0.0 ? 0.05 / sum.volume : 0.0;
    Sym<double> covariance;
    for (int d = 0; d < 3; ++d) {
      covariance(axes[d], axes[d]) = scale * squares.diagonal[d];
      covariance(axes[(d + 1) % 3], axes[(d + 2) % 3]) =
          (d < 2 ? side * scale : scale) * squares.beside[d];
    }
    Vec<double> ranges;
    for (int d = 0; d < 3; ++d) ranges[axes[d]] = top[d] - bottom[d];
    make_possible(covariance, ranges);
    overlap.covariance = rotated(of_a ? pair.axes_a : pair.axes_b, covariance);
  }
  return overlap;
}

}  // namespace clipping

// The overlap of a pair that has been pressed in. `face`: the best face axis, 0–5. Found: Moments, or
// PointAndVolume.
template <class Found>
inline Found overlap_by_clipping(const Pair<double>& pair, int face) {
  double kept;
  Found best = clipping::overlap_from<Found>(pair, face, kept);
  if (kept < cancelled) {
    for (int other = 0; other < 6; ++other) {
      if (other == face) continue;
      double kept_by_other;
      Found candidate = clipping::overlap_from<Found>(pair, other, kept_by_other);
      if (kept_by_other > kept) best = candidate, kept = kept_by_other;
    }
  }
  return best;
}

}  // namespace box_contact::BOX_CONTACT_SET
