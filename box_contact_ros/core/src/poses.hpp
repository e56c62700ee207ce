// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Poses: what two boxes become before any axis is tested.
//
// Conventions: SI units, right-handed frames. A pose is `x y z qx qy qz qw` in a frame common to
// both boxes. A size is three full extents [m]; the core works with half extents.
//
// What can cancel does so once, in float64. The offset is B − A before anything else. The
// products of the boxes' axes are R[i][j] = a_i · b_j. When A and B are swapped, R becomes its
// transpose and the offsets change sign, bit for bit. The verdict relies on that.
#pragma once

#include "lanes/triples.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Boxes touch up to a separation of 8 ulp of the pair's largest coordinate or size. Exactly
// touching poses that were moved rigidly are off by at most 4 ulp; a gap of 1e-14 m between two
// 40 ft containers is still a gap.
constexpr double contact_ulps = 8.0;

// Volumes' second moments take lengths to the fifth power, which must not leave float64's range.
constexpr double length_min = 1e-50;  // least extent accepted [m]
constexpr double length_max = 1e50;   // largest extent or coordinate accepted [m]
// The squares of quaternion norms must neither underflow nor overflow.
constexpr double quaternion_min = 1e-100;
constexpr double quaternion_max = 1e100;

template <class T>
struct Pose {
  Vec<T> position;  // [m], common frame
  T quaternion[4];  // x y z w, of any length but zero
};

// A pair of boxes, ready for the separating-axis test.
template <class T>
struct Pair {
  Vec<T> half_a, half_b;      // half extents [m]
  Vec<T> origin_a, origin_b;  // the boxes' centres, common frame [m]
  Mat<T> axes_a, axes_b;      // the boxes' axes as columns, common frame
  Vec<T> offset_a, offset_b;  // B − A in A's frame, and in B's [m]
  Mat<T> rotation;            // R: B's axes as columns, in A's frame
  T size;                     // largest full extent of both boxes [m]
  T touch;                    // separation up to which the boxes touch [m]
  Mask<T> a_first;            // A comes first in an order that swapping A and B reverses
  Mask<T> valid;              // poses and sizes are accepted
};

// The matrix of a quaternion of any length. Dividing by the squared norm needs no square root, and
// q and −q give the same bits.
template <class T>
BC_INLINE Mat<T> rotation_matrix(const T q[4]) {
  T x = q[0], y = q[1], z = q[2], w = q[3];
  T s = 2.0 / ((x * x + y * y) + (z * z + w * w));
  return {{{1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
           {s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)},
           {s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)}}};
}

// Comparisons are written so that NaN fails them. An overflown square is infinite and fails too.
template <class T>
BC_INLINE Mask<T> pose_valid(const Pose<T>& pose) {
  const T* q = pose.quaternion;
  T norm2 = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]);
  Vec<T> reach = abs(pose.position);
  return (reach[0] <= length_max) & (reach[1] <= length_max) & (reach[2] <= length_max) &
         (norm2 >= quaternion_min * quaternion_min) & (norm2 <= quaternion_max * quaternion_max);
}
template <class T>
BC_INLINE Mask<T> size_valid(const Vec<T>& half) {
  return (2.0 * half[0] >= length_min) & (2.0 * half[1] >= length_min) &
         (2.0 * half[2] >= length_min) & (2.0 * half[0] <= length_max) &
         (2.0 * half[1] <= length_max) & (2.0 * half[2] <= length_max);
}

// Distance from a positive number to the next larger one: 0.75 · 2⁻⁵² · x lies between 0.75 and
// 1.5 ulp, so the sum is rounded to the next number.
template <class T>
BC_INLINE T ulp(T x) {
  return (x + x * (0.75 * 0x1p-52)) - x;
}

// Order two boxes with the same centre: by their sizes, then by their axes.
template <class T>
Mask<T> a_first_of_concentric(const Vec<T>& half_a, const Vec<T>& half_b, const Mat<T>& axes_a,
                              const Mat<T>& axes_b) {
  T order = half_b[0] - half_a[0];
  for (int k = 1; k < 3; ++k) order = select<T>(order == 0.0, half_b[k] - half_a[k], order);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) order = select<T>(order == 0.0, axes_b[i][j] - axes_a[i][j], order);
  return order >= 0.0;
}

template <class T>
BC_INLINE void prepare(const Pose<T>& a, const Pose<T>& b, const Vec<T>& half_a,
                       const Vec<T>& half_b, Pair<T>& pair) {
  Mat<T> axes_a = rotation_matrix(a.quaternion), axes_b = rotation_matrix(b.quaternion);
  Vec<T> t = b.position - a.position;
  pair.half_a = half_a;
  pair.half_b = half_b;
  pair.origin_a = a.position;
  pair.origin_b = b.position;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) pair.axes_a[i][j] = axes_a[i][j], pair.axes_b[i][j] = axes_b[i][j];
  pair.offset_a = transposed_times(axes_a, t);
  pair.offset_b = transposed_times(axes_b, t);
  for (int i = 0; i < 3; ++i) {
    Triple<T> by_b =
        (axes_a[0][i] * triple(row(axes_b, 0)) + axes_a[1][i] * triple(row(axes_b, 1))) +
        axes_a[2][i] * triple(row(axes_b, 2));
    for (int j = 0; j < 3; ++j) pair.rotation[i][j] = by_b[j];
  }
  pair.size = 2.0 * max(largest(half_a), largest(half_b));
  T reach = max(largest(abs(a.position)), largest(abs(b.position)));
  pair.touch = contact_ulps * ulp(max(reach, pair.size));
  // The sign of B − A changes on a swap: its first component that is not zero orders the boxes.
  pair.a_first = (t[0] > 0.0) | ((t[0] == 0.0) & ((t[1] > 0.0) | ((t[1] == 0.0) & (t[2] >= 0.0))));
  Mask<T> concentric = (t[0] == 0.0) & (t[1] == 0.0) & (t[2] == 0.0);
  if (any(concentric)) {
    Mask<T> ordered = a_first_of_concentric(half_a, half_b, axes_a, axes_b);
    pair.a_first = (pair.a_first & (concentric == 0)) | (ordered & concentric);
  }
  pair.valid = pose_valid(a) & pose_valid(b) & size_valid(half_a) & size_valid(half_b);
}

// Move B by `distance` [m] against a direction given in A's frame.
template <class T>
BC_INLINE void move_against(Pair<T>& pair, T distance, const Vec<T>& direction) {
  pair.offset_a = pair.offset_a - distance * direction;
  pair.offset_b = pair.offset_b - distance * transposed_times(pair.rotation, direction);
}

// Bring a point [m] or a direction from A's frame to the common frame.
template <class T>
BC_INLINE Vec<T> point_in_common_frame(const Pair<T>& pair, const Vec<T>& point) {
  return pair.origin_a + pair.axes_a * point;
}
template <class T>
BC_INLINE Vec<T> direction_in_common_frame(const Pair<T>& pair, const Vec<T>& direction) {
  return pair.axes_a * direction;
}

template <class T>
BC_INLINE Pair<double> lane(const Pair<T>& pair, int i) {
  Pair<double> one;
  one.half_a = lane(pair.half_a, i);
  one.half_b = lane(pair.half_b, i);
  one.origin_a = lane(pair.origin_a, i);
  one.origin_b = lane(pair.origin_b, i);
  one.axes_a = lane(pair.axes_a, i);
  one.axes_b = lane(pair.axes_b, i);
  one.offset_a = lane(pair.offset_a, i);
  one.offset_b = lane(pair.offset_b, i);
  one.rotation = lane(pair.rotation, i);
  one.size = lane(pair.size, i);
  one.touch = lane(pair.touch, i);
  one.a_first = lane(pair.a_first, i) != 0;
  one.valid = lane(pair.valid, i) != 0;
  return one;
}

}  // namespace box_contact::BOX_CONTACT_SET
