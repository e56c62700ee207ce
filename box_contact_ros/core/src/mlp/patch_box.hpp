// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The patch box: a cuboid around A∩B in which every overlap looks alike, whatever the sizes and the
// depth are; and the cuts, what the half-spaces of both boxes take off it.
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
// places are measured from an origin near the patch, which float64 finds in both boxes' frames.
#pragma once

#include "../minimum_depth.hpp"
#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET::mlp {

// Least component of a unit vector, and what is divided by; the product of three is a float.
constexpr float least_component = 1e-12F;
// Component of the normal below which either end of a box is as deep as the other, to a thousandth of
// the least depth.
constexpr double level = 1e-12;

template <class F>
BC_INLINE Triple<F> cross_product(const Triple<F>& a, const Triple<F>& b) {
  return rotated(a) * rotated_back(b) - rotated_back(a) * rotated(b);
}
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

// The place of the largest of three numbers.
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

// Where two boxes meet, in float64 and in A's frame.
template <class T>
struct Meeting {
  Triple<T> normal, normal_b;  // from A to B, in the frame of either box
  Triple<T> corner, corner_b;  // of A, deepest in B, from A's centre; of B in A, in B's frame [m]
  Triple<T> gap;               // from there to the corner of B that is deepest in A [m]
  T depth, least;              // of the boxes, pressed to the least where they hardly overlap [m]
  T unit, by_unit;             // about the size [m], and its inverse

  Meeting() = default;
  BC_INLINE explicit Meeting(const Query<T>& query) {
    const Pair<T>& pair = query.pair;
    least = depth_floor * pair.size;
    T pressed = max(least + query.axis.separation, T{});
    normal = query.axis.normal;
    normal_b = pair.a_in_b * normal;
    corner = towards(normal, pair.offset_a, pair.half_a);
    corner_b = -towards(normal_b, pair.offset_b, pair.half_b);
    gap = pair.offset_a + pair.b_in_a * corner_b - corner - pressed * normal;
    depth = max(-query.axis.separation, least);
    unit = power_of_two(pair.size, false);
    by_unit = power_of_two(pair.size, true);
  }

 private:
  // Along axes that are level, towards the other box.
  BC_INLINE static Triple<T> towards(const Triple<T>& normal, const Triple<T>& other,
                                     const Triple<T>& half) {
    Triple<T> zero{}, way = choose(abs(normal) > uniform(splat<T>(level)), normal, other);
    return choose(way >= zero, half, -half);
  }
};

// The axes of the patch box, and what of either box may be in it. Lengths are in units.
template <class F>
struct Frame {
  Triple<F> in_a[3], in_b[3];  // x, y and z in the frame of either box
  Triple<F> half_a, half_b;    // half extents of the boxes
  Triple<F> reach_a, reach_b;  // half of what a box has within the depth, along its axes
  Flags<F> a_up, b_up;         // directions of A's and of B's axes along the normal
  F depth, least, p_is_b;      // p_is_b: 0 or 1
  Triple<F> along_edge;        // from P's corner along its edge to near Q, in A's frame

  template <class T>
  BC_INLINE Frame(Queries<T> queries, const Meeting<T> (&meetings)[together<T>]) {
    auto length = [&](auto get) {
      return triple_of_floats<T>([&](int n) { return meetings[n].by_unit * get(n); });
    };
    auto normal = [&](auto get) {
      return significant<F>(triple_of_floats<T>(get), least_component);
    };
    Triple<F> normal_a = normal([&](int n) { return meetings[n].normal; });
    Triple<F> normal_b = normal([&](int n) { return meetings[n].normal_b; });
    Triple<F> corner_a = length([&](int n) { return meetings[n].corner; });
    Triple<F> corner_b = length([&](int n) { return meetings[n].corner_b; });
    half_a = abs(corner_a);
    half_b = abs(corner_b);
    a_up = corner_a >= Triple<F>{};
    b_up = -corner_b > Triple<F>{};
    depth = floats<T>([&](int n) { return meetings[n].by_unit * meetings[n].depth; });
    least = floats<T>([&](int n) { return meetings[n].by_unit * meetings[n].least; });
    Triple<F> gap = length([&](int n) { return meetings[n].gap; });
    Columns<F> b_in_a;
    for (int k = 0; k < 3; ++k)
      b_in_a[k] = triple_of_floats<T>([&](int n) { return queries[n]->pair.b_in_a[k]; });
    find(normal_a, normal_b, gap, b_in_a);
  }

 private:
  BC_INLINE Triple<F> reach(const Triple<F>& half, const Triple<F>& normal) {
    Triple<F> steep = max(abs(normal), uniform(splat<F>(least_component)));
    return min(half, (0.5F * depth) * inverses<F>(steep));
  }
  BC_INLINE void find(const Triple<F>& normal_a, const Triple<F>& normal_b, const Triple<F>& gap,
                      const Columns<F>& b_in_a) {
    Triple<F> zero{}, one = uniform(splat<F>(1.0F));
    reach_a = reach(half_a, normal_a);
    reach_b = reach(half_b, normal_b);
    auto is_b = (reach_b[0] * reach_b[1]) * reach_b[2] < (reach_a[0] * reach_a[1]) * reach_a[2];
    p_is_b = either<F>(is_b, splat<F>(1.0F), F{});
    Triple<F> across_a = reach_a * (one - normal_a * normal_a);
    Triple<F> across_b = reach_b * (one - normal_b * normal_b);
    Triple<F> across_p = select(is_b, across_b, across_a),
              across_q = select(is_b, across_a, across_b);
    LargestOf<F> edge(across_p);
    Triple<F> normal_p = select(is_b, normal_b, normal_a);
    F along = edge.of(normal_p);
    F by = 1.0F / sqrt(max(1.0F - along * along, splat<F>(least_component)));
    Triple<F> edge_p = edge.axis();
    auto other = [&](const Columns<F>& axes) {
      return significant<F>(edge.column(axes), least_component);
    };
    Triple<F> edge_a = select(is_b, other(b_in_a), edge_p);
    Triple<F> edge_b = select(is_b, edge_p, other(transpose(b_in_a)));
    in_a[2] = normal_a;
    in_b[2] = normal_b;
    in_a[0] = by * (edge_a - along * normal_a);
    in_b[0] = by * (edge_b - along * normal_b);
    in_a[1] = cross_product<F>(in_a[2], in_a[0]);
    in_b[1] = cross_product<F>(in_b[2], in_b[0]);

    // Of two edges that cross, the place on P's that is closest to Q's.
    Triple<F> gap_b = transpose(b_in_a) * gap;
    Triple<F> from_q = select(is_b, gap, -gap_b), edge_q = select(is_b, edge_a, edge_b);
    auto is_edge = across_q >= uniform(largest(across_q));
    Triple<F> across = choose(is_edge, zero, edge_q);
    F place = -dot(across, from_q) / max<F>(dot(across, across), splat<F>(least_component));
    F inwards = edge.of(select(is_b, choose(b_up, one, -one), choose(a_up, -one, one)));
    F farthest = 2.0F * edge.of(select(is_b, reach_b, reach_a));
    place = min<F>(farthest, max<F>(inwards * place, F{}));
    along_edge = (inwards * place) * edge_a;
  }
};

// The origin near the patch, from the corners of both boxes, in float64.
template <class T>
struct Origin {
  Triple<T> from_a, from_b;  // from A's corner in A's frame, and from B's in B's [m]
  T top;                     // of A along the normal, from the origin [m]

  Origin() = default;
  BC_INLINE Origin(const Query<T>& query, const Meeting<T>& meeting, T p_is_b,
                   const Triple<T>& along_edge) {
    from_a = p_is_b * meeting.gap + meeting.unit * along_edge;
    from_b = query.pair.a_in_b * (from_a - meeting.gap);
    top = -dot(meeting.normal, from_a);
  }
};

// Half-spaces of a box: −minus ≤ Σ share_i u_i ≤ plus for u from −1 to 1, one slab for each axis of the
// box. `plus` is the side of the corner that is deepest in the other box. Lengths are in units.
template <class F>
struct Slabs {
  Triple<F> share[3], plus, minus;

  Slabs() = default;
  // corner: from the origin, in the box's frame.
  BC_INLINE Slabs(const Triple<F> (&axes)[3], const Flags<F>& up, bool is_a, const Triple<F>& half,
                  const Triple<F>& corner) {
    auto towards = [&](const Triple<F>& x) { return is_a ? choose(up, x, -x) : choose(up, -x, x); };
    for (int i = 0; i < 3; ++i) share[i] = towards(axes[i]);
    plus = towards(corner);
    minus = 2.0F * half - plus;
  }
  // Go on from a place on axis i.
  BC_INLINE void move(int i, F place) {
    Triple<F> moved = place * share[i];
    plus = plus - moved;
    minus = minus + moved;
  }
  BC_INLINE Slabs moved(int i, F place) const {
    Slabs there = *this;
    there.move(i, place);
    return there;
  }
  // Reduce how far coordinate i may be above and below, where the others have half extents `half`.
  BC_INLINE void bound(int i, const F (&half)[3], F& above, F& below) const {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    Triple<F> rest = half[j] * abs(share[j]) + half[k] * abs(share[k]);
    Triple<F> by_share = inverses<F>(max(abs(share[i]), uniform(splat<F>(least_component))));
    auto forwards = share[i] >= Triple<F>{};
    above = min<F>(above, least_of<F>(by_share * (rest + choose(forwards, plus, minus))));
    below = min<F>(below, least_of<F>(by_share * (rest + choose(forwards, minus, plus))));
  }
  // Grow on both sides along axis i.
  BC_INLINE void grow(int i, F more) {
    Triple<F> grown = more * abs(share[i]);
    plus = plus + grown;
    minus = minus + grown;
  }
};

template <class F>
struct PatchBox {
  F centre[3], half[3];  // along x, y and z, from the origin [unit]
  Slabs<F> a, b;

  // from_a, from_b, top: of `Origin`.
  BC_INLINE PatchBox(const Frame<F>& frame, const Triple<F>& from_a, const Triple<F>& from_b, F top)
      : a(frame.in_a, frame.a_up, true, frame.half_a, -from_a),
        b(frame.in_b, frame.b_up, false, frame.half_b, -from_b) {
    // Beyond the far end of a box that is less thick than the depth there is no overlap.
    auto beyond = [&](const Triple<F>& box_half, const Triple<F>& normal) {
      return max<F>(frame.depth - 2.0F * dot(box_half, abs(normal)), F{});
    };
    F above_b = beyond(frame.half_b, frame.in_b[2]), below_a = beyond(frame.half_a, frame.in_a[2]);
    F half_depth = 0.5F * max<F>((frame.depth - above_b) - below_a, frame.least);
    Triple<F> into_a = choose(frame.a_up, -frame.reach_a, frame.reach_a) - from_a;
    Triple<F> into_b = choose(frame.b_up, frame.reach_b, -frame.reach_b) - from_b;
    for (int i = 0; i < 2; ++i) {
      F at_a = dot(into_a, frame.in_a[i]), reach_a = dot(frame.reach_a, abs(frame.in_a[i]));
      F at_b = dot(into_b, frame.in_b[i]), reach_b = dot(frame.reach_b, abs(frame.in_b[i]));
      F low = max<F>(at_a - reach_a, at_b - reach_b), high = min<F>(at_a + reach_a, at_b + reach_b);
      centre[i] = 0.5F * (low + high);
      half[i] = max<F>(0.5F * (high - low), frame.least);
    }
    centre[2] = (top - above_b) - half_depth;
    half[2] = half_depth;
    for (Slabs<F>* slabs : {&a, &b}) slabs->move(2, centre[2]), slabs->move(1, centre[1]);
    // Faces of P that meet in the edge along x bound y, whatever x is.
    F above = half[1], below = above;
    bound(1, a.moved(0, centre[0]), b.moved(0, centre[0]), frame.least, above, below);
    F shift = 0.5F * (above - below);
    centre[1] = centre[1] + shift;
    half[1] = 0.5F * max<F>(above + below, frame.least);
    for (Slabs<F>* slabs : {&a, &b}) slabs->move(1, shift);
    // x from the origin: edges that cross meet there, and the middle of the edges may be far.
    above = half[0] + centre[0], below = half[0] - centre[0];
    bound(0, a, b, frame.least, above, below);
    centre[0] = 0.5F * (above - below);
    half[0] = 0.5F * max<F>(above + below, frame.least);
    for (Slabs<F>* slabs : {&a, &b}) {
      slabs->move(0, centre[0]);
      for (int i = 0; i < 3; ++i) slabs->share[i] = half[i] * slabs->share[i];
    }
  }

 private:
  // Reduce how far coordinate i may be above and below. Boxes that touch along several axes have no
  // overlap: B grows as far as the overlap lacks of the least width.
  BC_INLINE void bound(int i, const Slabs<F>& of_a, const Slabs<F>& of_b, F least, F& above,
                       F& below) {
    F above_b = above, below_b = below, least_above = -below, least_below = -above;
    of_a.bound(i, half, above, below);
    of_b.bound(i, half, above_b, below_b);
    above = max<F>(above, least_above), above_b = max<F>(above_b, least_above);
    below = max<F>(below, least_below), below_b = max<F>(below_b, least_below);
    F lacking = max<F>(least - (min<F>(above, above_b) + min<F>(below, below_b)), F{});
    b.grow(i, lacking);
    above = min<F>(above, above_b + lacking);
    below = min<F>(below, below_b + lacking);
  }
};

// What the half-spaces of both boxes cut off the patch box, as its network reads it.
//
// A half-space cuts the box [−1, 1]³ to a depth c along a, with Σ|a_i| = 1. Per slab there are two,
// c⁺ and c⁻. The features, of all six slabs of both boxes alike:
//
//   0–2: Σ (c⁺ − c⁻) a       3, 4: Σ c, Σ c²       5–7, 8–10: Σ of (c⁺ − c⁻)² a aᵀ, xx yy zz, xy xz yz
//   11–18: how deep the corners of the box are cut off, +++ ++− +−+ +−− −++ −+− −−+ −−−
//
// Axes are mirrored so that 0–2 are not above 0.
constexpr int features = 19;
// A smaller share [1] of the sum of three counts as none: the digits of float32 end before it.
constexpr float least_share = 1e-8F;

template <class F>
struct Cuts {
  F flip[3], told[up_to_fours(features)];

  BC_INLINE explicit Cuts(const PatchBox<F>& box) {
    for (F& number : told) number = F{};
    Slabs<F> slabs[2] = {box.a, box.b};
    Triple<F> one = uniform(splat<F>(1.0F)), whole = uniform(splat<F>(2.0F)), zero{};
    Triple<F> depth[2], pull[2][3];
    for (int n = 0; n < 2; ++n) {
      Triple<F>(&share)[3] = slabs[n].share;
      Triple<F> scale = inverses<F>((abs(share[0]) + abs(share[1])) + abs(share[2]));
      for (int i = 0; i < 3; ++i) share[i] = significant<F>(scale * share[i], least_share);
      slabs[n].plus = scale * slabs[n].plus;
      slabs[n].minus = scale * slabs[n].minus;
      auto cut = [&](const Triple<F>& side) { return min(whole, max(one - side, zero)); };
      Triple<F> above = cut(slabs[n].plus), below = cut(slabs[n].minus);
      depth[n] = above + below;
      for (int i = 0; i < 3; ++i) pull[n][i] = (above - below) * share[i];
    }
    auto add = [](const Triple<F>& x, const Triple<F>& y) { return sum(x + y); };
    auto add_products = [&](int i, int j) {
      return add(pull[0][i] * pull[0][j], pull[1][i] * pull[1][j]);
    };
    for (int i = 0; i < 3; ++i) {
      F all = add(pull[0][i], pull[1][i]);
      flip[i] = either<F>(all > F{}, splat<F>(-1.0F), splat<F>(1.0F));
      told[i] = flip[i] * all;
      told[5 + i] = add_products(i, i);
    }
    told[3] = add(depth[0], depth[1]);
    told[4] = add(depth[0] * depth[0], depth[1] * depth[1]);
    told[8] = flip[0] * flip[1] * add_products(0, 1);
    told[9] = flip[0] * flip[2] * add_products(0, 2);
    told[10] = flip[1] * flip[2] * add_products(1, 2);
    for (const Slabs<F>& of_box : slabs) {
      Triple<F> a[3];
      for (int i = 0; i < 3; ++i) a[i] = flip[i] * of_box.share[i];
      Triple<F> along = a[0] + a[1], against = a[0] - a[1];
      Triple<F> corners[4] = {along + a[2], along - a[2], against + a[2], against - a[2]};
      for (int i = 0; i < 4; ++i) {
        Triple<F> here = max(corners[i] - of_box.plus, -corners[i] - of_box.minus);
        Triple<F> there = max(-corners[i] - of_box.plus, corners[i] - of_box.minus);
        told[11 + i] = max(told[11 + i], largest(here));
        told[18 - i] = max(told[18 - i], largest(there));
      }
    }
    for (int i = 11; i < features; ++i) told[i] = min(told[i], splat<F>(2.0F));
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::mlp
