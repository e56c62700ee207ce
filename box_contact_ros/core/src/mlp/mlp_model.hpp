// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `mlp`: SAT, columns under the contact face, and a network between proven brackets.
//
// SAT decides, and gives normal and separation. In the contact frame (columns/contact_frame.hpp)
//
//   A∩B = L − U_0 − U_1 − U_2.
//
// L are the columns between the reference face and the lower faces of the incident box Q, whose
// moments are exact but for float32 (columns/column_moments.hpp). U_k is what the upper face k cuts
// off them. Its volume without P's side faces has a closed form, and P's side faces leave a share of
// it, between brackets that meet where they miss the body (columns/upper_faces.hpp). The network says
// where in between. Volume, point and covariance are those of one body: L less two points of mass for
// each U_k.
//
// Guarantees, whatever the weights are, for pairs that are not left to `exact`:
//
// 1. The volume is within `bracket_limit` of the true one, plus rounding: the brackets hold the truth,
//    and are that close.
// 2. The volume is positive, the covariance is positive definite. L is convex, so any point p of it
//    has (p − c)ᵀ C⁻¹ (p − c) ≤ 15 about its centroid c and covariance C (Kannan, Lovász and
//    Simonovits 1995). A share ε of its mass taken from such points leaves at least
//    (1 − 15 ε − 15 ε² / (1 − ε)) C > 0.2 C for ε ≤ `upper_limit`. Points that are moved between P's
//    side faces may leave L, so the determinant is tested as well.
// 3. The point is in both boxes. In exact arithmetic the centroid of L is: less than 1/e of L is
//    beyond any face (Grünbaum 1960). A test in float64 covers the rest.
//
// Whoever fails a test is left to `exact`, and counted: brackets too far apart, a far side, rounding, a
// needle, a touch along several axes at once. The test of rounding compares sums with the sums of
// magnitudes, and means with deviations.
#pragma once

#include "../columns/upper_faces.hpp"
#include "../overlap/exact.hpp"
#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET {

// How far apart the brackets may be [of the volume], and their second moments [of those of L].
constexpr float bracket_limit = 0.0095F, spread_limit = 0.05F;
// How much all upper faces may cut off [of the volume].
constexpr float upper_limit = 0.05F;
// Upper faces that cut off less than this [of the volume] are not looked at.
constexpr float upper_least = 1e-6F;
// Rounding of the covariance [of 2⁻²⁴]: sums of magnitudes by sums, times squared means by variances.
constexpr float rounding_limit = 3000.0F;
// Least determinant of the correlations of t_k: the rounding above moves it by less.
constexpr float least_determinant = 2e-3F;
// Second largest variance of t_k [of the largest]: float32 resolves no narrower needles.
constexpr float least_width2 = 1e-12F;
// Less than this [of the depth], along an edge of Q or of a side of P, is nothing. Squares of such
// numbers underflow, which takes a hundred times as long. Boxes that stand squarely have many.
constexpr float nothing = 0x1p-24F;
// How near an end of Q's edges may be to an edge of the contact face, in both coordinates [of them].
constexpr float coincidence = 1e-6F;

namespace mlp {

// The contact frame of a group of pairs in float32, and what leads back.
template <class T, int count>
struct Described {
  ContactFrame<T> frames[count];
  T unit[count], depth[count];  // [m]
  ColumnFrame<Narrow<T>> columns;

  BC_INLINE explicit Described(const Query<T> (&queries)[count]) {
    T by_unit[count], height[count];
    for (int g = 0; g < count; ++g) {
      const Pair<T>& pair = queries[g].pair;
      frames[g] = contact_frame_of(pair, queries[g].axis);
      T deep = max(-queries[g].axis.separation, depth_floor * pair.size);
      unit[g] = power_of_two_near_root(pair.size * deep);
      by_unit[g] = reciprocal_of_power(unit[g]);
      depth[g] = max(frames[g].depth, 1e-6 * deep);
      height[g] = depth[g] * by_unit[g];
    }
    using Frame = ContactFrame<T>;
    using Narrow = box_contact::BOX_CONTACT_SET::Narrow<T>;
    auto narrowed = [&](auto of) {
      T parts[count];
      for (int g = 0; g < count; ++g) parts[g] = of(frames[g], g);
      return narrow<T>(parts);
    };
    auto narrowed_triple = [&](auto of) {
      Triple<T> parts[count];
      for (int g = 0; g < count; ++g) parts[g] = of(frames[g], g);
      return narrow_triple<T>(parts);
    };
    columns.height = narrow<T>(height);
    columns.rise = 1.0F / columns.height;
    Triple<Narrow> whole =
        narrowed_triple([&](const Frame& f, int g) { return by_unit[g] * f.half; });
    Triple<Narrow> least = uniform(nothing * columns.height);
    auto noticed = [&](auto of) {
      return each(
          [](auto q, auto whole, auto least) {
            return select<decltype(q)>(abs(q) * whole > least, q, decltype(q){});
          },
          narrowed_triple(of), whole, least);
    };
    columns.qx = noticed([](const Frame& f, int) { return f.qx; });
    columns.qy = noticed([](const Frame& f, int) { return f.qy; });
    Triple<Narrow> qz = noticed([](const Frame& f, int) { return f.qz; });
    columns.qz = columns.rise * qz;
    columns.lift = columns.height * qz;
    columns.length = narrowed_triple([&](const Frame& f, int g) { return by_unit[g] * f.length; });
    columns.jacobian = each(
        [](auto start, auto qz) {
          using N = decltype(qz);
          return select<N>(start > 0.0F, N{}, qz);
        },
        narrowed_triple([&](const Frame& f, int g) { return by_unit[g] * f.start; }), qz);
    auto side = [&](auto of) {
      Narrow at = narrowed(of);
      return select<Narrow>(abs(at) > nothing * columns.height, at, Narrow{});
    };
    columns.low_x = side([&](const Frame& f, int g) { return (-f.half_x - f.x) * by_unit[g]; });
    columns.high_x = side([&](const Frame& f, int g) { return (f.half_x - f.x) * by_unit[g]; });
    columns.low_y = side([&](const Frame& f, int g) { return (-f.half_y - f.y) * by_unit[g]; });
    columns.high_y = side([&](const Frame& f, int g) { return (f.half_y - f.y) * by_unit[g]; });
  }

  // The centroid of block g in Q's frame, from Q's centre [m].
  BC_INLINE Triple<T> in_incident(const Triple<Narrow<T>>& mean, int g) const {
    const ContactFrame<T>& frame = frames[g];
    return frame.sign * ((frame.start + unit[g] * widen_triple<T>(mean, g)) - frame.half);
  }
  // Its covariance there [m²].
  BC_INLINE Sym<T> in_incident(const ColumnMoments<Narrow<T>>& moments, int g) const {
    const Triple<T>& sign = frames[g].sign;
    T unit2 = unit[g] * unit[g];
    Triple<T> variance = unit2 * widen_triple<T>(moments.variance, g);
    Triple<T> beside =
        (rotated(sign) * rotated_back(sign)) * (unit2 * widen_triple<T>(moments.beside, g));
    return {{variance[0], variance[1], variance[2], beside[0], beside[1], beside[2]}};
  }
  BC_INLINE T volume(const Narrow<T>& v, int g) const {
    return widen<T>(v, g) * ((unit[g] * unit[g]) * depth[g]);
  }
};

// Where an upper face may cut off enough to be looked at: its legs below the water, and an upper bound
// of its volume.
template <class F>
BC_INLINE Mask<F> may_cut(const ColumnFrame<F>& frame, const Triple<F>& by_z, int k, F volume) {
  int j = (k + 1) % 3, l = (k + 2) % 3;
  F depth = max(1.0F - frame.length[k] * frame.qz[k], F{});
  F legs = min<F>(frame.length[j], depth * by_z[j]) * min<F>(frame.length[l], depth * by_z[l]);
  return (frame.lift[k] * frame.rise) * (depth * legs) > upper_least * volume;
}

// Take the upper faces off the columns, where they may cut. Returns where brackets and volume are
// within their limits.
template <class F>
[[gnu::noinline]] Mask<F> take_off(const Network& network, const ColumnFrame<F>& frame,
                                   const Triple<F>& by_z, const Mask<F> (&cuts)[3],
                                   ColumnMoments<F>& moments) {
  F cut_off{}, bracket{}, spread{}, all{};
  Triple<F> first{}, second{}, second_beside{};
#pragma GCC unroll 1
  for (int k = 0; k < 3; ++k) {
    if (!any(cuts[k])) continue;
    UpperFace<F> face = upper_face(frame, by_z, k);
    F whole = select<F>(cuts[k], face.volume, F{}), uncertain = whole * (face.most - face.least);
    F volume = whole * face.least;
    if (any(uncertain > F{})) volume += uncertain * answer(network, face.features);
    all += whole;
    bracket += uncertain;
    cut_off += volume;
    for (int n = 0; n < 2; ++n) {
      Triple<F> from = face.at[n] - moments.mean;
      Triple<F> weighted = (volume * face.carries[n]) * from;
      spread += (uncertain * face.carries[n]) * dot(from, from);
      first = first + weighted;
      second = second + weighted * from;
      second_beside = second_beside + rotated(weighted) * rotated_back(from);
    }
  }
  F volume = moments.volume - cut_off, by_volume = 1.0F / volume;
  Mask<F> within = (bracket <= bracket_limit * volume) & (all <= upper_limit * moments.volume) &
                   (spread <= spread_limit * volume * sum(moments.variance));
  Triple<F> shift = by_volume * first;
  moments.variance = by_volume * (moments.volume * moments.variance - second) - shift * shift;
  moments.beside = by_volume * (moments.volume * moments.beside - second_beside) -
                   rotated(shift) * rotated_back(shift);
  moments.mean = moments.mean - shift;
  moments.volume = volume;
  return within;
}

// Where an end of Q's edges is on an edge of the contact face. The waterline, a far edge and a side
// line may then coincide. Each is to leave their piece to the next, and rounding can close the ring.
template <class F>
BC_INLINE Mask<F> may_lose_a_piece(const ColumnFrame<F>& frame) {
  Mask<F> found{};
  for (int k = 0; k < 3; ++k) {
    F length = frame.length[k], x = length * frame.qx[k], y = length * frame.qy[k];
    Mask<F> in_face = abs(length * frame.qz[k] - 1.0F) <= coincidence;
    if (!any(in_face)) continue;
    auto meets = [](F at, F side) { return abs(at - side) <= coincidence * abs(side); };
    found |= in_face & (meets(x, frame.low_x) | meets(x, frame.high_x) | meets(y, frame.low_y) |
                        meets(y, frame.high_y));
  }
  return found;
}

// Whether float32 was enough for the columns.
template <class F>
BC_INLINE Mask<F> is_accurate(const ColumnFrame<F>& frame, const ColumnMoments<F>& moments) {
  F limit = rounding_limit * moments.volume;
  Mask<F> holds = 2.0F * moments.gross < limit;
  for (int k = 0; k < 3; ++k) {
    F variance = moments.variance[k], mean2 = moments.mean[k] * moments.mean[k];
    holds &= (moments.gross * (variance + mean2) < limit * variance) & (variance > F{});
  }
  const Triple<F>& variance = moments.variance;
  F low = min<F>(variance[0], variance[1]), high = max<F>(variance[0], variance[1]);
  F middle = max(low, min<F>(high, variance[2])), longest = max<F>(high, variance[2]);
  return holds & (middle > least_width2 * longest) & (may_lose_a_piece(frame) == 0);
}

// Whether the covariance is positive definite, with a margin.
template <class F>
BC_INLINE Mask<F> is_definite(const ColumnMoments<F>& moments) {
  Triple<F> by_variance = uniform(splat<F>(1.0F)) / moments.variance;
  Triple<F> ratio = moments.beside * rotated(by_variance);
  Triple<F> squares = ratio * (moments.beside * rotated_back(by_variance));
  F determinant =
      ((1.0F - squares[0]) - (squares[1] + squares[2])) + 2.0F * ((ratio[0] * ratio[1]) * ratio[2]);
  Mask<F> definite = determinant >= least_determinant;
  for (int k = 0; k < 3; ++k) definite &= (squares[k] <= 1.0F) & (moments.variance[k] > F{});
  return definite;
}

// Whether a point of Q's frame is in both boxes, to 2⁻⁴⁶ of the size.
template <class T>
BC_INLINE Mask<T> is_inside(const ContactFrame<T>& frame, const Triple<T>& from_origin, T size) {
  T slack = 0x1p-46 * size;
  T x = frame.x + dot(frame.qx, from_origin), y = frame.y + dot(frame.qy, from_origin);
  T z = dot(frame.qz, from_origin) - frame.depth;
  Mask<T> inside = (abs(x) <= frame.half_x + slack) & (abs(y) <= frame.half_y + slack) &
                   (z <= slack) & (-z <= frame.thickness + slack);
  for (int k = 0; k < 3; ++k)
    inside &=
        (frame.start[k] + from_origin[k] >= -slack) & (from_origin[k] <= frame.length[k] + slack);
  return inside;
}

// Whether the minimum depth along the normal is one along all axes: elsewhere `exact` presses again.
template <class T>
BC_INLINE Mask<T> is_deep_enough(const Query<T>& query) {
  T distance = depth_floor * query.pair.size + query.axis.separation;
  Mask<T> pressed = (distance > 0.0) & query.touching;
  if (any(pressed)) {
    Pair<T> pair = query.pair;
    enforce_minimum_depth(pair, query.axis);
    pressed &= has_too_little_depth(pair);
  }
  return pressed == 0;
}

// 1 where the mask is set, to lead it from float32 to float64.
template <class F>
BC_INLINE F number(Mask<F> mask) {
  return select<F>(mask, splat<F>(1.0F), F{});
}

}  // namespace mlp

// `FoundOf`: Moments, or PointAndVolume.
template <template <class> class FoundOf>
struct MlpModelOf {
  Network network;

  template <class T>
  using Found = FoundOf<T>;
  template <class T>
  static constexpr int group = narrow_group<T>;
  using Rest = ExactModelOf<FoundOf>;
  static constexpr bool leaves_to_exact = true;

  template <class T, int count>
  [[gnu::noinline]] void solve(const Query<T> (&queries)[count], Found<T> (&found)[count],
                               unsigned (&left)[count], Counts&) const {
    using F = Narrow<T>;
    mlp::Described<T, count> pairs(queries);
    ColumnMoments<F> moments = column_moments(pairs.columns);
    Mask<F> answered = mlp::is_accurate(pairs.columns, moments);
    Triple<F> by_z = column_sums::reciprocals(pairs.columns.qz);
    Mask<F> cuts[3], cut{};
    for (int k = 0; k < 3; ++k)
      cut |= cuts[k] = mlp::may_cut(pairs.columns, by_z, k, moments.volume);
    if (any(cut)) {
      ColumnMoments<F> less = moments;
      Mask<F> within = mlp::take_off(network, pairs.columns, by_z, cuts, less);
      answered &= within | (cut == 0);
      moments.volume = select<F>(cut, less.volume, moments.volume);
      moments.mean = select(cut, less.mean, moments.mean);
      moments.variance = select(cut, less.variance, moments.variance);
      moments.beside = select(cut, less.beside, moments.beside);
    }
    answered &= mlp::is_definite(moments);
    F answers = mlp::number<F>(answered);
    for (int g = 0; g < count; ++g) {
      const Pair<T>& pair = queries[g].pair;
      const ContactFrame<T>& frame = pairs.frames[g];
      Mask<T> sure = (widen<T>(answers, g) > 0.0) & (frame.depth > 0.0);
      sure &= (frame.depth <= frame.thickness) & mlp::is_deep_enough(queries[g]);
      sure &= mlp::is_inside(frame, pairs.unit[g] * widen_triple<T>(moments.mean, g), pair.size);
      left[g] = ~bits(sure);
      Columns<T> axes = select<T>(frame.b_is_incident, pair.axes_b, pair.axes_a);
      Triple<T> centre = select(frame.b_is_incident, pair.origin_b, pair.origin_a);
      Found<T>& one = found[g];
      one.volume = pairs.volume(moments.volume, g);
      one.centroid =
          components<T>(centre + axes * pairs.in_incident(moments.mean, g));
      if constexpr (std::is_same_v<FoundOf<T>, Moments<T>>)
        one.covariance = rotated(axes, pairs.in_incident(moments, g));
    }
  }
};

using MlpModel = MlpModelOf<Moments>;
using MlpPointModel = MlpModelOf<PointAndVolume>;

}  // namespace box_contact::BOX_CONTACT_SET
