// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The patch box: a cuboid around A∩B in which every overlap looks alike, whatever the sizes and the
// depth are.
//
// Its z axis is SAT's normal, so faces and pairs of edges are described alike. P is the box that has
// less within the depth, Q the other. The x axis is along the edge of P that has most of it across z.
// The bounds hold A∩B:
//
// 1. Along z they are the ends of the two boxes on the axis. The ends in each other are `depth` apart.
// 2. What A has beyond the lowest point of B reaches at most depth / |n_k| along A's axis k, from the
//    corner of A that is deepest in B. The same holds for B. These two cuboids bound x and y.
// 3. Each of the six slabs of both boxes then bounds y, and then x, by the bounds of the other two
//    (Benhamou and others 1999, hull consistency).
//
// All of it is float32, in a unit of about the size. So that boxes that just touch keep their digits,
// coordinates are measured from an origin near the patch, which float64 finds in both boxes' frames.
#pragma once

#include "../minimum_depth.hpp"
#include "../query.hpp"

namespace box_contact::BOX_CONTACT_SET::mlp {

// Least component of a unit vector, and what is divided by; the product of three is a float.
constexpr float least_component = 1e-12F;
// Component of the normal below which either end of a box is as deep as the other, to a thousandth of
// the least depth.
constexpr double level = 1e-12;

// The inverses of three numbers by one division.
template <class F>
BC_INLINE Triple<F> inverses(const Triple<F>& x) {
  Triple<F> beside = rotated(x) * rotated_back(x);
  return (1.0F / (x[0] * beside[0])) * beside;
}
// Numbers below `least` become 0. Products of what rounding leaves of zeros would be denormal numbers,
// which take a hundred times as long.
template <class F>
BC_INLINE Triple<F> significant(const Triple<F>& x, float least) {
  return choose(abs(x) >= uniform(splat<F>(least)), x, Triple<F>{});
}
template <class F>
BC_INLINE F least_of(const Triple<F>& x) {
  return min<F>(min<F>(x[0], x[1]), x[2]);
}

// Which is the largest of three numbers.
template <class F>
struct LargestOf {
  Mask<F> first, second;

  BC_INLINE explicit LargestOf(const Triple<F>& x)
      : first(x[0] >= max<F>(x[1], x[2])), second(x[1] >= x[2]) {}
  BC_INLINE F of(const Triple<F>& x) const {
    return either<F>(first, x[0], either<F>(second, x[1], x[2]));
  }
  BC_INLINE Triple<F> column(const Columns<F>& m) const {
    return select(first, m[0], select(second, m[1], m[2]));
  }
  BC_INLINE Triple<F> axis() const {
    F one = splat<F>(1.0F), not_first = either<F>(first, F{}, one);
    F is_second = either<F>(second, not_first, F{});
    return triple(Vec<F>{one - not_first, is_second, not_first - is_second});
  }
};

// A power of two that is up to twice below x, or its inverse: nothing is rounded in such a unit.
template <class T>
BC_INLINE T power_of_two(T x, bool inverse) {
  using Bits = std::conditional_t<is_scalar<T>, int64_t, Mask<T>>;
  constexpr int64_t exponent = 0x7ff0000000000000, of_product = 0x7fe0000000000000;
  Bits bits;
  std::memcpy(&bits, &x, sizeof x);
  bits = bits & exponent;
  if (inverse) bits = of_product - bits;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

// Where two boxes meet, in float64. Of A is at 0, of B at 1, each in the frame of its box.
template <class T>
struct Meeting {
  Triple<T> normal[2];     // from A to B
  Triple<T> corner[2];     // deepest in the other box, from the box's centre [m]
  Triple<T> gap;           // from A's corner to B's, in A's frame [m]
  T depth, least;          // of the boxes, pressed in where they are at exact touch [m]
  T unit, by_unit;         // about the size [m], and its inverse
  Triple<T> to_origin[2];  // near the patch, from the corners [m]
  T top;                   // of A along the normal, from the origin [m]

  Meeting() = default;
  BC_INLINE explicit Meeting(const Query<T>& query) {
    const Pair<T>& pair = query.pair;
    least = depth_floor * pair.size;
    normal[0] = query.axis.normal;
    normal[1] = pair.a_in_b * normal[0];
    corner[0] = towards(normal[0], pair.offset_a, pair.half_a);
    corner[1] = -towards(normal[1], pair.offset_b, pair.half_b);
    gap = pressed_offset(query) + pair.b_in_a * corner[1] - corner[0];
    depth = max(-query.axis.separation, least);
    unit = power_of_two(pair.size, false);
    by_unit = power_of_two(pair.size, true);
  }
  // Put the origin at P's corner, or along its edge from there [unit, A's frame].
  BC_INLINE void place_origin(const Query<T>& query, T p_is_b, const Triple<T>& along_edge) {
    to_origin[0] = p_is_b * gap + unit * along_edge;
    to_origin[1] = query.pair.a_in_b * (to_origin[0] - gap);
    top = -dot(normal[0], to_origin[0]);
  }

 private:
  // From A to B, pressed in where they are at exact touch.
  BC_INLINE static Triple<T> pressed_offset(const Query<T>& query) {
    Mask<T> shallow = are_shallow(query.pair, query.axis) & query.touching;
    if (!any(shallow)) return query.pair.offset_a;
    Pair<T> pair = query.pair;
    enforce_minimum_depth(pair, query.axis, shallow);
    return pair.offset_a;
  }
  // Along axes that are level, towards the other box.
  BC_INLINE static Triple<T> towards(const Triple<T>& normal, const Triple<T>& other,
                                     const Triple<T>& half) {
    Triple<T> zero{}, way = choose(abs(normal) > uniform(splat<T>(level)), normal, other);
    return choose(way >= zero, half, -half);
  }
};

// A box as its patch box meets it, in its own frame. Lengths are in units.
template <class F>
struct Side {
  Triple<F> axes[3];  // x, y and z of the patch box
  Triple<F> corner;   // deepest in the other box, from the centre: plus or minus the half extents
  Triple<F> reach;    // half of what is within the depth, along the box's axes
  // Its half-spaces, a slab for each of its axes: −minus ≤ Σ slope_i u_i ≤ plus, u from −1 to 1. `plus`
  // is the side of the corner.
  Triple<F> slope[3], plus, minus;

  // Numbers along the box's axes, counted towards the corner.
  BC_INLINE Triple<F> outwards(const Triple<F>& x) const {
    return choose(corner >= Triple<F>{}, x, -x);
  }
  BC_INLINE F reach_volume() const { return (reach[0] * reach[1]) * reach[2]; }
  // How far what is within the depth runs across the normal, for each axis.
  BC_INLINE Triple<F> across() const {
    return reach * (uniform(splat<F>(1.0F)) - axes[2] * axes[2]);
  }
  // Slabs about the origin. to_origin: from the corner.
  BC_INLINE void find_slabs(const Triple<F>& to_origin) {
    for (int i = 0; i < 3; ++i) slope[i] = outwards(axes[i]);
    plus = outwards(-to_origin);
    minus = 2.0F * abs(corner) - plus;
  }
  // Go on from a coordinate on axis i.
  BC_INLINE void move(int i, F coordinate) {
    Triple<F> moved = coordinate * slope[i];
    plus = plus - moved;
    minus = minus + moved;
  }
  // Grow on both sides along axis i.
  BC_INLINE void grow(int i, F more) {
    Triple<F> grown = more * abs(slope[i]);
    plus = plus + grown;
    minus = minus + grown;
  }
  // Reduce how far coordinate i may be above and below, where the others have half extents `half`.
  BC_INLINE void bound(int i, const F (&half)[3], F& above, F& below) const {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    Triple<F> rest = half[j] * abs(slope[j]) + half[k] * abs(slope[k]);
    Triple<F> by_slope = inverses<F>(max(abs(slope[i]), uniform(splat<F>(least_component))));
    auto forwards = slope[i] >= Triple<F>{};
    above = min<F>(above, least_of<F>(by_slope * (rest + choose(forwards, plus, minus))));
    below = min<F>(below, least_of<F>(by_slope * (rest + choose(forwards, minus, plus))));
  }
};

// The patch box of one pair, or those of two blocks of pairs.
template <class T>
struct PatchBox {
  using F = Floats<T>;
  Queries<T> queries;
  Meeting<T> meetings[blocks_together<T>];
  Side<F> a, b;
  F centre[3], half[3];  // along x, y and z, from the origin [unit]

  BC_INLINE explicit PatchBox(Queries<T> of) : queries(of) {
    for (int n = 0; n < blocks_together<T>; ++n) meetings[n] = Meeting<T>(*queries[n]);
    depth = length([](const auto& meeting) { return meeting.depth; });
    least = length([](const auto& meeting) { return meeting.least; });
    for (int s = 0; s < 2; ++s) {
      Side<F>& side = s ? b : a;
      side.axes[2] = significant<F>(
          triple_of_floats<T>([&](int n) { return meetings[n].normal[s]; }), least_component);
      side.corner = vector([s](const auto& meeting) { return meeting.corner[s]; });
      Triple<F> steep = max(abs(side.axes[2]), uniform(splat<F>(least_component)));
      side.reach = min(abs(side.corner), (0.5F * depth) * inverses<F>(steep));
    }
    find_axes_and_origin();
    bound_by_reach();
    bound_by_slabs();
    for (int i = 0; i < 3; ++i)
      a.slope[i] = half[i] * a.slope[i], b.slope[i] = half[i] * b.slope[i];
  }

  // A point in A's frame, from its coordinates along x, y and z about the origin [unit].
  BC_INLINE Triple<T> point(const F (&from_origin)[3], int block) const {
    const Meeting<T>& meeting = meetings[block];
    Triple<F> beside = from_origin[0] * a.axes[0] + from_origin[1] * a.axes[1];
    // Axes of float32 are not at right angles to the last digit: z comes from the normal.
    Triple<T> across = triple_of_doubles<T>(beside, block), normal = meeting.normal[0];
    T along = doubles<T>(from_origin[2], block) - dot(across, normal);
    return (meeting.corner[0] + meeting.to_origin[0]) + meeting.unit * (across + along * normal);
  }

 private:
  F depth, least;  // [unit]

  // What all meetings have, in units.
  template <class Of>
  BC_INLINE F length(const Of& of) const {
    return floats<T>([&](int n) { return meetings[n].by_unit * of(meetings[n]); });
  }
  template <class Of>
  BC_INLINE Triple<F> vector(const Of& of) const {
    return triple_of_floats<T>([&](int n) { return meetings[n].by_unit * of(meetings[n]); });
  }

  BC_INLINE void find_axes_and_origin() {
    auto is_b = b.reach_volume() < a.reach_volume();
    Triple<F> across_a = a.across(), across_b = b.across();
    Triple<F> across_q = select(is_b, across_a, across_b);
    LargestOf<F> edge(select(is_b, across_b, across_a));
    F along = edge.of(select(is_b, b.axes[2], a.axes[2]));
    F by = 1.0F / sqrt(max(1.0F - along * along, splat<F>(least_component)));
    Columns<F> b_in_a;
    for (int k = 0; k < 3; ++k)
      b_in_a[k] = triple_of_floats<T>([&](int n) { return queries[n]->pair.b_in_a[k]; });
    Columns<F> a_in_b = transpose(b_in_a);
    auto seen = [&](const Columns<F>& axes) {
      return significant<F>(edge.column(axes), least_component);
    };
    Triple<F> edge_a = select(is_b, seen(b_in_a), edge.axis());
    Triple<F> edge_b = select(is_b, edge.axis(), seen(a_in_b));
    a.axes[0] = by * (edge_a - along * a.axes[2]);
    b.axes[0] = by * (edge_b - along * b.axes[2]);
    for (Side<F>* side : {&a, &b}) {
      const Triple<F>&x = side->axes[0], &z = side->axes[2];
      side->axes[1] = rotated(z) * rotated_back(x) - rotated_back(z) * rotated(x);
    }

    // Of two edges that cross, the point on P's that is closest to Q's.
    Triple<F> gap = vector([](const auto& meeting) { return meeting.gap; });
    Triple<F> from_q = select(is_b, gap, -(a_in_b * gap)), edge_q = select(is_b, edge_a, edge_b);
    auto is_edge = across_q >= uniform(largest(across_q));
    Triple<F> zero{}, one = uniform(splat<F>(1.0F)), across = choose(is_edge, zero, edge_q);
    F on_edge = -dot(across, from_q) / max<F>(dot(across, across), splat<F>(least_component));
    F inwards = edge.of(select(is_b, b.outwards(-one), a.outwards(-one)));
    F farthest = 2.0F * edge.of(select(is_b, b.reach, a.reach));
    on_edge = min<F>(farthest, max<F>(inwards * on_edge, F{}));
    Triple<F> along_edge = (inwards * on_edge) * edge_a;
    F p_is_b = either<F>(is_b, splat<F>(1.0F), F{});
    for (int n = 0; n < blocks_together<T>; ++n)
      meetings[n].place_origin(*queries[n], doubles<T>(p_is_b, n),
                               triple_of_doubles<T>(along_edge, n));
  }

  // By what is within the depth.
  BC_INLINE void bound_by_reach() {
    Triple<F> to_origin_a = vector([](const auto& meeting) { return meeting.to_origin[0]; });
    Triple<F> to_origin_b = vector([](const auto& meeting) { return meeting.to_origin[1]; });
    a.find_slabs(to_origin_a);
    b.find_slabs(to_origin_b);
    // Beyond the far end of a box that is less thick than the depth there is no overlap.
    auto beyond = [&](const Side<F>& side) {
      return max<F>(depth - 2.0F * dot(abs(side.corner), abs(side.axes[2])), F{});
    };
    F above_b = beyond(b), below_a = beyond(a);
    half[2] = 0.5F * max<F>((depth - above_b) - below_a, least);
    centre[2] = (length([](const auto& meeting) { return meeting.top; }) - above_b) - half[2];
    auto middle_of = [](const Side<F>& side, const Triple<F>& to_origin) {
      return side.outwards(-side.reach) - to_origin;
    };
    Triple<F> middle_a = middle_of(a, to_origin_a), middle_b = middle_of(b, to_origin_b);
    for (int i = 0; i < 2; ++i) {
      F at_a = dot(middle_a, a.axes[i]), reach_a = dot(a.reach, abs(a.axes[i]));
      F at_b = dot(middle_b, b.axes[i]), reach_b = dot(b.reach, abs(b.axes[i]));
      F low = max<F>(at_a - reach_a, at_b - reach_b), high = min<F>(at_a + reach_a, at_b + reach_b);
      centre[i] = 0.5F * (low + high);
      half[i] = max<F>(0.5F * (high - low), least);
    }
  }

  BC_INLINE void bound_by_slabs() {
    move(2, centre[2]);
    move(1, centre[1]);
    // Faces of P that meet in the edge along x bound y, whatever x is.
    Side<F> there_a = a, there_b = b;
    there_a.move(0, centre[0]);
    there_b.move(0, centre[0]);
    F above = half[1], below = above;
    bound(1, there_a, there_b, above, below);
    F shift = 0.5F * (above - below);
    centre[1] = centre[1] + shift;
    move(1, shift);
    // x from the origin: edges that cross meet there, and the middle of the edges may be far.
    above = half[0] + centre[0], below = half[0] - centre[0];
    bound(0, a, b, above, below);
    centre[0] = 0.5F * (above - below);
    move(0, centre[0]);
  }
  BC_INLINE void move(int i, F coordinate) {
    a.move(i, coordinate);
    b.move(i, coordinate);
  }
  // Reduce how far coordinate i may be above and below. Boxes that touch along several axes have no
  // overlap: B grows as far as the overlap lacks of the least width.
  BC_INLINE void bound(int i, const Side<F>& of_a, const Side<F>& of_b, F& above, F& below) {
    F above_b = above, below_b = below, least_above = -below, least_below = -above;
    of_a.bound(i, half, above, below);
    of_b.bound(i, half, above_b, below_b);
    above = max<F>(above, least_above), above_b = max<F>(above_b, least_above);
    below = max<F>(below, least_below), below_b = max<F>(below_b, least_below);
    F lacking = max<F>(least - (min<F>(above, above_b) + min<F>(below, below_b)), F{});
    b.grow(i, lacking);
    above = min<F>(above, above_b + lacking);
    below = min<F>(below, below_b + lacking);
    half[i] = 0.5F * max<F>(above + below, least);
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::mlp
