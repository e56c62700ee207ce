// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The twelve edges of a box, each cut off where it leaves the other box.
//
// Three slabs cut an edge (Kay and Kajiya 1986). Its direction in the other box's frame is a row or
// a column of R, so nine reciprocals serve all edges of both boxes.
#pragma once

#include "../poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Least magnitude of an entry of R that is inverted: an edge exactly along a slab must not give
// 0 · ∞, and three of them multiplied must not underflow.
constexpr double least_entry = 1e-90;

// Reciprocals of the entries of R, given by its columns. Three need one division.
template <class T>
BC_INLINE Columns<T> reciprocals(const Columns<T>& r) {
  auto away_from_zero = [](auto entry) {
    return select(abs(entry) > least_entry, entry, splat<decltype(entry)>(least_entry));
  };
  Columns<T> x;
  for (int j = 0; j < 3; ++j) x[j] = each(away_from_zero, r[j]);
  Triple<T> product = uniform(splat<T>(1.0)) / (x[0] * (x[1] * x[2]));
  return {{product * (x[1] * x[2]), product * (x[0] * x[2]), product * (x[0] * x[1])}};
}
template <class T>
BC_INLINE Mat<T> reciprocals(const Mat<T>& r) {
  return matrix(reciprocals(columns(r)));
}

// Most algorithms here do the same for the four signs (σ, τ) of two axes: one after the other for W
// pairs, side by side for a single pair. Step or lane n has σ = − + − +, τ = − − + +.
template <class T>
using Four = std::conditional_t<is_scalar<T>, Lanes<double, 4>, T>;
template <class T>
constexpr int steps = is_scalar<T> ? 1 : 4;

template <class T>
BC_INLINE auto sigma(int n) {
  if constexpr (is_scalar<T>) {
    return Lanes<double, 4>{-1.0, 1.0, -1.0, 1.0};
  } else {
    return n & 1 ? 1.0 : -1.0;
  }
}
template <class T>
BC_INLINE auto tau(int n) {
  if constexpr (is_scalar<T>) {
    return Lanes<double, 4>{-1.0, -1.0, 1.0, 1.0};
  } else {
    return n & 2 ? 1.0 : -1.0;
  }
}
// The sum over all signs, in the same order for one pair and for W.
template <class T>
BC_INLINE T sum_of(const Four<T> (&terms)[steps<T>]) {
  if constexpr (is_scalar<T>) {
    return (terms[0][0] + terms[0][1]) + (terms[0][2] + terms[0][3]);
  } else {
    return (terms[0] + terms[1]) + (terms[2] + terms[3]);
  }
}

// What the other box leaves of the twelve edges of a box X: from s to t along axis j, seen from the
// edge's middle; nothing where t < s. [axis j][n]: σ is the sign of axis j + 1, τ of axis j + 2.
template <class T>
struct EdgePieces {
  Four<T> s[3][steps<T>], t[3][steps<T>];
  T length;     // sum of their weighted lengths [m]
  Vec<T> mean;  // sum of their middles times these, in X's frame [m²]
};

// Weights of the pieces in their mean: 1, and more by each sign that is + and by the axis.
struct EdgeWeights {
  double by_sigma = 0.0, by_tau = 0.0, by_axis = 0.0;
};

// `axes`: X's axes as columns in Y's frame; `inverse`: their reciprocals; `centre`: X's centre there.
template <class T>
BC_INLINE EdgePieces<T> cut_edges(const Mat<T>& axes, const Mat<T>& inverse, const Vec<T>& centre,
                                  const Vec<T>& half_x, const Vec<T>& half_y,
                                  const EdgeWeights& weights) {
  EdgePieces<T> pieces;
  Four<T> lengths[steps<T>]{}, means[3][steps<T>]{};
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    int a = (j + 1) % 3, b = (j + 2) % 3;
    Vec<T> along = column(inverse, j), slab;
    for (int k = 0; k < 3; ++k) slab[k] = half_y[k] * abs(along[k]);
#pragma GCC unroll 4
    for (int n = 0; n < steps<T>; ++n) {
      Four<T> at_a = sigma<T>(n) * half_x[a], at_b = tau<T>(n) * half_x[b];
      Four<T> back = Four<T>{} + half_x[j], t = back;  // back: −s
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) {
        Four<T> x = (centre[k] + (at_a * axes[k][a] + at_b * axes[k][b])) * along[k];
        back = min(back, slab[k] + x);
        t = min(t, slab[k] - x);
      }
      Four<T> s = -back;
      pieces.s[j][n] = s;
      pieces.t[j][n] = t;
      // σ and τ as 0 or 1 in the weight.
      auto weight = 1.0 + weights.by_axis * j + 0.5 * weights.by_sigma * (1.0 + sigma<T>(n)) +
                    0.5 * weights.by_tau * (1.0 + tau<T>(n));
      Four<T> length = max(t - s, Four<T>{}) * weight;
      lengths[n] += length;
      means[j][n] += length * (0.5 * (s + t));
      means[a][n] += length * at_a;
      means[b][n] += length * at_b;
    }
  }
  pieces.length = sum_of<T>(lengths);
  for (int k = 0; k < 3; ++k) pieces.mean[k] = sum_of<T>(means[k]);
  return pieces;
}

}  // namespace box_contact::BOX_CONTACT_SET
