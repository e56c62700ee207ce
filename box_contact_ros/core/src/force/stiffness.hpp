// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// How fast a body oscillates on the patches that it touches: the largest eigenvalue of M⁻¹K.
#pragma once

#include <algorithm>
#include <cmath>

#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Width of a patch by its length, at least [1]: e₁·e₂ is a difference of products, which rounding
// spoils by 1e-16 of e₁². So much area keeps moduli finite where an edge only just touches.
constexpr double least_aspect = 1e-7;

// Mean distance from the centre of a rectangle by √(e₁ + e₂): 0.866 of a line, 0.937 of a square.
// Between them linear in 2·√(e₁·e₂) / (e₁ + e₂), to 1 %.
constexpr double radius_of_line = 0.866025403784438647, radius_of_square = 0.937082;

// Friction and torsion together are less than on an ellipsoid: f² + m² + a·f²·m² ≤ 1. A square has
// this `a` [1], a line has a = 0. Other patches have this `a` times the square of their squareness.
constexpr double dent_of_square = 0.45;

// What of an overlap does not depend on any body.
struct PatchShape {
  Mat<double> covariance;  // within the tangent plane [m²]
  double area;             // 12·√(e₁·e₂) of its eigenvalues [m²]: exact for a rectangle
  double spread;           // e₁ + e₂ [m²]
  double radius;           // at which friction resists spin [m]
  double dent;             // of the limit surface of friction [1]
};

inline PatchShape shape_of(const bc_contact& contact) {
  Vec<double> n = vector(contact.normal);
  Mat<double> tangent, c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) tangent[i][j] = (i == j ? 1.0 : 0.0) - n[i] * n[j];
  for (int j = 0; j < 3; ++j) {
    Vec<double> spread = tangent * (vector3(contact.covariance) * column(tangent, j));
    for (int i = 0; i < 3; ++i) c[i][j] = spread[i];
  }
  // e₁·e₂ is the sum of the three principal minors of two rows.
  double product =
      ((c[0][0] * c[1][1] - c[0][1] * c[1][0]) + (c[1][1] * c[2][2] - c[1][2] * c[2][1])) +
      (c[2][2] * c[0][0] - c[2][0] * c[0][2]);
  double spread = std::max(0.0, (c[0][0] + c[1][1]) + c[2][2]);
  double middle = std::sqrt(std::max(0.0, product));
  double squareness = spread > 0.0 ? std::min(1.0, 2.0 * middle / spread) : 1.0;
  double radius = radius_of_line + (radius_of_square - radius_of_line) * squareness;
  return {c, 12.0 * std::max(middle, least_aspect * spread), spread, radius * std::sqrt(spread),
          dent_of_square * squareness * squareness};
}

// A symmetric matrix (6, 6) of a body's motions, scaled so that its mass matrix is 1.
struct Stiffness {
  double k[6][6] = {};

  void add(double factor, const double (&r)[6]) {
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) k[i][j] += factor * (r[i] * r[j]);
  }

  // The largest eigenvalue, by cyclic Jacobi rotations (Golub and Van Loan, section 8.5).
  double largest_eigenvalue() const {
    constexpr double small = 1e-10;  // of the trace: what is left beside the diagonal changes less
    double a[6][6], trace = 0.0, largest = 0.0;
    std::copy_n(&k[0][0], 36, &a[0][0]);
    for (int i = 0; i < 6; ++i) trace += a[i][i];
    for (bool rotated = true; rotated;) {
      rotated = false;
      for (int p = 0; p < 5; ++p)
        for (int q = p + 1; q < 6; ++q)
          if (std::fabs(a[p][q]) > small * trace) rotate(a, p, q), rotated = true;
    }
    for (int i = 0; i < 6; ++i) largest = std::max(largest, a[i][i]);
    return largest;
  }

 private:
  static void rotate(double (&a)[6][6], int p, int q) {
    double half = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    double t = (half >= 0.0 ? 1.0 : -1.0) / (std::fabs(half) + std::sqrt(half * half + 1.0));
    double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
    a[p][p] -= t * a[p][q];
    a[q][q] += t * a[p][q];
    a[p][q] = a[q][p] = 0.0;
    for (int i = 0; i < 6; ++i) {
      if (i == p || i == q) continue;
      double x = a[p][i], y = a[q][i];
      a[i][p] = a[p][i] = c * x - s * y;
      a[i][q] = a[q][i] = s * x + c * y;
    }
  }
};

// Add what a patch resists, on a foundation of modulus 1: to `normal` pressing and rocking, to
// `shear` sliding and spinning. `factor` is 2 where both bodies of the pair are free.
inline void add_patch(const Body& body, const Placed& placed, const Vec<double>& n,
                      const Vec<double>& point, const PatchShape& shape, double factor,
                      Stiffness& normal, Stiffness& shear) {
  double linear = std::sqrt(body.inverse_mass);
  Vec<double> angular{std::sqrt(body.inverse_inertia[0]), std::sqrt(body.inverse_inertia[1]),
                      std::sqrt(body.inverse_inertia[2])};
  Vec<double> arm = point - placed.position;
  // The speed along `d` of the body's point under the patch, by each of its scaled motions.
  auto row_of = [&](const Vec<double>& d, double (&r)[6]) {
    Vec<double> turning = angular * transposed_times(placed.axes, cross(arm, d));
    for (int k = 0; k < 3; ++k) r[k] = linear * d[k], r[3 + k] = turning[k];
  };
  double r[6];
  row_of(n, r);
  normal.add(factor * shape.area, r);
  Vec<double> t1, t2;
  tangents(n, t1, t2);
  for (const Vec<double>* t : {&t1, &t2}) {
    row_of(*t, r);
    shear.add(factor * shape.area, r);
  }
  Vec<double> slopes[3], about = angular * transposed_times(placed.axes, n);
  for (int k = 0; k < 3; ++k) slopes[k] = angular[k] * cross(n, column(placed.axes, k));
  for (int i = 0; i < 3; ++i) {
    Vec<double> spread = shape.covariance * slopes[i];
    for (int j = 0; j < 3; ++j) {
      normal.k[3 + i][3 + j] += factor * shape.area * dot(slopes[j], spread);
      shear.k[3 + i][3 + j] += factor * shape.area * shape.spread * (about[i] * about[j]);
    }
  }
}

}  // namespace box_contact::BOX_CONTACT_SET::force
