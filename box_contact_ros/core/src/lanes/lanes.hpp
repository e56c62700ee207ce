// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Lanes: the numbers of one pair of boxes, or of W pairs side by side.
//
// From poses to moments, the core's functions are templates over T: `double` for a pair alone, or
// `Lanes<double, W>`, a vector of the compiler, with one pair in each of its W lanes. The blocks of forces
// are such templates, too, and the index has no lanes. All functions here work on each lane alone,
// so a pair has the same bits in every lane of every width. Where a pair alone takes another way
// (`packed`), tests compare bits.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "target.hpp"

// Vectors wider than the machine's registers are passed between inlined functions only.
#pragma GCC diagnostic ignored "-Wpsabi"
#if defined(__clang__)
// Masks are bool or vectors, and the operators & and | combine both.
#pragma clang diagnostic ignored "-Wbool-operation"
// Headers name the inline namespace of target.hpp in full.
#pragma clang diagnostic ignored "-Winline-namespace-reopened-noninline"
#endif

namespace box_contact::BOX_CONTACT_SET {

template <class Number, int width>
struct LanesOf {
  static_assert(width > 1, "one lane is a plain number");
  typedef Number type __attribute__((vector_size(width * sizeof(Number))));
};
template <class Number, int width>
using Lanes = typename LanesOf<Number, width>::type;

template <class T>
constexpr bool is_scalar = std::is_arithmetic_v<T>;

template <class T>
constexpr auto first_number(T x) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    return x[0];
  }
}
// The type of one lane of T.
template <class T>
using Number = decltype(first_number(T()));

template <class T>
constexpr int width = sizeof(T) / sizeof(Number<T>);

// What a comparison of T gives: bool, or a vector of integers, 0 or −1.
template <class T>
using Mask = decltype(T() < T());

// A small whole number: of a single pair an index.
template <class T>
using Index = std::conditional_t<is_scalar<T>, int, T>;

// The same number, which compilers do not know: a loop of so many rounds stays a loop. Code that does
// not fit the first cache, or that of decoded instructions, takes up to twice the time.
BC_INLINE int opaque(int n) {
  asm("" : "+r"(n));
  return n;
}

// The same number in every lane.
template <class T>
BC_INLINE T splat(Number<T> x) {
  return x - T{};  // no instruction, while −0 + 0 is one
}

template <class T>
BC_INLINE T select(Mask<T> mask, T if_true, T if_false) {
  return mask ? if_true : if_false;
}

// One of two objects. No processor predicts which: compilers make no branch of this.
template <class Object>
BC_INLINE const Object& pick(bool first, const Object& a, const Object& b) {
  auto at_a = reinterpret_cast<uintptr_t>(&a), at_b = reinterpret_cast<uintptr_t>(&b);
  return *reinterpret_cast<const Object*>(at_b ^ ((at_a ^ at_b) & -uintptr_t(first)));
}

// Of two equal numbers, or with a NaN in `a` or `b`, min and max return b. The instructions are named
// because g++ takes two for the comparison of a vector with a constant.
template <class T>
BC_INLINE T min(T a, T b) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<T, Lanes<double, 8>>)
    return (T)_mm512_maskz_min_pd(0xff, (__m512d)a, (__m512d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 16>>)
    return (T)_mm512_maskz_min_ps(0xffff, (__m512)a, (__m512)b);
#endif
#if defined(__AVX__)
  if constexpr (std::is_same_v<T, Lanes<double, 4>>)
    return (T)_mm256_min_pd((__m256d)a, (__m256d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 8>>) return (T)_mm256_min_ps((__m256)a, (__m256)b);
#endif
#if defined(__SSE2__)
  if constexpr (std::is_same_v<T, Lanes<double, 2>>) return (T)_mm_min_pd((__m128d)a, (__m128d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 4>>) return (T)_mm_min_ps((__m128)a, (__m128)b);
  // Else a branch: of a number and a constant, g++ makes one.
  if constexpr (std::is_same_v<T, float>)
    return _mm_cvtss_f32(_mm_min_ss(_mm_set_ss(a), _mm_set_ss(b)));
#endif
  return a < b ? a : b;
}
template <class T>
BC_INLINE T max(T a, T b) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<T, Lanes<double, 8>>)
    return (T)_mm512_maskz_max_pd(0xff, (__m512d)a, (__m512d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 16>>)
    return (T)_mm512_maskz_max_ps(0xffff, (__m512)a, (__m512)b);
#endif
#if defined(__AVX__)
  if constexpr (std::is_same_v<T, Lanes<double, 4>>)
    return (T)_mm256_max_pd((__m256d)a, (__m256d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 8>>) return (T)_mm256_max_ps((__m256)a, (__m256)b);
#endif
#if defined(__SSE2__)
  if constexpr (std::is_same_v<T, Lanes<double, 2>>) return (T)_mm_max_pd((__m128d)a, (__m128d)b);
  if constexpr (std::is_same_v<T, Lanes<float, 4>>) return (T)_mm_max_ps((__m128)a, (__m128)b);
  // Else a branch: of a number and a constant, g++ makes one.
  if constexpr (std::is_same_v<T, float>)
    return _mm_cvtss_f32(_mm_max_ss(_mm_set_ss(a), _mm_set_ss(b)));
#endif
  return a > b ? a : b;
}

template <class T>
BC_INLINE T abs(T x) {
  if constexpr (std::is_same_v<T, float>) {
    return __builtin_fabsf(x);  // std::fabs of float is a function that files of all sets share
  } else if constexpr (is_scalar<T>) {
    return std::fabs(x);
  } else {
    using Bits = Mask<T>;
    constexpr auto sign = Number<Bits>(1) << (8 * sizeof(Number<Bits>) - 1);
    return (T)((Bits)x & ~sign);
  }
}

template <class T>
BC_INLINE T sqrt(T x) {
  if constexpr (std::is_same_v<T, float>) {
    return __builtin_sqrtf(x);  // as for abs
  } else if constexpr (is_scalar<T>) {
    return std::sqrt(x);
#if defined(__AVX512F__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 8>>) {
    return (T)_mm512_mask_sqrt_pd((__m512d)x, 0xff, (__m512d)x);
  } else if constexpr (std::is_same_v<T, Lanes<float, 16>>) {
    return (T)_mm512_mask_sqrt_ps((__m512)x, 0xffff, (__m512)x);
#endif
#if defined(__AVX__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 4>>) {
    return (T)_mm256_sqrt_pd((__m256d)x);
  } else if constexpr (std::is_same_v<T, Lanes<float, 8>>) {
    return (T)_mm256_sqrt_ps((__m256)x);
#endif
#if defined(__SSE2__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 2>>) {
    return (T)_mm_sqrt_pd((__m128d)x);
  } else if constexpr (std::is_same_v<T, Lanes<float, 4>>) {
    return (T)_mm_sqrt_ps((__m128)x);
#endif
  } else {
    T root{};
    for (int i = 0; i < width<T>; ++i) root[i] = sqrt<Number<T>>(x[i]);
    return root;
  }
}

template <class T>
BC_INLINE T ceil(T x) {
  if constexpr (is_scalar<T>) {
    return std::ceil(x);
#if defined(__AVX512F__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 8>>) {
    return (T)_mm512_ceil_pd((__m512d)x);
#endif
#if defined(__AVX__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 4>>) {
    return (T)_mm256_ceil_pd((__m256d)x);
#endif
  } else {
    T above{};
    for (int i = 0; i < width<T>; ++i) above[i] = std::ceil(x[i]);
    return above;
  }
}

template <class T>
BC_INLINE auto lane(const T& x, int i) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    return x[i];
  }
}
template <class T, class N>
BC_INLINE void set_lane(T& x, int i, N value) {
  if constexpr (is_scalar<T>) {
    x = value;
  } else {
    x[i] = value;
  }
}

// Structs all of whose members are lanes of T. Copy what one has in lane i to lane j of one of lanes U.
template <class T, class U, class From, class To>
BC_INLINE void copy_lane(const From& from, int i, To& to, int j) {
  constexpr size_t one = sizeof(Number<T>), members = sizeof from / sizeof(T);
  static_assert(members * sizeof(T) == sizeof from && members * sizeof(U) == sizeof to);
  auto* source = reinterpret_cast<const char*>(&from) + one * i;
  auto* target = reinterpret_cast<char*>(&to) + one * j;
  for (size_t k = 0; k < members; ++k)
    std::memcpy(target + k * sizeof(U), source + k * sizeof(T), one);
}
// Put the chosen lanes of one into another.
template <class T, class Struct>
BC_INLINE void put(Mask<T> chosen, const Struct& from, Struct& to) {
  auto* source = reinterpret_cast<const char*>(&from);
  auto* target = reinterpret_cast<char*>(&to);
  for (size_t k = 0; k < sizeof from; k += sizeof(T)) {
    T lanes[2];
    std::memcpy(&lanes[0], source + k, sizeof(T));
    std::memcpy(&lanes[1], target + k, sizeof(T));
    lanes[1] = select<T>(chosen, lanes[0], lanes[1]);
    std::memcpy(target + k, &lanes[1], sizeof(T));
  }
}

// A bit for each lane of a mask.
template <class M>
BC_INLINE unsigned bits(M mask) {
  if constexpr (is_scalar<M>) {
    return mask;
#if defined(__AVX512F__)
  } else if constexpr (sizeof(M) == 64 && width<M> == 8) {
    return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask);
#endif
#if defined(__AVX__)
  } else if constexpr (sizeof(M) == 32 && width<M> == 4) {
    return _mm256_movemask_pd((__m256d)mask);
  } else if constexpr (sizeof(M) == 32 && width<M> == 8) {
    return _mm256_movemask_ps((__m256)mask);
#endif
#if defined(__SSE2__)
  } else if constexpr (sizeof(M) == 16 && width<M> == 2) {
    return _mm_movemask_pd((__m128d)mask);
  } else if constexpr (sizeof(M) == 16 && width<M> == 4) {
    return _mm_movemask_ps((__m128)mask);
#endif
  } else {
    unsigned found = 0;
    for (int i = 0; i < width<M>; ++i) found |= unsigned(mask[i] & 1) << i;
    return found;
  }
}
template <class M>
BC_INLINE bool any(M mask) {
  return bits(mask) != 0;
}

}  // namespace box_contact::BOX_CONTACT_SET
