// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `paper`: contact point and normal of two equal boxes by the source paper's network.
//
// 1. The box whose face wins the separating-axis test is the first box; of edges it is the caller's A.
//    The boxes are moved apart along the normal until they touch: the network knows touching boxes only.
// 2. `fold`: symmetries bring the pair into the network's domain, t ≥ 0 and roll, pitch and yaw from
//    −π/2 to π/2. A box stays the same when an axis changes its sign, and the whole pair may be
//    reflected. Let t be the second box's offset and R its orientation, in the first box's frame. Then
//    t' = M t and R' = M R N, with det M · det N = 1. M and N are diagonal, of signs that the pose alone
//    tells. Points and directions of the contact go back by M.
// 3. The network: offset, roll, pitch and yaw → azimuth and elevation of the impact point, seen from the
//    first box's centre, and of the normal. Or → x, y and z of the point; the normal is then SAT's.
// 4. The point is where that direction leaves the first box. It goes to the middle of the depth.
#pragma once

#include "../overlap/moments.hpp"
#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET {
namespace paper {

constexpr float pi = 3.14159265F, half_pi = 1.57079633F;
constexpr float least = 1e-30F;  // number by which is divided

template <class F>
BC_INLINE F sign(F x) {
  return either<F>(x >= F{}, splat<F>(1.0F), splat<F>(-1.0F));
}
// atan2(y, x) for x not below 0, to 1e-5 (Hastings 1955).
template <class F>
BC_INLINE F angle(F y, F x) {
  F a = abs(y), small = min<F>(a, x), large = max<F>(max<F>(a, x), splat<F>(least));
  F r = small / large, z = r * r;
  F found = -0.11643287F + z * (0.05265332F - 0.01172120F * z);
  found = r * (0.99997726F + z * (-0.33262347F + z * (0.19354346F + z * found)));
  found = either<F>(a > x, half_pi - found, found);
  return either<F>(y < F{}, -found, found);
}
// Of −π/2 to π/2, to 3e-7.
template <class F>
BC_INLINE F sine(F x) {
  F z = x * x, found = 0.00833217F + z * (-0.00019515F + z * 0.0000025F);
  return x + x * (z * (-0.16666654F + z * found));
}
// A unit vector; the azimuth runs from x towards y, the elevation towards z [rad].
template <class F>
BC_INLINE Vec<F> direction(F azimuth, F elevation) {
  auto sine_and_cosine = [](F x, F& s, F& c) {
    constexpr float rounded = 12582912.0F;  // 1.5 · 2²³: sums with it are whole
    x = x - 2.0F * pi * ((x * (0.5F / pi) + rounded) - rounded);
    F a = abs(x), up = sine<F>(either<F>(a > half_pi, pi - a, a));
    s = either<F>(x < F{}, -up, up);
    c = sine<F>(half_pi - a);
  };
  F sa, ca, se, ce;
  sine_and_cosine(azimuth, sa, ca);
  sine_and_cosine(elevation, se, ce);
  return {ce * ca, ce * sa, se};
}

// A pair that touches, in the first box's frame and unit.
template <class T>
struct Touching {
  Mask<T> first_is_b;
  Triple<T> normal;     // from the first to the second box
  Triple<T> offset;     // t of the second box
  Columns<T> rotation;  // R, the second box's axes
  Triple<T> half;       // half extents of either box
  T unit;               // [m]

  Touching() = default;
  BC_INLINE Touching(const Query<T>& q, bool in_half_edges) {
    const Pair<T>& pair = q.pair;
    T axis = T(q.axis.axis);
    constexpr double first_edge = first_edge_axis;
    first_is_b = ((axis >= 3.0) & (axis < first_edge)) | ((axis >= first_edge) & pair.swapped);
    unit = in_half_edges ? T(pair.half_a[0]) : splat<T>(1.0);
    T by_unit = 1.0 / unit;
    normal = select(first_is_b, -(pair.a_in_b * q.axis.normal), q.axis.normal);
    Triple<T> apart = select(first_is_b, -pair.offset_b, pair.offset_a);
    offset = by_unit * (apart - q.axis.separation * normal);
    half = by_unit * select(first_is_b, pair.half_b, pair.half_a);
    rotation = select<T>(first_is_b, pair.a_in_b, pair.b_in_a);
  }
};

// The answer of the network for a pair.
template <class F>
struct Impact {
  Vec<F> point, normal;  // first box's frame and unit

  BC_INLINE Impact(const Network& network, const Vec<F>& t, const Vec<F> (&r)[3],
                   const Vec<F>& half) {
    F m[3], features[up_to_fours(detail::paper_inputs)];
    F outputs[up_to_eights(detail::paper_outputs)];
    for (int i = 0; i < 3; ++i) m[i] = sign(t[i]), features[i] = abs(t[i]);
    // r: columns of R. Cosines of yaw and of roll are not below 0.
    F nx = sign<F>(m[0] * r[0][0]), nz = sign<F>(m[2] * r[2][2]);
    F ny = ((m[0] * m[1]) * m[2]) * (nx * nz), sine_of_pitch = -(m[2] * r[0][2] * nx);
    F cosine2 = max<F>(1.0F - sine_of_pitch * sine_of_pitch, F{});
    features[3] = angle<F>(m[2] * r[1][2] * ny, abs(r[2][2]));
    features[4] = angle<F>(sine_of_pitch, sqrt(cosine2));
    features[5] = angle<F>(m[1] * r[0][1] * nx, abs(r[0][0]));
    features[6] = features[7] = F{};
    answer(network, features, detail::paper_outputs, outputs);
    Vec<F> way = direction<F>(outputs[0], outputs[1]);
    F farthest =
        max<F>(max<F>(abs(way[0]) / half[0], abs(way[1]) / half[1]), abs(way[2]) / half[2]);
    normal = direction<F>(outputs[2], outputs[3]);
    for (int i = 0; i < 3; ++i) point[i] = m[i] * way[i] / farthest, normal[i] = m[i] * normal[i];
  }
};

}  // namespace paper

// What the paper's network finds.
template <class T>
struct PointAndNormal : PointAndVolume<T> {
  static constexpr bool has_normal = true;

  Vec<T> normal;  // from the caller's A, common frame
};

template <class T>
struct ImpactByNetwork {
  using Found = PointAndNormal<T>;

  BC_INLINE ImpactByNetwork(const Network& network, Queries<T> of) : queries(of) {
    for (int n = 0; n < blocks_together<T>; ++n) pairs[n] = {*queries[n], network.in_half_edges};
    auto vector = [&](auto get) {
      return components<F>(triple_of_floats<T>([&](int n) { return get(pairs[n]); }));
    };
    Vec<F> columns[3];
    for (int k = 0; k < 3; ++k)
      columns[k] = vector([k](const auto& pair) { return pair.rotation[k]; });
    paper::Impact<F> impact(network, vector([](const auto& pair) { return pair.offset; }), columns,
                            vector([](const auto& pair) { return pair.half; }));
    point = triple(impact.point), normal = triple(impact.normal);
  }
  // To the common frame.
  BC_INLINE void write(int block, Found& found) const {
    const Query<T>& query = *queries[block];
    const Pair<T>& pair = query.pair;
    const paper::Touching<T>& touching = pairs[block];
    Columns<T> axes = select<T>(touching.first_is_b, pair.axes_b, pair.axes_a);
    Triple<T> origin = select(touching.first_is_b, pair.origin_b, pair.origin_a);
    Triple<T> at = touching.unit * triple_of_doubles<T>(point, block) +
                   (0.5 * query.axis.separation) * touching.normal;
    Triple<T> answered = triple_of_doubles<T>(normal, block);
    T by_length = 1.0 / sqrt(dot(answered, answered));  // of float32, 1 to seven digits
    Triple<T> unit_normal = axes * (by_length * answered), zero{};
    // Zeros keep no sign on a swap.
    unit_normal =
        select(Mask<T>(touching.first_is_b ^ pair.swapped), zero - unit_normal, zero + unit_normal);
    found.centroid = components<T>(origin + axes * at);
    found.volume = splat<T>(not_a_number);
    found.normal = components<T>(unit_normal);
  }

 private:
  using F = Floats<T>;

  Queries<T> queries;
  paper::Touching<T> pairs[blocks_together<T>];
  Triple<F> point, normal;  // of the first box's frame and unit
};

using PaperModel = NetworkModel<ImpactByNetwork>;

}  // namespace box_contact::BOX_CONTACT_SET
