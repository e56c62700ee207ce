// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Eight numbers that one formula treats alike: eight chords, or eight units of a network. W pairs have
// them as an array of lanes, a single pair as one vector. Either way each number takes the same
// operations in the same order.
#pragma once

#include "../lanes/lanes.hpp"

namespace box_contact::BOX_CONTACT_SET {

template <class F>
struct EightLanes {
  F v[8];
};
template <class F>
using Eight = std::conditional_t<is_scalar<F>, Lanes<float, 8>, EightLanes<F>>;

template <class F, class Formula, class... More>
BC_INLINE EightLanes<F> by_eight(Formula formula, const More&... more) {
  EightLanes<F> found;
  for (int i = 0; i < 8; ++i) found.v[i] = formula(more.v[i]...);
  return found;
}
template <class F>
BC_INLINE EightLanes<F> operator+(const EightLanes<F>& a, const EightLanes<F>& b) {
  return by_eight<F>([](F x, F y) { return x + y; }, a, b);
}
template <class F>
BC_INLINE EightLanes<F> operator-(const EightLanes<F>& a, const EightLanes<F>& b) {
  return by_eight<F>([](F x, F y) { return x - y; }, a, b);
}
template <class F>
BC_INLINE EightLanes<F> operator*(const EightLanes<F>& a, const EightLanes<F>& b) {
  return by_eight<F>([](F x, F y) { return x * y; }, a, b);
}
template <class F>
BC_INLINE EightLanes<F> min(const EightLanes<F>& a, const EightLanes<F>& b) {
  return by_eight<F>([](F x, F y) { return min<F>(x, y); }, a, b);
}
template <class F>
BC_INLINE EightLanes<F> max(const EightLanes<F>& a, const EightLanes<F>& b) {
  return by_eight<F>([](F x, F y) { return max<F>(x, y); }, a, b);
}

// The same number eight times, of each pair; and eight numbers, the same for all pairs.
template <class F>
BC_INLINE Eight<F> eight(F x) {
  if constexpr (is_scalar<F>) {
    return splat<Lanes<float, 8>>(x);
  } else {
    return {{x, x, x, x, x, x, x, x}};
  }
}
template <class F>
BC_INLINE Eight<F> eight(const float* x) {
  if constexpr (is_scalar<F>) {
    Lanes<float, 8> found;
    std::memcpy(&found, x, sizeof found);
    return found;
  } else {
    EightLanes<F> found;
    for (int i = 0; i < 8; ++i) found.v[i] = splat<F>(x[i]);
    return found;
  }
}
template <class F>
BC_INLINE F number(const Eight<F>& x, int i) {
  if constexpr (is_scalar<F>) {
    return x[i];
  } else {
    return x.v[i];
  }
}

// Their sum.
template <class F>
BC_INLINE F total(const Eight<F>& x) {
  F four[4];
  for (int i = 0; i < 4; ++i) four[i] = number<F>(x, i) + number<F>(x, i + 4);
  return (four[0] + four[2]) + (four[1] + four[3]);
}

}  // namespace box_contact::BOX_CONTACT_SET
