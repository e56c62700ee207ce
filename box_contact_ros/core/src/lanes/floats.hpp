// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Float32 of a pair alone, or of two blocks of W pairs side by side: a register has twice as many.
#pragma once

#include "triples.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Blocks of T that are solved together.
template <class T>
constexpr int blocks_together = is_scalar<T> ? 1 : 2;

template <class T>
using Floats = typename std::conditional_t<is_scalar<T>, std::enable_if<true, float>,
                                           LanesOf<float, is_scalar<T> ? 2 : 2 * width<T>>>::type;

// The same numbers in the other precision. The instructions are named because g++ converts halves.
template <class To, class From>
BC_INLINE To converted(From x) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<From, Lanes<float, 8>>)
    return (To)_mm512_maskz_cvtps_pd(0xff, (__m256)x);
  if constexpr (std::is_same_v<From, Lanes<double, 8>>)
    return (To)_mm512_maskz_cvtpd_ps(0xff, (__m512d)x);
#endif
#if defined(__AVX__)
  if constexpr (std::is_same_v<From, Lanes<float, 4>>) return (To)_mm256_cvtps_pd((__m128)x);
  if constexpr (std::is_same_v<From, Lanes<double, 4>>) return (To)_mm256_cvtpd_ps((__m256d)x);
#endif
  return __builtin_convertvector(x, To);
}

template <class T, int... k>
BC_INLINE Floats<T> joined(const T& a, const T& b, std::integer_sequence<int, k...>) {
  using Half = Lanes<float, width<T>>;
  return __builtin_shufflevector(converted<Half>(a), converted<Half>(b), k...);
}
template <class T, int... k>
BC_INLINE T part(const Floats<T>& x, std::integer_sequence<int, k...>, bool second) {
  return converted<T>(second ? __builtin_shufflevector(x, x, width<T> + k...)
                             : __builtin_shufflevector(x, x, k...));
}

// A number of each block: `of(0)`, `of(1)`.
template <class T, class Of>
BC_INLINE Floats<T> floats(const Of& of) {
  if constexpr (is_scalar<T>) {
    return float(of(0));
  } else {
    return joined<T>(of(0), of(1), std::make_integer_sequence<int, 2 * width<T>>());
  }
}
template <class T, class Of>
BC_INLINE Triple<Floats<T>> triple_of_floats(const Of& of) {
  if constexpr (packed<T>) {
    return converted<Lanes<float, 4>>(of(0));
  } else {
    auto number = [&](int k) { return floats<T>([&](int block) { return of(block)[k]; }); };
    return triple(Vec<Floats<T>>{number(0), number(1), number(2)});
  }
}
// The numbers of a block.
template <class T>
BC_INLINE T doubles(const Floats<T>& x, int block) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    return part<T>(x, std::make_integer_sequence<int, width<T>>(), block == 1);
  }
}
template <class T>
BC_INLINE Triple<T> triple_of_doubles(const Triple<Floats<T>>& x, int block) {
  if constexpr (packed<T>) {
    return converted<Triple<T>>(x);
  } else {
    return triple(
        Vec<T>{doubles<T>(x[0], block), doubles<T>(x[1], block), doubles<T>(x[2], block)});
  }
}

// One of two numbers. No processor predicts which: compilers make no branch of this.
template <class F>
BC_INLINE F either(Mask<F> first, F a, F b) {
  if constexpr (is_scalar<F>) {
    uint32_t of_a, of_b, chosen = -uint32_t(first);
    std::memcpy(&of_a, &a, sizeof a);
    std::memcpy(&of_b, &b, sizeof b);
    of_a = (of_a & chosen) | (of_b & ~chosen);
    std::memcpy(&a, &of_a, sizeof a);
    return a;
  } else {
    return select<F>(first, a, b);
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
