// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Poses: what two boxes become before any axis is tested.
//
// Conventions: SI units, right-handed frames. A pose is `x y z qx qy qz qw` in a frame common to
// both boxes. A size is three full extents [m]; the core works with half extents.
//
// What can cancel does so once, in float64. The offset is B − A before anything else. The
// products of the boxes' axes are R[i][j] = a_i · b_j.
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

// A pair of boxes, ready for the separating-axis test. The boxes are put in an order of the data
// here, and the answer names them as the caller does. Swapping them changes no bit in between. From
// here on A is the first of both.
template <class T>
struct Pair {
  Triple<T> half_a, half_b;      // half extents [m]
  Triple<T> origin_a, origin_b;  // the boxes' centres, common frame [m]
  Columns<T> axes_a, axes_b;     // the boxes' axes, common frame
  Triple<T> offset_a, offset_b;  // B − A in A's frame, and in B's [m]
  Columns<T> b_in_a, a_in_b;     // R and Rᵀ: B's axes in A's frame, A's axes in B's frame
  T size;                        // largest full extent of both boxes [m]
  T touch;                       // separation up to which the boxes touch [m]
  Mask<T> swapped;               // the caller's A is the second box
  Mask<T> valid;                 // poses and sizes are accepted
};

template <class T>
BC_INLINE T squared_norm(const T (&q)[4]) {
  return (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]);
}
// The matrix of a quaternion of any length. Dividing by the squared norm needs no square root, and q
// and −q give the same bits.
template <class T>
BC_INLINE Mat<T> rotation_matrix(const T (&q)[4]) {
  T norm2 = squared_norm(q);
  T x = q[0], y = q[1], z = q[2], w = q[3], s = 2.0 / norm2;
  return {{{1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
           {s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)},
           {s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)}}};
}
// Its rows.
template <class T>
BC_INLINE Columns<T> rotation_rows(const T (&q)[4], T norm2) {
  if constexpr (packed<T>) {
    T x = q[0], y = q[1], z = q[2], w = q[3], s = 2.0 / norm2;
    Triple<T> v{x, y, z, w}, yxw = __builtin_shufflevector(v, v, 1, 0, 3, 3);
    Triple<T> zwx = __builtin_shufflevector(v, v, 2, 3, 0, 0);
    Triple<T> wzy = __builtin_shufflevector(v, v, 3, 2, 1, 1);
    Triple<T> x0{-1.0, 1.0, 1.0, 1.0}, x1{1.0, -1.0, 1.0, 1.0}, x2{1.0, 1.0, -1.0, -1.0};
    Columns<T> rows{{s * (y * (x0 * yxw) + z * ((x0 * x1) * zwx)),
                     s * (x * ((x1 * x2) * yxw) + z * (x1 * wzy)),
                     s * (x * (x2 * zwx) + y * ((x0 * x2) * wzy))}};
    for (int i = 0; i < 3; ++i) rows[i] = choose(is_at<T>(i), 1.0 + rows[i], rows[i]);
    return rows;
  } else {
    Mat<T> m = rotation_matrix(q);
    return {{triple(row(m, 0)), triple(row(m, 1)), triple(row(m, 2))}};
  }
}

// Bring a pose from the frame of a body to the common frame. The pose of the frame itself has the
// bits of the body's: a sum with zero would lose the sign of another zero.
inline Pose<double> pose_in_common_frame(const Pose<double>& body, const Pose<double>& local) {
  const double(&p)[4] = body.quaternion, (&q)[4] = local.quaternion;
  bool is_frame = q[3] == 1.0;
  for (int k = 0; k < 3; ++k) is_frame &= local.position[k] == 0.0 && q[k] == 0.0;
  if (is_frame) return body;
  return {body.position + rotation_matrix(p) * local.position,
          {(p[3] * q[0] + p[0] * q[3]) + (p[1] * q[2] - p[2] * q[1]),
           (p[3] * q[1] + p[1] * q[3]) + (p[2] * q[0] - p[0] * q[2]),
           (p[3] * q[2] + p[2] * q[3]) + (p[0] * q[1] - p[1] * q[0]),
           (p[3] * q[3] - p[0] * q[0]) - (p[1] * q[1] + p[2] * q[2])}};
}

// Comparisons are written so that NaN fails them. An overflown square is infinite and fails too.
template <class T>
BC_INLINE Mask<T> pose_valid(const Triple<T>& position, T norm2) {
  return all_of(uniform(splat<T>(length_max)) >= abs(position)) &
         (norm2 >= quaternion_min * quaternion_min) & (norm2 <= quaternion_max * quaternion_max);
}
template <class T>
BC_INLINE Mask<T> size_valid(const Triple<T>& size) {
  return all_of((size >= uniform(splat<T>(length_min))) & (uniform(splat<T>(length_max)) >= size));
}

// Distance from a positive number to the next larger one: 0.75 · 2⁻⁵² · x lies between 0.75 and
// 1.5 ulp, so the sum is rounded to the next number.
template <class T>
BC_INLINE T ulp(T x) {
  return (x + x * (0.75 * 0x1p-52)) - x;
}

// Order two boxes with the same centre: by their sizes, then by their axes.
template <class T>
Mask<T> a_first_of_concentric(const Triple<T>& size_a, const Triple<T>& size_b,
                              const Columns<T>& rows_a, const Columns<T>& rows_b) {
  T order = size_b[0] - size_a[0];
  for (int k = 1; k < 3; ++k) order = select<T>(order == 0.0, size_b[k] - size_a[k], order);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) order = select<T>(order == 0.0, rows_b[i][j] - rows_a[i][j], order);
  return order >= 0.0;
}

// Whether A comes first. The sign of B − A changes on a swap: its first component that is not zero
// orders the boxes.
template <class T>
BC_INLINE Mask<T> comes_first(const Triple<T>& t) {
  if constexpr (packed<T>) {
    unsigned below = bits(t < Triple<T>{}) & 7, off = below | (bits(t > Triple<T>{}) & 7);
    return (off & -off & below) == 0;
  } else {
    return (t[0] > 0.0) | ((t[0] == 0.0) & ((t[1] > 0.0) | ((t[1] == 0.0) & (t[2] >= 0.0))));
  }
}

// Sizes: full extents [m].
template <class T>
BC_INLINE void prepare(const Pose<T>& a, const Pose<T>& b, const Vec<T>& size_a,
                       const Vec<T>& size_b, Pair<T>& pair) {
  T norm2_a = squared_norm(a.quaternion), norm2_b = squared_norm(b.quaternion);
  Columns<T> rows_a = rotation_rows(a.quaternion, norm2_a);
  Columns<T> rows_b = rotation_rows(b.quaternion, norm2_b);
  Triple<T> at_a = triple(a.position), at_b = triple(b.position), t = at_b - at_a;
  Triple<T> given_a = triple(size_a), given_b = triple(size_b);
  Mask<T> valid = pose_valid(at_a, norm2_a) & pose_valid(at_b, norm2_b) & size_valid<T>(given_a) &
                  size_valid<T>(given_b);
  Mask<T> in_order = comes_first<T>(t), concentric = all_of(t == Triple<T>{});
  if (any(concentric)) {
    Mask<T> ordered = a_first_of_concentric<T>(given_a, given_b, rows_a, rows_b);
    in_order = (in_order & (concentric == 0)) | (ordered & concentric);
  }
  pair.swapped = in_order == 0;
  pair.half_a = 0.5 * select(in_order, given_a, given_b);
  pair.half_b = 0.5 * select(in_order, given_b, given_a);
  pair.origin_a = select(in_order, at_a, at_b);
  pair.origin_b = select(in_order, at_b, at_a);
  Columns<T> first = select<T>(in_order, rows_a, rows_b);
  Columns<T> other = select<T>(in_order, rows_b, rows_a);
  t = pair.origin_b - pair.origin_a;
  pair.offset_a = first * t;
  pair.offset_b = other * t;
  for (int i = 0; i < 3; ++i)
    pair.a_in_b[i] = (repeated(first[0], i) * other[0] + repeated(first[1], i) * other[1]) +
                     repeated(first[2], i) * other[2];
  pair.b_in_a = transpose(pair.a_in_b);
  pair.axes_a = transpose(first);
  pair.axes_b = transpose(other);
  // A size below zero is refused, but tolerances are made of it before: no axis would be the best.
  pair.size = abs(largest(max(given_a, given_b)));
  T reach = largest(max(abs(at_a), abs(at_b)));
  pair.touch = contact_ulps * ulp(max(reach, pair.size));
  pair.valid = valid;
}

// Bring a point from A's frame to the common frame [m].
template <class T>
BC_INLINE Triple<T> point_in_common_frame(const Pair<T>& pair, const Triple<T>& point) {
  return pair.origin_a + pair.axes_a * point;
}

template <class T>
BC_INLINE Pair<double> lane(const Pair<T>& pair, int i) {
  Pair<double> one;
  one.half_a = triple_of_lane<T>(pair.half_a, i);
  one.half_b = triple_of_lane<T>(pair.half_b, i);
  one.origin_a = triple_of_lane<T>(pair.origin_a, i);
  one.origin_b = triple_of_lane<T>(pair.origin_b, i);
  one.offset_a = triple_of_lane<T>(pair.offset_a, i);
  one.offset_b = triple_of_lane<T>(pair.offset_b, i);
  for (int k = 0; k < 3; ++k) {
    one.axes_a[k] = triple_of_lane<T>(pair.axes_a[k], i);
    one.axes_b[k] = triple_of_lane<T>(pair.axes_b[k], i);
    one.b_in_a[k] = triple_of_lane<T>(pair.b_in_a[k], i);
    one.a_in_b[k] = triple_of_lane<T>(pair.a_in_b[k], i);
  }
  one.size = lane(pair.size, i);
  one.touch = lane(pair.touch, i);
  one.swapped = lane(pair.swapped, i) != 0;
  one.valid = lane(pair.valid, i) != 0;
  return one;
}

}  // namespace box_contact::BOX_CONTACT_SET
