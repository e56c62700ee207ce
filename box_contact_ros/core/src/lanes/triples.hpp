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

template <class T>
using Triple =
    typename std::conditional_t<packed<T>, LanesOf<T, 4>, std::enable_if<true, Vec<T>>>::type;

// What comparisons of triples give: a mask for each number.
template <class T>
using Flags = decltype(Triple<T>() > Triple<T>());

// Functions of a `Three` take either layout: a `Vec`, or a vector of the machine.
template <class Three>
constexpr bool is_vec = std::is_class_v<Three>;

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
    return triple(Vec<Number<T>>{lane(a[0], i), lane(a[1], i), lane(a[2], i)});
  }
}
// A formula of single numbers, for each number of triples.
template <class Formula, class Three, class... More>
BC_INLINE Three each(Formula formula, const Three& a, const More&... more) {
  if constexpr (is_vec<Three>) {
    return {formula(a[0], more[0]...), formula(a[1], more[1]...), formula(a[2], more[2]...)};
  } else {
    return formula(a, more...);
  }
}

// Component k as a triple.
template <class Three>
BC_INLINE Three repeated(const Three& a, int k) {
  if constexpr (is_vec<Three>) {
    return {a[k], a[k], a[k]};
  } else {
    return k == 0   ? __builtin_shufflevector(a, a, 0, 0, 0, 0)
           : k == 1 ? __builtin_shufflevector(a, a, 1, 1, 1, 1)
                    : __builtin_shufflevector(a, a, 2, 2, 2, 2);
  }
}
// The largest component, in each lane of a vector of the machine.
template <class Packed>
BC_INLINE Packed largest_in_each(Packed a) {
  Packed of_two = max(a, __builtin_shufflevector(a, a, 1, 0, 3, 2));
  return max(of_two, __builtin_shufflevector(of_two, of_two, 2, 3, 0, 1));
}

// The components y z x, and z x y.
template <class Three>
BC_INLINE Three rotated(const Three& a) {
  if constexpr (is_vec<Three>) {
    return {a[1], a[2], a[0]};
  } else {
    return __builtin_shufflevector(a, a, 1, 2, 0, 0);
  }
}
template <class Three>
BC_INLINE Three rotated_back(const Three& a) {
  if constexpr (is_vec<Three>) {
    return {a[2], a[0], a[1]};
  } else {
    return __builtin_shufflevector(a, a, 2, 0, 1, 1);
  }
}

// By numbers, each with its own mask. The instruction is named because g++ compares the mask first.
template <class Masks, class Three>
BC_INLINE Three choose(const Masks& masks, const Three& a, const Three& b) {
#if defined(__AVX__)
  if constexpr (std::is_same_v<Three, Lanes<double, 4>>)
    return (Three)_mm256_blendv_pd((__m256d)b, (__m256d)a, (__m256d)masks);
#endif
  if constexpr (is_vec<Three>) {
    auto one = [](auto x, auto y, auto mask) { return select<decltype(x)>(mask, x, y); };
    return each(one, a, b, masks);
  } else {
    return masks ? a : b;
  }
}
// One choice for all three numbers: of a single pair without a branch.
template <class M, class Three, class = std::enable_if_t<is_vec<Three> || std::is_same_v<M, bool>>>
BC_INLINE Three select(const M& mask, const Three& a, const Three& b) {
  if constexpr (is_vec<Three>) {
    return each([&](auto x, auto y) { return select<decltype(x)>(mask, x, y); }, a, b);
  } else {
    return choose(Mask<Three>{} - Number<Mask<Three>>(mask), a, b);
  }
}

// Which of three numbers is the one at `index`: 0, 1 or 2.
template <class T>
BC_INLINE Flags<T> is_at(Index<T> index) {
  if constexpr (packed<T>) {
    static constexpr int64_t flags[3][4] = {{-1}, {0, -1}, {0, 0, -1, -1}};
    Flags<T> found;
    std::memcpy(&found, flags[index], sizeof found);
    return found;
  } else {
    T number = T(index);
    return Flags<T>{number == 0.0, number == 1.0, number == 2.0};
  }
}
// Whether all, or any, of three masks are set.
template <class Masks>
BC_INLINE auto all_of(const Masks& masks) {
  if constexpr (is_vec<Masks>) {
    return decltype(masks[0] & masks[1])((masks[0] & masks[1]) & masks[2]);
  } else {
    return (bits(masks) & 7) == 7;
  }
}
template <class Masks>
BC_INLINE auto any_of(const Masks& masks) {
  if constexpr (is_vec<Masks>) {
    return decltype(masks[0] | masks[1])((masks[0] | masks[1]) | masks[2]);
  } else {
    return bits(masks) != 0;
  }
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
  return (repeated(a, 0) * m[0] + repeated(a, 1) * m[1]) + repeated(a, 2) * m[2];
}

}  // namespace box_contact::BOX_CONTACT_SET
