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
// 2. Each other face is clipped by the rectangle's four sides and by w ≤ 0 (Sutherland–Hodgman).
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

namespace clipping {

// Up to the first order, about the middle of a rectangle in the contact plane.
struct FirstMoments {
  double volume = 0.0, u = 0.0, v = 0.0, w = 0.0;

  FirstMoments& operator+=(const FirstMoments& other) {
    volume += other.volume;
    u += other.u;
    v += other.v;
    w += other.w;
    return *this;
  }
};

// A quadrilateral clipped by six planes has at most ten corners.
struct Polygon {
  int count = 0;
  Vec<double> corners[12];
};

// Keep the part with sign · corner[axis] ≤ bound.
inline Polygon clip(const Polygon& from, int axis, double sign, double bound) {
  Polygon kept;
  if (from.count == 0) return kept;
  Vec<double> before = from.corners[from.count - 1];
  double excess_before = sign * before[axis] - bound;
  for (int i = 0; i < from.count; ++i) {
    Vec<double> here = from.corners[i];
    double excess = sign * here[axis] - bound;
    if ((excess > 0.0) != (excess_before > 0.0)) {
      double share = excess_before / (excess_before - excess);
      Vec<double> crossing = before + share * (here - before);
      crossing[axis] = sign * bound;
      kept.corners[kept.count++] = crossing;
    }
    if (!(excess > 0.0)) kept.corners[kept.count++] = here;
    before = here;
    excess_before = excess;
  }
  return kept;
}

// Signed ∫ (w, u w, v w, w²/2) over the polygon's projection on (u, v).
inline FirstMoments integrate(const Polygon& polygon) {
  FirstMoments sum;
  const Vec<double>& a = polygon.corners[0];
  for (int i = 1; i + 1 < polygon.count; ++i) {
    const Vec<double>&b = polygon.corners[i], &c = polygon.corners[i + 1];
    double twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    Vec<double> total = a + b + c;
    Vec<double> products = a[2] * a + b[2] * b + c[2] * c;
    sum.volume += twice_area * total[2] * (1.0 / 6.0);
    sum.u += twice_area * (total[0] * total[2] + products[0]) * (1.0 / 24.0);
    sum.v += twice_area * (total[1] * total[2] + products[1]) * (1.0 / 24.0);
    sum.w += twice_area * (total[2] * total[2] + products[2]) * (1.0 / 48.0);
  }
  return sum;
}

// Call visit(polygon) for parts of a polygon that lie on one side of w = floor, those below lifted to
// there. The corners of a face are not in one plane to the last bit; of such a saddle both parts
// have the middle, hence the triangles.
template <class Visit>
inline void lifted(const Polygon& polygon, double floor, Visit visit) {
  for (int i = 1; i + 1 < polygon.count; ++i) {
    Polygon triangle{3, {polygon.corners[0], polygon.corners[i], polygon.corners[i + 1]}};
    Vec<double> heights{triangle.corners[0][2], triangle.corners[1][2], triangle.corners[2][2]};
    double low = smallest(heights), high = largest(heights);
    // A triangle in the plane, to the last bit, is a part below it and none above.
    if (high > floor) visit(clip(triangle, 2, -1.0, -floor));
    if (low < floor || !(high > floor)) {
      Polygon below = clip(triangle, 2, 1.0, floor);
      for (int k = 0; k < below.count; ++k) below.corners[k][2] = floor;
      visit(below);
    }
  }
}

// Signed second moments, about `centre`, of the columns between the polygon and the plane w = 0. With
// c the centre's height, a column has ∫ dw = w, ∫ (w − c) dw = w (w/2 − c), and
// ∫ (w − c)² dw = w ((w/2 − c)² + w²/12): products of three linear functions on each triangle.
inline Sym<double> integrate_squares(const Polygon& polygon, const Vec<double>& centre) {
  Sym<double> sum{};
  auto moved = [&](int i) -> Vec<double> {
    const Vec<double>& corner = polygon.corners[i];
    return {corner[0] - centre[0], corner[1] - centre[1], corner[2]};
  };
  Vec<double> a = moved(0);
  for (int i = 1; i + 1 < polygon.count; ++i) {
    Vec<double> b = moved(i), c = moved(i + 1);
    double twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    // ∫ f g h over the triangle, for linear functions by their values at the corners.
    auto integral = [&](const Vec<double>& f, const Vec<double>& g, const Vec<double>& h) {
      Vec<double> one{1.0, 1.0, 1.0};
      Vec<double> gh{g[0] * h[0], g[1] * h[1], g[2] * h[2]};
      double of_f = dot(one, f), of_g = dot(one, g), of_h = dot(one, h);
      double fg = dot(f, g), fh = dot(f, h);
      return twice_area * (1.0 / 120.0) *
             ((of_f * of_g * of_h + 2.0 * dot(f, gh)) +
              (of_f * dot(one, gh) + (of_g * fh + of_h * fg)));
    };
    Vec<double> u{a[0], b[0], c[0]}, v{a[1], b[1], c[1]}, w{a[2], b[2], c[2]};
    Vec<double> middle = 0.5 * w - Vec<double>{centre[2], centre[2], centre[2]};
    sum(0, 0) += integral(w, u, u);
    sum(1, 1) += integral(w, v, v);
    sum(0, 1) += integral(w, u, v);
    sum(0, 2) += integral(w, u, middle);
    sum(1, 2) += integral(w, v, middle);
    sum(2, 2) += integral(w, middle, middle) + integral(w, w, w) * (1.0 / 12.0);
  }
  return sum;
}

// Corner c of a box has the signs of the bits 1, 2, 4 of c; faces turn counter-clockwise outside.
constexpr int face_corners[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

// The overlap with a face axis (0–5) as the reference. `kept`: what part of the integrals' volume is
// left in their sum.
inline Moments<double> overlap_from(const Pair<double>& pair, int face, double& kept) {
  bool of_a = face < 3;
  int w = face % 3, axes[3] = {(w + 1) % 3, (w + 2) % 3, w};
  Vec<double> own = components<double>(of_a ? pair.half_a : pair.half_b);
  Vec<double> other = components<double>(of_a ? pair.half_b : pair.half_a);
  Vec<double> offset = components<double>(of_a ? pair.offset_a : -pair.offset_b);
  Mat<double> turn = matrix(of_a ? pair.b_in_a : pair.a_in_b);
  double side = offset[w] >= 0.0 ? 1.0 : -1.0;

  // The incident box in (u, v, w): its centre, and its half axes as columns.
  Vec<double> centre, half;
  Mat<double> edges;
  for (int d = 0; d < 3; ++d) {
    int x = axes[d];
    centre[d] = offset[x];
    half[d] = own[x];
    for (int j = 0; j < 3; ++j) edges[d][j] = (d == 2 ? side : 1.0) * (other[j] * turn[x][j]);
  }
  // Moments are taken about the middle of the rectangle that bounds both projections, so that a
  // small box on a large one keeps its digits.
  double low[2], high[2], middle[2];
  for (int d = 0; d < 2; ++d) {
    Vec<double> reach = abs(row(edges, d));
    double radius = reach[0] + reach[1] + reach[2];
    low[d] = max(centre[d] - radius, -half[d]);
    high[d] = min(centre[d] + radius, half[d]);
    middle[d] = 0.5 * (low[d] + high[d]);
  }

  // 1. Corners, w measured from the contact face. Bits of `outside`: above it, beyond ±u, ±v.
  Vec<double> start{centre[0] - middle[0], centre[1] - middle[1], side * centre[2] - half[2]};
  double bounds[5] = {0.0, half[0] - middle[0], half[0] + middle[0], half[1] - middle[1],
                      half[1] + middle[1]};
  constexpr int bound_axes[5] = {2, 0, 0, 1, 1};
  constexpr double bound_signs[5] = {1.0, 1.0, -1.0, 1.0, -1.0};
  Vec<double> corners[8];
  unsigned outside[8];
  double lowest = 0.0, floor = -2.0 * half[2];
  for (int c = 0; c < 8; ++c) {
    Vec<double> signs{c & 1 ? 1.0 : -1.0, c & 2 ? 1.0 : -1.0, c & 4 ? 1.0 : -1.0};
    corners[c] = start + edges * signs;
    lowest = min(corners[c][2], lowest);
    outside[c] = 0;
    for (int k = 0; k < 5; ++k)
      outside[c] |= unsigned(bound_signs[k] * corners[c][bound_axes[k]] > bounds[k]) << k;
  }

  FirstMoments sum;
  double gross = 0.0;
  Polygon polygons[6];
  int count = 0;
  bool through = lowest < floor;
  for (const int* f : face_corners) {
    if (outside[f[0]] & outside[f[1]] & outside[f[2]] & outside[f[3]]) continue;
    // 2. Clip by the planes that cut the face.
    unsigned cut = outside[f[0]] | outside[f[1]] | outside[f[2]] | outside[f[3]];
    Polygon polygon{4, {corners[f[0]], corners[f[1]], corners[f[2]], corners[f[3]]}};
    for (int k = 0; k < 5; ++k)
      if (cut >> k & 1U) polygon = clip(polygon, bound_axes[k], bound_signs[k], bounds[k]);
    // 3. and 4. Integrate.
    FirstMoments part;
    if (through) {
      lifted(polygon, floor, [&](const Polygon& lift) { part += integrate(lift); });
    } else {
      part = integrate(polygon);
    }
    sum += part;
    gross += std::fabs(part.volume);
    polygons[count++] = polygon;
  }

  // The sign of the volume is that of the frame's handedness, and cancels in the ratios. Boxes
  // thinner than the rounding of their sizes have no volume.
  Vec<double> found{};
  double least = max(floor, lowest);
  if (sum.volume != 0.0) {
    found[0] = min(high[0] - middle[0], max(low[0] - middle[0], sum.u / sum.volume));
    found[1] = min(high[1] - middle[1], max(low[1] - middle[1], sum.v / sum.volume));
    found[2] = min(0.0, max(least, sum.w / sum.volume));
  } else {
    found[2] = 0.5 * least;
  }
  Vec<double> centroid;
  centroid[axes[0]] = middle[0] + found[0];
  centroid[axes[1]] = middle[1] + found[1];
  centroid[w] = side * (found[2] + half[2]);
  kept = gross > 0.0 ? std::fabs(sum.volume) / gross : 0.0;

  // 5. Second moments about the centroid.
  Sym<double> squares{};
  auto add = [&](const Polygon& polygon) { squares = squares + integrate_squares(polygon, found); };
  for (int i = 0; i < count && sum.volume != 0.0; ++i) {
    if (through) {
      lifted(polygons[i], floor, add);
    } else {
      add(polygons[i]);
    }
  }
  Sym<double> covariance;
  double scale = sum.volume != 0.0 ? 1.0 / sum.volume : 0.0;
  for (int d = 0; d < 3; ++d)
    for (int e = d; e < 3; ++e)
      covariance(axes[d], axes[e]) = (d < 2 && e == 2 ? side * scale : scale) * squares(d, e);
  Vec<double> ranges;
  ranges[axes[0]] = high[0] - low[0];
  ranges[axes[1]] = high[1] - low[1];
  ranges[w] = -least;
  make_possible(covariance, ranges);
  double volume = std::fabs(sum.volume);
  if (of_a) return {{volume, centroid}, rotated(pair.axes_a, covariance)};
  Vec<double> in_a = components<double>(pair.offset_a + pair.b_in_a * triple(centroid));
  return {{volume, in_a}, rotated(pair.axes_b, covariance)};
}

}  // namespace clipping

// The overlap of a pair that has been pressed in. `face`: the best face axis, 0–5.
inline Moments<double> overlap_by_clipping(const Pair<double>& pair, int face) {
  double kept;
  Moments<double> best = clipping::overlap_from(pair, face, kept);
  if (kept < cancelled) {
    for (int other = 0; other < 6; ++other) {
      double kept_by_other;
      Moments<double> candidate = clipping::overlap_from(pair, other, kept_by_other);
      if (kept_by_other > kept) best = candidate, kept = kept_by_other;
    }
  }
  return best;
}

}  // namespace box_contact::BOX_CONTACT_SET
