// Lanes: the numbers of one pair of boxes, or of W pairs side by side, and small vectors of them.
//
// Every algorithm of the core is one template over T. T is `double` for a single pair, or
// `Lanes<double, W>`, a vector of the compiler, with one pair in each of its W lanes. All functions
// here work on each lane alone, so a pair has the same bits in every lane of every width.
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

template <class T, bool = is_scalar<T>>
struct NumberOf {
  using type = T;
};
template <class T>
struct NumberOf<T, false> {
  using type = std::decay_t<decltype(std::declval<T&>()[0])>;
};
// The type of one lane of T.
template <class T>
using Number = typename NumberOf<T>::type;

template <class T>
constexpr int width = sizeof(T) / sizeof(Number<T>);

// What a comparison of T gives: bool, or a vector of integers, 0 or −1.
template <class T>
using Mask = decltype(T() < T());

// The same number in every lane.
template <class T>
BC_INLINE T splat(Number<T> x) {
  return T{} + x;
}

template <class T>
BC_INLINE T select(Mask<T> mask, T if_true, T if_false) {
  return mask ? if_true : if_false;
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
#endif
  return a > b ? a : b;
}

template <class T>
BC_INLINE T abs(T x) {
  if constexpr (is_scalar<T>) {
    return std::fabs(x);
  } else {
    using Bits = Mask<T>;
    constexpr auto sign = Number<Bits>(1) << (8 * sizeof(Number<Bits>) - 1);
    return (T)((Bits)x & ~sign);
  }
}

template <class T>
BC_INLINE T sqrt(T x) {
  if constexpr (is_scalar<T>) {
    return std::sqrt(x);
#if defined(__AVX512F__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 8>>) {
    return (T)_mm512_mask_sqrt_pd((__m512d)x, 0xff, (__m512d)x);
#endif
#if defined(__AVX__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 4>>) {
    return (T)_mm256_sqrt_pd((__m256d)x);
#endif
#if defined(__SSE2__)
  } else if constexpr (std::is_same_v<T, Lanes<double, 2>>) {
    return (T)_mm_sqrt_pd((__m128d)x);
#endif
  } else {
    T root{};
    for (int i = 0; i < width<T>; ++i) root[i] = std::sqrt(x[i]);
    return root;
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

template <class M>
BC_INLINE bool any(M mask) {
  if constexpr (is_scalar<M>) {
    return mask;
#if defined(__AVX__)
  } else if constexpr (sizeof(M) == 32 && sizeof(Number<M>) == 8) {
    return _mm256_movemask_pd((__m256d)mask) != 0;
#endif
  } else {
    Number<M> found = 0;
    for (int i = 0; i < width<M>; ++i) found |= mask[i];
    return found != 0;
  }
}

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
BC_INLINE Vec<T> operator-(T a, const Vec<T>& b) {
  return {a - b[0], a - b[1], a - b[2]};
}
template <class T>
BC_INLINE T dot(const Vec<T>& a, const Vec<T>& b) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
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
template <class T>
BC_INLINE T largest(const Vec<T>& a) {
  return max(max(a[0], a[1]), a[2]);
}
template <class T>
BC_INLINE T smallest(const Vec<T>& a) {
  return min(min(a[0], a[1]), a[2]);
}
template <class T>
BC_INLINE Vec<T> select(Mask<T> mask, const Vec<T>& a, const Vec<T>& b) {
  return {select<T>(mask, a[0], b[0]), select<T>(mask, a[1], b[1]), select<T>(mask, a[2], b[2])};
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
BC_INLINE Mat<T> transpose(const Mat<T>& m) {
  return {{{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
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
template <class T>
BC_INLINE Mat<T> select(Mask<T> mask, const Mat<T>& a, const Mat<T>& b) {
  Mat<T> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = select<T>(mask, a[i][j], b[i][j]);
  return m;
}

template <class T>
BC_INLINE Vec<Number<T>> lane(const Vec<T>& a, int i) {
  return {lane(a[0], i), lane(a[1], i), lane(a[2], i)};
}
template <class T>
BC_INLINE Mat<Number<T>> lane(const Mat<T>& m, int i) {
  Mat<Number<T>> found;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) found[r][c] = lane(m[r][c], i);
  return found;
}
template <class T, class N>
BC_INLINE void set_lane(Vec<T>& a, int i, const Vec<N>& value) {
  for (int k = 0; k < 3; ++k) set_lane(a[k], i, value[k]);
}

// --- Triples ---
//
// A triple is three numbers that one formula treats alike: the components of a vector, or one number
// for each pair of opposite faces. W pairs have it as a `Vec`. A single pair has it side by side in
// one vector of the machine, where the machine has one of four such numbers. The fourth lane then
// repeats the third, so it traps or slows down where that one does.
//
// Either way each number takes the same operations in the same order, and has the same bits.

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

// The sum of the components, three times.
template <class T>
BC_INLINE Vec<T> total(const Vec<T>& a) {
  return uniform((a[0] + a[1]) + a[2]);
}
template <class Packed>
BC_INLINE Packed total(Packed a) {
  return (spread(a, 0) + spread(a, 1)) + spread(a, 2);
}

// The components y z x.
template <class T>
BC_INLINE Vec<T> rotated(const Vec<T>& a) {
  return {a[1], a[2], a[0]};
}
template <class Packed>
BC_INLINE Packed rotated(Packed a) {
  return __builtin_shufflevector(a, a, 1, 2, 0, 0);
}

// One choice for all three numbers of a single pair, without a branch.
template <class Packed, class = std::enable_if_t<!is_scalar<Packed> && !std::is_class_v<Packed>>>
BC_INLINE Packed select(bool mask, Packed a, Packed b) {
  return (Mask<Packed>{} - Number<Mask<Packed>>(mask)) ? a : b;
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
BC_INLINE Columns<T> columns(const Mat<T>& m) {
  return {{triple(column(m, 0)), triple(column(m, 1)), triple(column(m, 2))}};
}
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
    return columns(transpose(matrix(m)));
  }
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
