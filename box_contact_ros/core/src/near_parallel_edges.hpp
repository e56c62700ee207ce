// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The edge axes once more, where two edges are almost parallel.
//
// The axis of two such edges is what a cancellation leaves: entries of R that are as small as the angle
// θ, and good to 1e-16. That matters only if another axis wins by less than the gap along this one may
// be wrong; `SeparatingAxis::doubtful` marks those pairs. For them R is made anew from the quaternions,
// with each entry good to a few ulp of itself. All terms of a gap are then as small as θ, and as
// accurate, so float64 is enough for the gap. It is rounded to 6 · 2⁻⁵³ of the size.
#pragma once

#include "separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A number, or a triple, as the unevaluated sum of two (Dekker 1971; Knuth, The Art of Computer
// Programming 2, section 4.2.2). Compile without fused multiply-add.
template <class X>
struct Twofold {
  X high, low;
};

// The product of two numbers, exactly.
template <class X>
BC_INLINE Twofold<X> exact_product(const X& a, const X& b) {
  auto high_half = [](const X& x) {
    X c = (0x1p27 + 1.0) * x;
    return X(c - (c - x));
  };
  X p = a * b, a_high = high_half(a), b_high = high_half(b);
  X a_low = a - a_high, b_low = b - b_high;
  return {p, ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low};
}
template <class X>
BC_INLINE Twofold<X> operator+(const Twofold<X>& a, const Twofold<X>& b) {
  X s = a.high + b.high, c = s - a.high;
  X e = ((a.high - (s - c)) + (b.high - c)) + (a.low + b.low);
  X high = s + e;
  return {high, e - (high - s)};
}
template <class X>
BC_INLINE Twofold<X> operator-(const Twofold<X>& a) {
  return {-a.high, -a.low};
}
template <class X>
BC_INLINE Twofold<X> operator*(const Twofold<X>& a, const Twofold<X>& b) {
  Twofold<X> p = exact_product(a.high, b.high);
  return {p.high, p.low + (a.high * b.low + a.low * b.high)};
}
template <class X>
BC_INLINE Twofold<X> rotated(const Twofold<X>& a) {
  return {rotated(a.high), rotated(a.low)};
}
template <class X>
BC_INLINE Twofold<X> rotated_back(const Twofold<X>& a) {
  return {rotated_back(a.high), rotated_back(a.low)};
}

// A quaternion times a power of two, so that its length is from 1 to 4: fourth powers of its components
// must not overflow, and a power of two changes none of their digits.
template <class T>
BC_INLINE void scale_to_unit(T (&q)[4]) {
  using Bits = std::conditional_t<is_scalar<T>, int64_t, Mask<T>>;
  constexpr int64_t bias = 1023;
  constexpr int digits = 52;
  T norm2 = squared_norm(q), scale;
  Bits exponent;
  std::memcpy(&exponent, &norm2, sizeof exponent);
  exponent = (bias - (((exponent >> digits) - bias) >> 1)) << digits;
  std::memcpy(&scale, &exponent, sizeof scale);
  for (int k = 0; k < 4; ++k) q[k] = scale * q[k];
}

// Rᵀ, with entries that are good to a few ulp each: the axes of p's box in the frame of q's box.
template <class T>
BC_INLINE Columns<T> precise_rotation(const T (&p)[4], const T (&q)[4]) {
  using Three = Twofold<Triple<T>>;
  Triple<T> pv = triple(Vec<T>{p[0], p[1], p[2]}), qv = triple(Vec<T>{q[0], q[1], q[2]});
  // The vector v and the scalar w of conj(p) ⊗ q.
  Three v = (exact_product(uniform(p[3]), qv) + -exact_product(uniform(q[3]), pv)) +
            (exact_product(rotated_back(pv), rotated(qv)) +
             -exact_product(rotated(pv), rotated_back(qv)));
  Three products = exact_product(pv, qv);
  auto product = [&](int k) { return Twofold<T>{products.high[k], products.low[k]}; };
  Twofold<T> of_w = (exact_product(p[3], q[3]) + product(0)) + (product(1) + product(2));
  Three w{uniform(of_w.high), uniform(of_w.low)};

  Three squares = v * v, beside = v * rotated(v), by_w = rotated_back(v) * w;
  Three on_diagonal = (w * w + squares) + -(rotated(squares) + rotated_back(squares));
  Three below = beside + -by_w, above = rotated_back(beside + by_w);
  T norm2 = of_w.high * of_w.high + sum(squares.high);
  Triple<T> once = uniform(T(1.0 / norm2)), twice = uniform(T(2.0 / norm2));
  return from_diagonals<T>({{once * on_diagonal.high, twice * below.high, twice * above.high}});
}

// Find the edge axes of pairs anew, from the very doubles of their poses. `pair`: its R is replaced.
template <class T>
BC_INLINE void find_precise_axis(Pair<T> pair, const Pose<T>& a, const Pose<T>& b,
                                 SeparatingAxis<T>& found) {
  T tolerance = tie * pair.size, first[4], second[4];
  for (int k = 0; k < 4; ++k) {
    first[k] = select<T>(pair.swapped, b.quaternion[k], a.quaternion[k]);
    second[k] = select<T>(pair.swapped, a.quaternion[k], b.quaternion[k]);
  }
  scale_to_unit(first);
  scale_to_unit(second);
  BestAxis<T> best;
  offer_face_axes(pair, best);
  pair.a_in_b = precise_rotation(first, second);
  pair.b_in_a = transpose(pair.a_in_b);
  for (int i = 0; i < opaque(3); ++i) {
    EdgeAxes<T> axes = edge_axes<false>(pair, i);
    auto if_there_is_one = [](auto gap, auto length2) {
      return select<decltype(gap)>(length2 > cross_product_min * cross_product_min, gap,
                                   splat<decltype(gap)>(-infinity));
    };
    Triple<T> inverse = axes.inverse_lengths();
    best.offer(first_edge_axis + 3 * i, each(if_there_is_one, axes.overlap * inverse, axes.length2),
               inverse, tolerance);
  }
  Mask<T> chosen = found.doubtful & pair.valid;
  Index<T> index = best.winner(tolerance);
  found.separation = select<T>(chosen, best.largest(), found.separation);
  found.axis = select<Index<T>>(chosen, index, found.axis);
  found.normal = select(chosen, axis_normal(pair, best, index), found.normal);
}

}  // namespace box_contact::BOX_CONTACT_SET
