// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The separating-axis test with 32 digits, for edges that are almost parallel.
//
// Where two edges almost along each other meet, their cross product is what a cancellation leaves.
// At an angle of θ its direction is good to 1e-16/θ. That matters only if another
// axis wins by less than the gap along it may be wrong; `SeparatingAxis::doubtful` marks those
// pairs. Without this, some have depths wrong by up to 1e-8 of the size.
#pragma once

#include <cmath>

#include "separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A number as the unevaluated sum of two doubles (Dekker 1971; Knuth, The Art of Computer
// Programming 2, section 4.2.2). Compile without fused multiply-add.
struct DoubleDouble {
  double high = 0.0, low = 0.0;

  DoubleDouble() = default;
  DoubleDouble(double h, double l = 0.0) : high(h), low(l) {}  // NOLINT: doubles convert
};

// The sum of two doubles, exactly.
inline DoubleDouble exact_sum(double a, double b) {
  double s = a + b, c = s - a;
  return {s, (a - (s - c)) + (b - c)};
}
// The same for |a| ≥ |b|.
inline DoubleDouble quick_sum(double a, double b) {
  double s = a + b;
  return {s, b - (s - a)};
}
// The product of two doubles, exactly.
inline DoubleDouble exact_product(double a, double b) {
  constexpr double split = 0x1p27 + 1.0;
  double p = a * b;
  double c = split * a, a_high = c - (c - a), a_low = a - a_high;
  double d = split * b, b_high = d - (d - b), b_low = b - b_high;
  return {p, ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low};
}

inline DoubleDouble operator-(DoubleDouble a) { return {-a.high, -a.low}; }
inline DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  DoubleDouble high = exact_sum(a.high, b.high), low = exact_sum(a.low, b.low);
  DoubleDouble sum = quick_sum(high.high, high.low + low.high);
  return quick_sum(sum.high, sum.low + low.low);
}
inline DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + -b; }
inline DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  DoubleDouble p = exact_product(a.high, b.high);
  return quick_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}
inline DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
  double first = a.high / b.high;
  DoubleDouble rest = a - b * DoubleDouble(first);
  double second = rest.high / b.high;
  rest = rest - b * DoubleDouble(second);
  return quick_sum(first, second) + DoubleDouble(rest.high / b.high);
}
inline DoubleDouble abs(DoubleDouble a) { return a.high < 0.0 ? -a : a; }
// One step of Newton's method from the rounded root.
inline DoubleDouble sqrt(DoubleDouble a) {
  double root = std::sqrt(a.high);
  if (!(root > 0.0)) return {};
  DoubleDouble rest = a - exact_product(root, root);
  return quick_sum(root, rest.high / (2.0 * root));
}

// Two boxes in A's frame.
struct PrecisePair {
  Vec<double> half_a, half_b;
  DoubleDouble rotation[3][3];  // B's axes as columns
  DoubleDouble offset_a[3];     // from A to B
  DoubleDouble offset_b[3];     // the same, in B's frame
};

// Scale a quaternion by a power of two: fourth powers of its components must not overflow.
inline void scale_to_unit(double q[4]) {
  double largest = 0.0;
  for (int k = 0; k < 4; ++k) largest = max(std::fabs(q[k]), largest);
  int exponent;
  std::frexp(largest, &exponent);
  for (int k = 0; k < 4; ++k) q[k] = std::ldexp(q[k], -exponent);
}

inline void precise_rotation(const DoubleDouble q[4], DoubleDouble m[3][3]) {
  DoubleDouble x = q[0], y = q[1], z = q[2], w = q[3], two(2.0);
  DoubleDouble xx = x * x, yy = y * y, zz = z * z, ww = w * w;
  DoubleDouble xy = x * y, xz = x * z, yz = y * z, xw = x * w, yw = y * w, zw = z * w;
  DoubleDouble n = (xx + yy) + (zz + ww);
  m[0][0] = ((ww + xx) - (yy + zz)) / n;
  m[0][1] = (two * (xy - zw)) / n;
  m[0][2] = (two * (xz + yw)) / n;
  m[1][0] = (two * (xy + zw)) / n;
  m[1][1] = ((ww + yy) - (xx + zz)) / n;
  m[1][2] = (two * (yz - xw)) / n;
  m[2][0] = (two * (xz - yw)) / n;
  m[2][1] = (two * (yz + xw)) / n;
  m[2][2] = ((ww + zz) - (xx + yy)) / n;
}

// conj(p) ⊗ q: q's orientation in p's frame.
inline void relative_quaternion(const double p[4], const double q[4], DoubleDouble relative[4]) {
  // Each component is the sum of four products p[i] · q[j], in this order and with these signs.
  struct Term {
    int i, j;
    double sign;
  };
  constexpr Term terms[4][4] = {{{3, 0, 1}, {0, 3, -1}, {1, 2, -1}, {2, 1, 1}},
                                {{3, 1, 1}, {0, 2, 1}, {1, 3, -1}, {2, 0, -1}},
                                {{3, 2, 1}, {0, 1, -1}, {1, 0, 1}, {2, 3, -1}},
                                {{3, 3, 1}, {0, 0, 1}, {1, 1, 1}, {2, 2, 1}}};
  for (int k = 0; k < 4; ++k) {
    DoubleDouble sum;
    for (const Term& term : terms[k]) {
      DoubleDouble product = exact_product(p[term.i], q[term.j]);
      sum = sum + (term.sign > 0.0 ? product : -product);
    }
    relative[k] = sum;
  }
}

inline PrecisePair precise_pair(const Pair<double>& pair, Pose<double> a, Pose<double> b) {
  scale_to_unit(a.quaternion);
  scale_to_unit(b.quaternion);
  PrecisePair precise;
  precise.half_a = components<double>(pair.half_a);
  precise.half_b = components<double>(pair.half_b);
  DoubleDouble relative[4], own[4], axes[3][3];
  relative_quaternion(a.quaternion, b.quaternion, relative);
  precise_rotation(relative, precise.rotation);
  for (int k = 0; k < 4; ++k) own[k] = a.quaternion[k];
  precise_rotation(own, axes);
  for (int k = 0; k < 3; ++k) {
    DoubleDouble sum;
    for (int j = 0; j < 3; ++j) sum = sum + axes[j][k] * exact_sum(b.position[j], -a.position[j]);
    precise.offset_a[k] = sum;
  }
  for (int k = 0; k < 3; ++k) {
    DoubleDouble sum;
    for (int j = 0; j < 3; ++j) sum = sum + precise.rotation[j][k] * precise.offset_a[j];
    precise.offset_b[k] = sum;
  }
  return precise;
}

// The gap on an axis, rounded once; −∞ where there is no axis.
inline double precise_gap(const PrecisePair& pair, int axis) {
  if (axis < first_edge_axis) {
    bool own = axis < 3;
    int k = axis % 3;
    const Vec<double>&half = own ? pair.half_a : pair.half_b,
          &across = own ? pair.half_b : pair.half_a;
    DoubleDouble gap = abs(own ? pair.offset_a[k] : pair.offset_b[k]) + DoubleDouble(-half[k]);
    for (int j = 0; j < 3; ++j)
      gap = gap + abs(own ? pair.rotation[k][j] : pair.rotation[j][k]) * DoubleDouble(-across[j]);
    return gap.high;
  }
  int k = (axis - first_edge_axis) / 3, j = (axis - first_edge_axis) % 3;
  int k1 = (k + 1) % 3, k2 = (k + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
  DoubleDouble u = pair.rotation[k1][j], v = pair.rotation[k2][j];
  DoubleDouble length = sqrt(u * u + v * v);
  if (!(length.high > cross_product_min)) return -infinity;
  DoubleDouble gap = abs(pair.offset_a[k2] * u - pair.offset_a[k1] * v);
  gap = gap + abs(v) * DoubleDouble(-pair.half_a[k1]);
  gap = gap + abs(u) * DoubleDouble(-pair.half_a[k2]);
  gap = gap + abs(pair.rotation[k][j2]) * DoubleDouble(-pair.half_b[j1]);
  gap = gap + abs(pair.rotation[k][j1]) * DoubleDouble(-pair.half_b[j2]);
  return (gap / length).high;
}

// An axis as a unit vector from A to B, in A's frame.
inline Vec<double> precise_normal(const PrecisePair& pair, int axis) {
  double rotation[3][3], offset[3];
  for (int k = 0; k < 3; ++k) {
    offset[k] = pair.offset_a[k].high;
    for (int j = 0; j < 3; ++j) rotation[k][j] = pair.rotation[k][j].high;
  }
  Vec<double> n{};
  if (axis < 3) {
    n[axis] = 1.0;
  } else if (axis < first_edge_axis) {
    for (int k = 0; k < 3; ++k) n[k] = rotation[k][axis - 3];
  } else {
    int k = (axis - first_edge_axis) / 3, j = (axis - first_edge_axis) % 3;
    n[(k + 1) % 3] = -rotation[(k + 2) % 3][j];
    n[(k + 2) % 3] = rotation[(k + 1) % 3][j];
  }
  double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (int k = 0; k < 3; ++k) n[k] /= length;
  double along = n[0] * offset[0] + n[1] * offset[1] + n[2] * offset[2];
  return along >= 0.0 ? n : -n;
}

// Evaluate a doubtful pair anew, from the very doubles of its poses: separation, axis and normal.
inline void refine(const Pair<double>& pair, const Pose<double>& a, const Pose<double>& b,
                   SeparatingAxis<double>& found) {
  PrecisePair precise = precise_pair(pair, a, b);
  double best = -infinity, largest = best;
  double tolerance = tie * pair.size;
  int axis = 0;
  for (int number = 0; number < 15; ++number) {
    double gap = precise_gap(precise, number);
    largest = max(gap, largest);
    if (gap > best + tolerance) best = gap, axis = number;
  }
  // Lengths beyond what can be split in two: what the test found in float64 stands.
  if (!__builtin_isfinite(largest)) return;
  found.separation = largest;
  found.axis = axis;
  found.normal = triple(precise_normal(precise, axis));
}

}  // namespace box_contact::BOX_CONTACT_SET
