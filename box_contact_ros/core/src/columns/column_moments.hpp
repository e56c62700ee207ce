// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The columns L between Q's three lower faces and the reference face: volume, centroid, covariance.
//
// L contains A∩B. Q's upper faces cut off U_0, U_1, U_2 (upper_faces.hpp), so that
// A∩B = L − U_0 − U_1 − U_2. L is convex: it is what a convex function, the lower faces over their
// convex projection, leaves of P.
//
// Coordinates are those of Q: t_k = a_k + q_kz h for a point at the height h above the lower face's
// point Σ a_k q_k. So a sliver along an edge of Q keeps its small eigenvalues in float32.
#pragma once

#include "../overlap/moments.hpp"
#include "contact_frame.hpp"
#include "lower_face.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A contact frame in float32. Lengths are in `unit`, heights in the origin's depth.
template <class F>
struct ColumnFrame {
  Triple<F> qx, qy, qz, length;  // by k
  Triple<F> jacobian;            // by j: true q_jz of the lower faces that take part, else 0
  Triple<F> lift;                // by k: what one unit of height adds to t_k
  F low_x, high_x, low_y, high_y;
  F height, rise;  // the origin's depth in `unit`, and its reciprocal
};

// Moments about the origin o, for coordinates t_k in `unit`; the volume in unit² · depth.
template <class F>
struct ColumnMoments {
  F volume, gross;
  Triple<F> mean;      // of t_k
  Triple<F> variance;  // of t_k
  Triple<F> beside;    // by j: covariance of the two t_k that follow t_j
};

namespace column_sums {

constexpr float least_component = 1e-18F;

template <class Three>
BC_INLINE Three reciprocals(const Three& x) {
  return each(
      [](auto x) {
        using N = decltype(x);
        return 1.0F / select<N>(abs(x) > least_component, x, splat<N>(least_component));
      },
      x);
}

// The moments over all lower faces: face j of a single pair is lane j of a triple.
template <class F>
BC_INLINE FaceMoments<Triple<F>> of_faces(const ColumnFrame<F>& frame) {
  Triple<F> by_x = reciprocals(frame.qx), by_y = reciprocals(frame.qy),
            by_z = reciprocals(frame.qz);
  // Points that count are at most 1 high. Without this, noise on an upright face could be far above.
  Triple<F> length = min(frame.length, 2.0F * by_z);
  auto moments = [&](auto at) {
    auto next = [&](const Triple<F>& v) { return at(rotated(v)); };
    auto last = [&](const Triple<F>& v) { return at(rotated_back(v)); };
    auto all = [&](F x) { return at(uniform(x)); };
    using G = decltype(all(F{}));
    return moments_over(LowerFace<G>{{next(frame.qx), last(frame.qx), next(by_x), last(by_x),
                                      all(frame.low_x), all(frame.high_x)},
                                     {next(frame.qy), last(frame.qy), next(by_y), last(by_y),
                                      all(frame.low_y), all(frame.high_y)},
                                     next(frame.qz),
                                     last(frame.qz),
                                     next(by_z),
                                     last(by_z),
                                     at(frame.height * by_x),
                                     at(frame.height * by_y),
                                     at(frame.rise * by_z),
                                     next(length),
                                     last(length)});
  };
  if constexpr (packed<F>) {
    return moments([](const Triple<F>& v) { return v; });
  } else {
    FaceMoments<Vec<F>> found;
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j) {
      FaceMoments<F> one = moments([&](const Vec<F>& v) { return v[j]; });
      found.volume[j] = one.volume, found.gross[j] = one.gross;
      found.a[j] = one.a, found.b[j] = one.b, found.h[j] = one.h;
      found.aa[j] = one.aa, found.bb[j] = one.bb, found.ab[j] = one.ab;
      found.ah[j] = one.ah, found.bh[j] = one.bh, found.hh[j] = one.hh;
    }
    return found;
  }
}

}  // namespace column_sums

template <class F>
BC_INLINE ColumnMoments<F> column_moments(const ColumnFrame<F>& frame) {
  using Three = Triple<F>;
  FaceMoments<Three> faces = column_sums::of_faces(frame);
  const Three& weight = frame.jacobian;
  // Face j has a = t_k and b = t_l for k and l that follow j.
  auto by_coordinate = [&](const Three& of_a, const Three& of_b) {
    return rotated_back(weight * of_a) + rotated(weight * of_b);
  };
  ColumnMoments<F> found;
  found.volume = dot(weight, faces.volume);
  found.gross = dot(weight, faces.gross);
  F by_volume = 1.0F / found.volume;
  F mean_h = by_volume * dot(weight, faces.h);
  F variance_h = by_volume * dot(weight, faces.hh) - mean_h * mean_h;
  Three mean_a = by_volume * by_coordinate(faces.a, faces.b);
  Three with_h = by_volume * by_coordinate(faces.ah, faces.bh) - mean_h * mean_a;
  found.mean = mean_a + mean_h * frame.lift;
  auto covariance = [&](const Three& raw, auto k, auto l) {
    Three lift_k = k(frame.lift), lift_l = l(frame.lift);
    return (by_volume * raw - k(mean_a) * l(mean_a)) +
           ((lift_k * l(with_h) + lift_l * k(with_h)) + variance_h * (lift_k * lift_l));
  };
  auto own = [](const Three& v) { return v; };
  auto next = [](const Three& v) { return rotated(v); };
  auto last = [](const Three& v) { return rotated_back(v); };
  found.variance = covariance(by_coordinate(faces.aa, faces.bb), own, own);
  found.beside = covariance(weight * faces.ab, next, last);
  return found;
}

}  // namespace box_contact::BOX_CONTACT_SET
