// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A certificate that the moments of an overlap, as sums over planes, are right.
//
// Rounding may decide twice, and differently, which plane a line meets first. Then a piece is lost, or
// counts twice. Over the surface of the overlap, ∫ n dA is zero and ∫ x nᵀ dA is the volume times the
// identity. These twelve equations hold to a share of the accuracy that is asked for. What does not
// pass is clipped (clipping.hpp).
#pragma once

#include "sums.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The centroid is accepted with an error of size · max(1e-9, 1e-14 · size / depth).
constexpr double least_centroid_error = 1e-9, centroid_rounding = 1e-14;
// And of the covariance: max(1e-8, 1e-14 · size / depth) of its trace.
constexpr double least_covariance_error = 1e-8;

namespace planes {

// Sums about a point far outside the overlap cancel: most magnitude of their parts [of the sum].
constexpr double most_cancelled = 4.0;
// Sums of squares do so about a nearer point: its squared distance from the centroid [of the trace].
constexpr double most_way2 = 0.25;

// Rounding shifts a line of two planes by 2⁻⁵³ · size / sine of their angle, or moves the end of a piece
// of it by as much. An area changes by a length L times that, and the volume by the distance of the
// plane times the change. Areas may change by opposite amounts, which no equation shows. So what the
// line with the largest lever may change is compared with the accuracy: 0.5 of it is allowed. Where
// the error exceeded the accuracy this lever's change was at least 7 times the accuracy, and 0.7 of it
// where the error exceeded 0.3.
constexpr double rounding_of_size = 0x1p-53, lever_share = 0.5;

// Shares of the accuracy that the twelve equations may be off by. An origin of the sums that is far from
// the centroid makes the covariance more wrong than the diagonal: the square of the distance, divided by
// the trace. So does a piece that is lost at the tip of a pyramid: the square of its distance from the
// centroid is (3/4)² / (3/80) = 15 times the variance.
constexpr double off_diagonal_share = 0.01, diagonal_share = 0.3, closure_share = 0.1;
constexpr double covariance_diagonal_share = 1.0 / 16.0;

// Whether sums over planes are right.
template <class T>
struct Certificate {
  Mask<T> holds;      // they are
  Mask<T> cancelled;  // no piece is lost: sums about a nearer point may be right
};

// The twelve equations, that no line has too long a lever, and that the sum of parts of the magnitude
// `gross` has not cancelled. `x_n`, `normal`, `size` and `gross` as in Surface, over both boxes; `lever`:
// of the lines, times the length of the edges' pieces; `trace`: of the covariance; `way2`: squared
// distance of the centroid from the origin.
template <bool squares, class T>
BC_INLINE Certificate<T> certificate(const Columns<T>& x_n, const Triple<T>& normal,
                                     const Triple<T>& size, T lever, T volume, T gross, T trace,
                                     T way2, T pair_size, T depth) {
  T rounding = centroid_rounding * pair_size / depth;
  T error = pair_size * max(splat<T>(least_centroid_error), rounding);
  T covariance_error = max(splat<T>(least_covariance_error), rounding);
  T off_diagonal = (0.5 * off_diagonal_share) * error;
  T diagonal = diagonal_share * error, closure = closure_share * error;
  if constexpr (squares) {
    off_diagonal = min(off_diagonal, (0.5 * off_diagonal_share) * covariance_error * sqrt(trace));
    T share = covariance_diagonal_share * (trace / (trace + way2));
    diagonal = min(diagonal, (share * covariance_error) * pair_size);
  }
  Columns<T> entries = diagonals(x_n);
  Triple<T> own = abs(entries[0] + (-volume)) * uniform(pair_size);
  Triple<T> beside = max(abs(entries[1]), abs(entries[2]));
  Mask<T> closes = all_of(closure * size >= abs(normal) * uniform(pair_size));
  Mask<T> has_digits = gross <= (6.0 * most_cancelled) * volume;
  Mask<T> holds = closes & has_digits & (volume > 0.0);
  holds &= rounding_of_size * pair_size * lever <= lever_share * error * volume;
  holds &= all_of((uniform(T(diagonal * volume)) >= own) & (off_diagonal * size >= beside));
  Mask<T> cancelled = closes & ((has_digits == 0) | (way2 > most_way2 * trace));
  return {holds, cancelled};
}

}  // namespace planes

}  // namespace box_contact::BOX_CONTACT_SET
