// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which numbers the forces accept.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "../poses.hpp"

namespace box_contact::detail {

// Masses [kg] and moments of inertia [kg m²] accepted: a product of three inverses is a number.
constexpr double mass_min = 1e-50, mass_max = 1e50;
// By how much of it a moment of inertia may exceed the sum of the two others [1]: rounding.
constexpr double inertia_slack = 1e-9;
// Speeds accepted, at most [m/s], [rad/s]: their squares times a moment of inertia are numbers.
constexpr double speed_max = 1e50;
// Forces, torques and impulses accepted, at most [N], [N m], [N s]: those of the largest mass at the
// largest speed.
constexpr double wrench_max = 1e100;
// Times and frictions accepted, at most [s], [1]: their squares are numbers.
constexpr double amount_max = 1e50;
// Steps accepted [s]: at least this long, so that a speed divided by one is a number; and shorter than
// that, as nothing that touches stays within its patch for so long.
constexpr double step_min = 1e-50, step_limit = 1.0;
// Most sub-steps that may be asked for.
constexpr int substeps_max = 1000;
// By how much of its trace an eigenvalue of a covariance may be below zero [1]: rounding.
constexpr double covariance_slack = 1e-9;

// NaN fails all of these.
inline bool are_within(const double* numbers, int64_t count, double limit) {
  return std::all_of(numbers, numbers + count,
                     [limit](double number) { return std::fabs(number) <= limit; });
}
inline bool is_amount(double number) { return number >= 0.0 && number <= amount_max; }
inline bool is_mass(double number) { return number >= mass_min && number <= mass_max; }
inline bool is_inertia(const Vec<double>& moments) {
  return (moments[0] + moments[1]) + moments[2] >= (2.0 - inertia_slack) * largest(moments);
}

// Whether numbers (3, 3) are symmetric, and have no eigenvalue below zero: by the pivots of Cholesky's
// decomposition, with the slack on the diagonal.
inline bool is_covariance(const double* c) {
  double trace = (c[0] + c[4]) + c[8], s = 1.0 / trace;
  if (!(trace > 0.0 && trace <= largest_number)) return false;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < i; ++j)
      if (!(std::fabs(c[3 * i + j] - c[3 * j + i]) <= covariance_slack * trace)) return false;
  double xx = s * c[0] + covariance_slack, xy = s * c[1], xz = s * c[2];
  double yy = s * c[4] + covariance_slack - xy * xy / xx, yz = s * c[5] - xy * xz / xx;
  double zz = s * c[8] + covariance_slack - xz * xz / xx - yz * yz / yy;
  return xx > 0.0 && yy > 0.0 && zz > 0.0;
}

}  // namespace box_contact::detail
