// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The moments of the overlap A∩B that a model finds: volume, centroid, covariance.
#pragma once

#include "../lanes/triples.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A symmetric 3 × 3 matrix: xx, yy, zz, yz, xz, xy.
template <class T>
struct Sym {
  T s[6];

  BC_INLINE T& operator()(int i, int j) { return s[i == j ? i : 6 - i - j]; }
  BC_INLINE const T& operator()(int i, int j) const { return s[i == j ? i : 6 - i - j]; }
};

template <class T>
BC_INLINE Sym<T> operator+(const Sym<T>& a, const Sym<T>& b) {
  Sym<T> sum;
  for (int k = 0; k < 6; ++k) sum.s[k] = a.s[k] + b.s[k];
  return sum;
}
template <class T>
BC_INLINE Sym<T> operator-(const Sym<T>& a, const Sym<T>& b) {
  Sym<T> sum;
  for (int k = 0; k < 6; ++k) sum.s[k] = a.s[k] - b.s[k];
  return sum;
}
template <class T>
BC_INLINE Sym<T> operator*(T factor, const Sym<T>& a) {
  Sym<T> scaled;
  for (int k = 0; k < 6; ++k) scaled.s[k] = factor * a.s[k];
  return scaled;
}
template <class T>
BC_INLINE T trace(const Sym<T>& a) {
  return (a.s[0] + a.s[1]) + a.s[2];
}
// a · aᵀ.
template <class T>
BC_INLINE Sym<T> squared(const Vec<T>& a) {
  return {{a[0] * a[0], a[1] * a[1], a[2] * a[2], a[1] * a[2], a[0] * a[2], a[0] * a[1]}};
}
// R · S · Rᵀ: a tensor of one frame in another, where R's columns are the axes of the first.
template <class T>
BC_INLINE Sym<T> rotated(const Mat<T>& r, const Sym<T>& s) {
  Columns<T> rows, axes = columns(r);
  for (int i = 0; i < 3; ++i) rows[i] = triple(Vec<T>{s(i, 0), s(i, 1), s(i, 2)});
  Sym<T> found;
  for (int i = 0; i < 3; ++i) {
    Triple<T> turned = axes * (rows * triple(row(r, i)));
    for (int j = i; j < 3; ++j) found(i, j) = turned[j];
  }
  return found;
}
template <class T>
BC_INLINE Sym<T> select(Mask<T> mask, const Sym<T>& a, const Sym<T>& b) {
  Sym<T> found;
  for (int k = 0; k < 6; ++k) found.s[k] = select<T>(mask, a.s[k], b.s[k]);
  return found;
}
template <class T>
BC_INLINE Mat<T> matrix(const Sym<T>& s) {
  return {{{s(0, 0), s(0, 1), s(0, 2)}, {s(1, 0), s(1, 1), s(1, 2)}, {s(2, 0), s(2, 1), s(2, 2)}}};
}
template <class T, class N>
BC_INLINE void set_lane(Sym<T>& a, int i, const Sym<N>& value) {
  for (int k = 0; k < 6; ++k) set_lane(a.s[k], i, value.s[k]);
}

// What a model finds of the overlap without its second moments.
template <class T>
struct PointAndVolume {
  T volume;         // [m³]
  Vec<T> centroid;  // in A's frame from a kernel, in the common frame from a model [m]
};

// What a model finds of the overlap.
template <class T>
struct Moments {
  T volume;           // [m³]
  Vec<T> centroid;    // in A's frame from a kernel, in the common frame from a model [m]
  Sym<T> covariance;  // second central moments by the volume, common frame [m²]
};

template <class T, class N>
BC_INLINE void set_lane(PointAndVolume<T>& found, int i, const Moments<N>& value) {
  set_lane(found.volume, i, value.volume);
  set_lane(found.centroid, i, value.centroid);
}
template <class T, class N>
BC_INLINE void set_lane(Moments<T>& moments, int i, const Moments<N>& value) {
  set_lane(moments.volume, i, value.volume);
  set_lane(moments.centroid, i, value.centroid);
  set_lane(moments.covariance, i, value.covariance);
}

}  // namespace box_contact::BOX_CONTACT_SET
