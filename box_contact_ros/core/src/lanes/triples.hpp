// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A triple is three numbers that one formula treats alike: the components of a vector, or one number
// for each pair of opposite faces. W pairs have it as a `Vec`. A single pair has it side by side in
// one vector of the machine, where the machine has one of four such numbers. The fourth lane then
// repeats the third, so it traps or slows down where that one does.
//
// Either way each number takes the same operations in the same order, and has the same bits.
#pragma once

#include "vectors.hpp"

namespace box_contact::BOX_CONTACT_SET {

#if defined(__AVX__)
constexpr int machine_bytes = 32;
#else
constexpr int machine_bytes = 16;
#endif

// Whether triples of T are vectors of the machine.
template <class T>
constexpr bool packed = is_scalar<T> && 4 * sizeof(T) <= machine_bytes;

template <class T, bool = packed<T>>
struct TripleOf {
  using type = Vec<T>;
};
template <class T>
struct TripleOf<T, true> {
  using type = Lanes<T, 4>;
};
template <class T>
using Triple = typename TripleOf<T>::type;

// What comparisons of triples give: a mask for each number.
template <class T>
using Flags = decltype(Triple<T>() > Triple<T>());

// Functions below take a `Vec<T>`, or a vector of the machine, `Packed`.

template <class T>
BC_INLINE Triple<T> triple(const Vec<T>& a) {
  if constexpr (packed<T>) {
    return Triple<T>{a[0], a[1], a[2], a[2]};
  } else {
    return a;
  }
}
// The same number three times.
template <class T>
BC_INLINE Triple<T> uniform(T x) {
  return triple(Vec<T>{x, x, x});
}
template <class T>
BC_INLINE Vec<T> components(const Triple<T>& a) {
  return {a[0], a[1], a[2]};
}
// One pair of several as a triple.
template <class T>
BC_INLINE Triple<Number<T>> triple_of_lane(const Triple<T>& a, int i) {
  if constexpr (is_scalar<T>) {
    return a;
  } else {
    return triple(lane(a, i));
  }
}
// A formula of single numbers, for each number of triples.
template <class Formula, class T, class... More>
BC_INLINE Vec<T> each(Formula formula, const Vec<T>& a, const More&... more) {
  return {formula(a[0], more[0]...), formula(a[1], more[1]...), formula(a[2], more[2]...)};
}
template <class Formula, class Packed, class... More>
BC_INLINE Packed each(Formula formula, Packed a, More... more) {
  return formula(a, more...);
}

// Component k as a factor or a summand of triples.
template <class T>
BC_INLINE T spread(const Vec<T>& a, int k) {
  return a[k];
}
template <class Packed>
BC_INLINE Packed spread(Packed a, int k) {
  return k == 0   ? __builtin_shufflevector(a, a, 0, 0, 0, 0)
         : k == 1 ? __builtin_shufflevector(a, a, 1, 1, 1, 1)
                  : __builtin_shufflevector(a, a, 2, 2, 2, 2);
}

// Component k as a triple.
template <class T>
BC_INLINE Vec<T> repeated(const Vec<T>& a, int k) {
  return {a[k], a[k], a[k]};
}
template <class Packed>
BC_INLINE Packed repeated(Packed a, int k) {
  return spread(a, k);
}

// The sum of the components.
template <class Three>
BC_INLINE auto sum(const Three& a) {
  return (a[0] + a[1]) + a[2];
}
// The sum of the products of the components.
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE Number<Packed> dot(Packed a, Packed b) {
  Packed products = a * b;
  return (products[0] + products[1]) + products[2];
}

// The largest component.
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE Number<Packed> largest(Packed a) {
  return max(max(a[0], a[1]), a[2]);
}

// The same in each lane.
template <class Packed>
BC_INLINE Packed largest_in_each(Packed a) {
  Packed of_two = max(a, __builtin_shufflevector(a, a, 1, 0, 3, 2));
  return max(of_two, __builtin_shufflevector(of_two, of_two, 2, 3, 0, 1));
}

// The components y z x, and z x y.
template <class T>
BC_INLINE Vec<T> rotated(const Vec<T>& a) {
  return {a[1], a[2], a[0]};
}
template <class Packed>
BC_INLINE Packed rotated(Packed a) {
  return __builtin_shufflevector(a, a, 1, 2, 0, 0);
}
template <class T>
BC_INLINE Vec<T> rotated_back(const Vec<T>& a) {
  return {a[2], a[0], a[1]};
}
template <class Packed>
BC_INLINE Packed rotated_back(Packed a) {
  return __builtin_shufflevector(a, a, 2, 0, 1, 1);
}

// By numbers, each with its own mask. The instruction is named because g++ compares the mask first.
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE Packed choose(Mask<Packed> masks, Packed a, Packed b) {
#if defined(__AVX__)
  if constexpr (std::is_same_v<Packed, Lanes<double, 4>>)
    return (Packed)_mm256_blendv_pd((__m256d)b, (__m256d)a, (__m256d)masks);
#endif
  return masks ? a : b;
}
// One choice for all three numbers of a single pair, without a branch.
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE Packed select(bool mask, Packed a, Packed b) {
  return choose(Mask<Packed>{} - Number<Mask<Packed>>(mask), a, b);
}

// Which of three numbers is the one at `place`: 0, 1 or 2.
template <class T>
BC_INLINE Flags<T> is_at(Place<T> place) {
  if constexpr (packed<T>) {
    static constexpr int64_t flags[3][4] = {{-1}, {0, -1}, {0, 0, -1, -1}};
    Flags<T> found;
    std::memcpy(&found, flags[place], sizeof found);
    return found;
  } else {
    T number = T(place);
    return Flags<T>{number == 0.0, number == 1.0, number == 2.0};
  }
}
// Whether all, or any, of three masks are set.
template <class M>
BC_INLINE M all_of(const Vec<M>& masks) {
  return M((masks[0] & masks[1]) & masks[2]);
}
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE bool all_of(Packed masks) {
  return (bits(masks) & 7) == 7;
}
template <class M>
BC_INLINE M any_of(const Vec<M>& masks) {
  return M((masks[0] | masks[1]) | masks[2]);
}
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE bool any_of(Packed masks) {
  return bits(masks) != 0;
}

// The nearest point of the box of half extents `half` about the origin.
template <class Three>
BC_INLINE Three clamp(const Three& x, const Three& half) {
  return min(half, max(-half, x));
}

// A 3 × 3 matrix as triples: its columns.
template <class T>
struct Columns {
  Triple<T> c[3];

  BC_INLINE Triple<T>& operator[](int j) { return c[j]; }
  BC_INLINE const Triple<T>& operator[](int j) const { return c[j]; }
};

template <class T>
BC_INLINE Mat<T> matrix(const Columns<T>& m) {
  return {{{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
}
template <class T>
BC_INLINE Columns<T> transpose(const Columns<T>& m) {
  if constexpr (packed<T>) {
    auto even = __builtin_shufflevector(m[0], m[1], 0, 4, 2, 6);
    auto odd = __builtin_shufflevector(m[0], m[1], 1, 5, 3, 7);
    auto last_even = __builtin_shufflevector(m[2], m[2], 0, 0, 2, 2);
    auto last_odd = __builtin_shufflevector(m[2], m[2], 1, 1, 3, 3);
    return {{__builtin_shufflevector(even, last_even, 0, 1, 4, 5),
             __builtin_shufflevector(odd, last_odd, 0, 1, 4, 5),
             __builtin_shufflevector(even, last_even, 2, 3, 6, 7)}};
  } else {
    return {
        {{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
  }
}
// A matrix by its diagonal, and the entries one and two rows below it, in each column: its columns.
template <class T>
BC_INLINE Columns<T> from_diagonals(const Columns<T>& d) {
  Columns<T> by_column = transpose(d);
  return {{by_column[0], rotated_back(by_column[1]), rotated(by_column[2])}};
}
template <class T>
BC_INLINE Columns<T> diagonals(const Columns<T>& m) {
  return transpose(Columns<T>{{m[0], rotated(m[1]), rotated_back(m[2])}});
}

template <class T>
BC_INLINE Columns<T> abs(const Columns<T>& m) {
  return {{abs(m[0]), abs(m[1]), abs(m[2])}};
}
template <class T>
BC_INLINE Columns<T> select(Mask<T> mask, const Columns<T>& a, const Columns<T>& b) {
  return {{select(mask, a[0], b[0]), select(mask, a[1], b[1]), select(mask, a[2], b[2])}};
}
template <class T>
BC_INLINE Triple<T> operator*(const Columns<T>& m, const Triple<T>& a) {
  return (spread(a, 0) * m[0] + spread(a, 1) * m[1]) + spread(a, 2) * m[2];
}

}  // namespace box_contact::BOX_CONTACT_SET
