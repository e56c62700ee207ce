// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Vectors and matrices of lanes.
#pragma once

#include "lanes.hpp"

namespace box_contact::BOX_CONTACT_SET {

template <class T>
struct Vec {
  T v[3];

  BC_INLINE T& operator[](int k) { return v[k]; }
  BC_INLINE const T& operator[](int k) const { return v[k]; }
};

template <class T>
BC_INLINE Vec<T> operator+(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
template <class T>
BC_INLINE Vec<T> operator-(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class T>
BC_INLINE Vec<T> operator-(const Vec<T>& a) {
  return {-a[0], -a[1], -a[2]};
}
template <class T>
BC_INLINE Vec<T> operator*(T factor, const Vec<T>& a) {
  return {factor * a[0], factor * a[1], factor * a[2]};
}
template <class T, class = std::enable_if_t<!is_scalar<T>>>
BC_INLINE Vec<T> operator*(Number<T> factor, const Vec<T>& a) {
  return splat<T>(factor) * a;
}
// By components, and with the same number for each.
template <class T>
BC_INLINE Vec<T> operator*(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] * b[0], a[1] * b[1], a[2] * b[2]};
}
template <class T>
BC_INLINE Vec<T> operator/(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] / b[0], a[1] / b[1], a[2] / b[2]};
}
template <class T>
BC_INLINE Vec<T> operator+(const Vec<T>& a, T b) {
  return {a[0] + b, a[1] + b, a[2] + b};
}
template <class T>
BC_INLINE void operator+=(Vec<T>& a, const Vec<T>& b) {
  a = a + b;
}
// Comparisons by components: masks.
template <class T>
BC_INLINE Vec<Mask<T>> operator==(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] == b[0], a[1] == b[1], a[2] == b[2]};
}
template <class T>
BC_INLINE Vec<Mask<T>> operator>(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] > b[0], a[1] > b[1], a[2] > b[2]};
}
template <class T>
BC_INLINE Vec<Mask<T>> operator>=(const Vec<T>& a, const Vec<T>& b) {
  return {a[0] >= b[0], a[1] >= b[1], a[2] >= b[2]};
}
template <class M>
BC_INLINE Vec<M> operator&(const Vec<M>& a, const Vec<M>& b) {
  return {M(a[0] & b[0]), M(a[1] & b[1]), M(a[2] & b[2])};
}
template <class M>
BC_INLINE Vec<M> operator|(const Vec<M>& a, const Vec<M>& b) {
  return {M(a[0] | b[0]), M(a[1] | b[1]), M(a[2] | b[2])};
}
template <class T>
BC_INLINE Vec<T> abs(const Vec<T>& a) {
  return {abs(a[0]), abs(a[1]), abs(a[2])};
}
template <class T>
BC_INLINE Vec<T> min(const Vec<T>& a, const Vec<T>& b) {
  return {min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])};
}
template <class T>
BC_INLINE Vec<T> max(const Vec<T>& a, const Vec<T>& b) {
  return {max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])};
}

// The sum of three components, the sum of the products of two times three, and the largest component.
template <class Three>
BC_INLINE auto sum(const Three& a) {
  return (a[0] + a[1]) + a[2];
}
template <class Three>
BC_INLINE auto dot(const Three& a, const Three& b) {
  return sum(Three(a * b));
}
template <class Three>
BC_INLINE auto largest(const Three& a) {
  return max(max(a[0], a[1]), a[2]);
}
template <class T>
BC_INLINE Vec<T> cross(const Vec<T>& a, const Vec<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class T>
BC_INLINE T length(const Vec<T>& a) {
  return sqrt(dot(a, a));
}

// A 3 × 3 matrix, row by row: m[i][j].
template <class T>
struct Mat {
  T m[3][3];

  BC_INLINE T* operator[](int i) { return m[i]; }
  BC_INLINE const T* operator[](int i) const { return m[i]; }
};

template <class T>
BC_INLINE Vec<T> row(const Mat<T>& m, int i) {
  return {m[i][0], m[i][1], m[i][2]};
}
template <class T>
BC_INLINE Vec<T> column(const Mat<T>& m, int j) {
  return {m[0][j], m[1][j], m[2][j]};
}
template <class T>
BC_INLINE Vec<T> operator*(const Mat<T>& m, const Vec<T>& a) {
  return {dot(row(m, 0), a), dot(row(m, 1), a), dot(row(m, 2), a)};
}
// mᵀ · a.
template <class T>
BC_INLINE Vec<T> transposed_times(const Mat<T>& m, const Vec<T>& a) {
  return {dot(column(m, 0), a), dot(column(m, 1), a), dot(column(m, 2), a)};
}

}  // namespace box_contact::BOX_CONTACT_SET
