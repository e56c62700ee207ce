// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The patch box: a cuboid around A∩B in which every overlap looks alike, whatever the sizes and the
// depth are.
//
// Its z axis is SAT's normal, so faces and pairs of edges are described alike. P is the box that has
// less within the depth, Q the other. The x axis is along the edge of P that has most of it across z.
// The bounds hold A∩B:
//
// 1. Along z they are the ends of the two boxes on the axis, which are `depth` apart.
// 2. What P has beyond the lowest point of Q reaches at most depth / |n_k| along P's axis k. The
//    same holds for Q. These two cuboids bound x and y.
// 3. Each of the six slabs |a · u| of both boxes then bounds each coordinate by the bounds of the
//    other two (Benhamou and others 1999, hull consistency).
//
// In its coordinates u, −1 to 1, each slab is −minus ≤ a · u ≤ plus, with Σ|a_i| = 1. Places are
// computed in float64; a, plus and minus have no unit, and are float32 from here on.
#pragma once

#include "../minimum_depth.hpp"
#include "../query.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Lanes of float32 for the pairs of T.
template <class T>
using Floats = typename std::conditional_t<is_scalar<T>, NumberOf<float>,
                                           LanesOf<float, is_scalar<T> ? 2 : width<T>>>::type;

template <class T>
BC_INLINE Floats<T> to_floats(const T& x) {
  if constexpr (is_scalar<T>) {
    return float(x);
  } else {
    return __builtin_convertvector(x, Floats<T>);
  }
}
template <class T>
BC_INLINE T to_doubles(const Floats<T>& x) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    return __builtin_convertvector(x, T);
  }
}
template <class T>
BC_INLINE Triple<T> triple_to_doubles(const Triple<Floats<T>>& x) {
  return triple(Vec<T>{to_doubles<T>(x[0]), to_doubles<T>(x[1]), to_doubles<T>(x[2])});
}
template <class T>
BC_INLINE Triple<Floats<T>> triple_to_floats(const Triple<T>& x) {
  return triple(Vec<Floats<T>>{to_floats<T>(x[0]), to_floats<T>(x[1]), to_floats<T>(x[2])});
}

namespace mlp {

// Least half extent of the patch box [of the size]: below the extents of what is pressed.
constexpr double least_extent = 1e-3 * depth_floor;
// Least component of a unit vector by which is divided.
constexpr float least_component = 1e-30F;
// A half, and more than what rounding to float32 takes off.
constexpr double half_of_rounding = 0.500001;
// Rounding of a place [of the size].
constexpr double place_slack = 1e-14;
// Where slabs end that do not meet the patch box [of its half width in their direction].
constexpr float beyond = 4.0F;
// Least share of a slab's width along an axis by which is divided [of the size].
constexpr double least_share = 1e-30;

template <class T>
BC_INLINE Triple<T> cross_product(const Triple<T>& a, const Triple<T>& b) {
  return rotated(a) * rotated_back(b) - rotated_back(a) * rotated(b);
}

// A unit vector along the axis of the largest number.
template <class T>
BC_INLINE Triple<T> axis_of_largest(const Triple<T>& x) {
  T second = splat<T>(1.0), third = splat<T>(2.0);
  T place = select<T>(x[1] > x[0], second, T{});
  place = select<T>(x[2] > max<T>(x[0], x[1]), third, place);
  return choose(is_at<T>(place), uniform(splat<T>(1.0)), Triple<T>{});
}

template <class T>
struct PatchBox {
  using F = Floats<T>;
  Mask<T> p_is_b;
  Triple<T> axes[3];      // x, y and z in P's frame; z from P to Q
  T middle[3], half[3];   // of the bounds, from P's centre [m]
  T pressed;              // by how far Q is moved against z [m]
  Triple<F> share[2][3];  // a_i of the slabs of P and Q
  Triple<F> plus[2], minus[2];

  BC_INLINE explicit PatchBox(const Query<T>& query) {
    const Pair<T>& pair = query.pair;
    T least_depth = depth_floor * pair.size;
    T depth = max(-query.axis.separation, least_depth);
    pressed = max(least_depth + query.axis.separation, T{});

    Triple<T> normal_a = query.axis.normal, normal_b = pair.a_in_b * normal_a;
    Triple<T> reach_a = reach(pair.half_a, normal_a, depth);
    Triple<T> reach_b = reach(pair.half_b, normal_b, depth);
    p_is_b = (reach_b[0] * reach_b[1]) * reach_b[2] < (reach_a[0] * reach_a[1]) * reach_a[2];
    Triple<T> half_p = select(p_is_b, pair.half_b, pair.half_a);
    Triple<T> half_q = select(p_is_b, pair.half_a, pair.half_b);
    Triple<T> reach_p = select(p_is_b, reach_b, reach_a);
    Triple<T> reach_q = select(p_is_b, reach_a, reach_b);
    Triple<T> offset = select(p_is_b, -pair.offset_b, pair.offset_a);
    Columns<T> to_q = select<T>(p_is_b, pair.b_in_a, pair.a_in_b);
    Triple<T> z = select(p_is_b, -normal_b, normal_a), z_q = select(p_is_b, -normal_a, normal_b);

    Triple<T> across = uniform(splat<T>(1.0)) - z * z;
    Triple<T> edge = axis_of_largest<T>(reach_p * across);
    T along_z = dot(edge, z);
    axes[0] = (1.0 / sqrt(1.0 - along_z * along_z)) * (edge - along_z * z);
    axes[1] = cross_product<T>(z, axes[0]);
    axes[2] = z;
    Triple<T> x_q = to_q * axes[0], axes_q[3] = {x_q, cross_product<T>(z_q, x_q), z_q};
    T centre[3] = {dot(offset, axes[0]), dot(offset, axes[1]), dot(offset, z) - pressed};

    Triple<T> middle_p = towards(axes[2], half_p - reach_p);
    Triple<T> middle_q = -towards(axes_q[2], half_q - reach_q);
    for (int i = 0; i < 3; ++i) {
      Triple<T> width_p = i < 2 ? reach_p : half_p, width_q = i < 2 ? reach_q : half_q;
      T from_p = i < 2 ? dot(middle_p, axes[i]) : T{}, reach_of_p = dot(width_p, abs(axes[i]));
      T from_q = i < 2 ? centre[i] + dot(middle_q, axes_q[i]) : centre[i];
      T reach_of_q = dot(width_q, abs(axes_q[i]));
      T low = max(from_p - reach_of_p, from_q - reach_of_q);
      T high = min<T>(from_p + reach_of_p, from_q + reach_of_q);
      middle[i] = 0.5 * (low + high);
      half[i] = max(0.5 * (high - low), least_extent * pair.size);
    }
    T from_centre[3];
    for (int i = 0; i < 3; ++i) from_centre[i] = middle[i] - centre[i];
    Slabs slabs[2] = {Slabs(axes, half_p, middle, half), Slabs(axes_q, half_q, from_centre, half)};
    tighten(slabs, pair.size);
  }

 private:
  // Half of what a box has within the depth, along its axes [m].
  BC_INLINE static Triple<T> reach(const Triple<T>& half, const Triple<T>& normal, T depth) {
    Triple<F> one = uniform(splat<F>(1.0F)), least = uniform(splat<F>(least_component));
    Triple<F> by_slope = one / max(abs(triple_to_floats<T>(normal)), least);
    return min(half, (half_of_rounding * depth) * triple_to_doubles<T>(by_slope));
  }
  BC_INLINE static Triple<T> towards(const Triple<T>& direction, const Triple<T>& x) {
    return choose(direction >= Triple<T>{}, x, -x);
  }

  // A slab of a box along its own axes, in metres: −minus ≤ Σ a_i u_i ≤ plus.
  struct Slabs {
    Triple<T> a[3], plus, minus;

    BC_INLINE Slabs(const Triple<T> (&along)[3], const Triple<T>& box_half, const T (&from)[3],
                    const T (&half)[3]) {
      Triple<T> at{};
      for (int i = 0; i < 3; ++i) {
        at = at + from[i] * along[i];
        a[i] = half[i] * along[i];
      }
      plus = box_half - at;
      minus = box_half + at;
    }
    // How far the bounds of coordinate i may reach up and down.
    BC_INLINE void bound(int i, T least, T& up, T& down) const {
      Triple<T> rest = abs(a[(i + 1) % 3]) + abs(a[(i + 2) % 3]);
      Triple<T> width = max(abs(a[i]), uniform(least)), others = rotated(width);
      Triple<T> beside = others * rotated_back(width);
      Triple<T> by_width = (1.0 / (width[0] * beside[0])) * beside;  // three by one division
      auto forwards = a[i] >= Triple<T>{};
      Triple<T> above = by_width * (rest + choose(forwards, plus, minus));
      Triple<T> below = by_width * (rest + choose(forwards, minus, plus));
      up = min<T>(up, -largest(-above));
      down = min<T>(down, -largest(-below));
    }
  };

  // Move the bounds of y, then those of x, to where slabs end. Move the slabs into the coordinates of
  // the new bounds. Faces of P that meet in the edge along x bound y, whatever x is.
  BC_INLINE void tighten(Slabs (&slabs)[2], T size) {
    for (int i = 1; i >= 0; --i) {
      T up = splat<T>(1.0), down = up;
      for (const Slabs& of_box : slabs) of_box.bound(i, least_share * size, up, down);
      // Boxes that touch along several axes may have no overlap at all: no bound leaves the others.
      up = max(up, splat<T>(-1.0));
      down = max(down, splat<T>(-1.0));
      T shift = 0.5 * (up - down), least_scale = least_extent * size / half[i];
      T scale = max(0.5 * (up + down), least_scale);
      middle[i] = middle[i] + half[i] * shift;
      half[i] = half[i] * scale;
      for (Slabs& of_box : slabs) {
        Triple<T> moved = shift * of_box.a[i];
        of_box.plus = of_box.plus - moved;
        of_box.minus = of_box.minus + moved;
        of_box.a[i] = scale * of_box.a[i];
      }
    }
    T by_size = 1.0 / size;
    for (int box = 0; box < 2; ++box) narrow(box, slabs[box], by_size);
  }

  // The slabs of a box without a unit, in float32.
  BC_INLINE void narrow(int box, const Slabs& slabs, T by_size) {
    Triple<F> width{}, most = uniform(splat<F>(beyond));
    for (int i = 0; i < 3; ++i) {
      share[box][i] = triple_to_floats<T>(by_size * slabs.a[i]);
      width = width + abs(share[box][i]);
    }
    Triple<F> by_width = uniform(splat<F>(1.0F)) / width;
    for (int i = 0; i < 3; ++i) share[box][i] = by_width * share[box][i];
    auto scaled = [&](const Triple<T>& x) {
      return min(by_width * triple_to_floats<T>(by_size * x + splat<T>(place_slack)), most);
    };
    plus[box] = scaled(slabs.plus);
    minus[box] = scaled(slabs.minus);
  }
};

}  // namespace mlp
}  // namespace box_contact::BOX_CONTACT_SET
