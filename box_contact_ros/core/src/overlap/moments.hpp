// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The moments of the overlap A∩B that a model finds: volume, centroid, covariance.
#pragma once

#include <cmath>

#include "../lanes/triples.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A symmetric 3 × 3 matrix: xx, yy, zz, yz, xz, xy.
template <class T>
struct Sym {
  T s[6];

  BC_INLINE T& operator()(int i, int j) { return s[i == j ? i : 6 - i - j]; }
  BC_INLINE const T& operator()(int i, int j) const { return s[i == j ? i : 6 - i - j]; }
};

// R · S · Rᵀ: a tensor of one frame in another, where R's columns are the axes of the first.
template <class T>
BC_INLINE Sym<T> rotated(const Columns<T>& axes, const Sym<T>& s) {
  Columns<T> rows, r = transpose(axes);
  for (int i = 0; i < 3; ++i) rows[i] = triple(Vec<T>{s(i, 0), s(i, 1), s(i, 2)});
  Sym<T> found;
  for (int i = 0; i < 3; ++i) {
    Triple<T> turned = axes * (rows * r[i]);
    for (int j = i; j < 3; ++j) found(i, j) = turned[j];
  }
  return found;
}

// Keep a covariance possible where rounding has spoilt it: variances of what lies within these ranges,
// and no negative eigenvalue. Of needles thinner than 1e-5 squares of the length may be left.
inline void make_possible(Sym<double>& covariance, const Vec<double>& ranges) {
  bool is_spoilt = false;
  int k = 0;
  for (int i = 0; i < 3; ++i) {
    double most = 0.25 * ranges[i] * ranges[i];
    is_spoilt = is_spoilt || covariance(i, i) > most;
    covariance(i, i) = min(most, max(covariance(i, i), 0.0));
    if (covariance(i, i) > covariance(k, k)) k = i;
  }
  // By the largest variance first; what it leaves of the others is a covariance, too.
  int i = (k + 1) % 3, j = (k + 2) % 3;
  double &ki = covariance(k, i), &kj = covariance(k, j), &ij = covariance(i, j);
  double variance = covariance(k, k);
  if (is_spoilt || !(variance > 0.0)) {
    ki = kj = ij = 0.0;
    return;
  }
  auto limit = [](double x, double most) { return min(most, max(x, -most)); };
  ki = limit(ki, std::sqrt(variance * covariance(i, i)));
  kj = limit(kj, std::sqrt(variance * covariance(j, j)));
  double left_i = max(covariance(i, i) - ki * (ki / variance), 0.0);
  double left_j = max(covariance(j, j) - kj * (kj / variance), 0.0);
  double by_k = ki * (kj / variance);
  double most = std::sqrt(left_i * left_j);
  if (std::fabs(ij - by_k) > most) ij = by_k + limit(ij - by_k, most);
}

// What a model finds of the overlap without its second moments.
template <class T>
struct PointAndVolume {
  static constexpr bool has_normal = false;  // a normal of the model's own

  T volume;         // [m³]
  Vec<T> centroid;  // common frame [m]
};

// What a model finds of the overlap.
template <class T>
struct Moments : PointAndVolume<T> {
  Sym<T> covariance;  // second central moments by the volume, common frame [m²]
};

}  // namespace box_contact::BOX_CONTACT_SET
