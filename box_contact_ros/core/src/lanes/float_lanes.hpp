// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Lanes of float32 for a group of pairs in float64: twice as many, and as wide in bytes.
#pragma once

#include "triples.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A single pair stays a single number.
template <class T>
using Narrow =
    typename std::conditional_t<is_scalar<T>, NumberOf<float>, LanesOf<float, 2 * width<T>>>::type;

// Pairs of T that fill the lanes of Narrow<T>.
template <class T>
constexpr int narrow_group = is_scalar<T> ? 1 : 2;

// The numbers of a group of blocks, as float32.
template <class T>
BC_INLINE Narrow<T> narrow(const T (&group)[narrow_group<T>]) {
  if constexpr (is_scalar<T>) {
    return float(group[0]);
  } else {
    using Half = Lanes<float, width<T>>;
    Half halves[2] = {__builtin_convertvector(group[0], Half),
                      __builtin_convertvector(group[1], Half)};
    Narrow<T> joined;
    std::memcpy(&joined, halves, sizeof joined);
    return joined;
  }
}
// Block g of the group, as float64.
template <class T>
BC_INLINE T widen(const Narrow<T>& x, int g) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    using Half = Lanes<float, width<T>>;
    Half halves[2];
    std::memcpy(halves, &x, sizeof x);
    return __builtin_convertvector(halves[g], T);
  }
}

// The same for triples.
template <class T>
BC_INLINE Triple<Narrow<T>> narrow_triple(const Triple<T> (&group)[narrow_group<T>]) {
  if constexpr (packed<T>) {
    return __builtin_convertvector(group[0], Triple<float>);
  } else {
    Vec<Narrow<T>> narrowed;
    for (int k = 0; k < 3; ++k) {
      T parts[narrow_group<T>];
      for (int g = 0; g < narrow_group<T>; ++g) parts[g] = group[g][k];
      narrowed[k] = narrow<T>(parts);
    }
    return triple(narrowed);
  }
}
template <class T>
BC_INLINE Triple<T> widen_triple(const Triple<Narrow<T>>& x, int g) {
  if constexpr (packed<T>) {
    return __builtin_convertvector(x, Triple<T>);
  } else {
    return {widen<T>(x[0], g), widen<T>(x[1], g), widen<T>(x[2], g)};
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
