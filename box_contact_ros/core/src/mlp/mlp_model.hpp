// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `mlp`: SAT, and a multilayer perceptron that decides the answer from what the half-spaces of
// both boxes cut off the patch box (features.hpp).
//
// All pairs take the same instructions, whatever their poses. The network has ten outputs, in the
// coordinates of the patch box, from −1 to 1: the centroid, the volume, and a triangular root of the
// covariance. Whatever the weights are, the point is within the bounds of A∩B, the volume is positive
// and not above that of the bounds, and the covariance is positive definite. A pair that is its own
// mirror image has its point in the mirror's plane: there the feature that mirrors the axis is 0, and
// the coordinate fades with it.
#pragma once

#include "../overlap/moments.hpp"
#include "features.hpp"
#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET {
namespace mlp {

// Least volume [of the patch box's], and least standard deviation along an axis [half extents].
constexpr float least_volume = 1e-5F, least_deviation = 1e-3F;
// Largest entry of the covariance's root [half extents]: a convex body has no more, and three of them
// make no variance above 1.
constexpr float most_deviation = 0.577350269F;
// Feature below which a coordinate of the point fades out. At 0.05 the median error of landings doubles.
constexpr float fade = 0.01F;
// The point is moved into either box in turn, so many times, and half of the way farther. With no more
// than the way itself, it stays outside of the other box by 60 times as much.
constexpr int moves_inwards = 3;
constexpr float way_inwards = 1.5F;

// Outputs of the point and the volume, the first ones. The others are of the covariance.
constexpr int point_outputs = 4;

// What is not a number becomes the least one: features of extreme sizes overflow.
template <class F>
BC_INLINE F within(F x, float least, float most) {
  return min<F>(max<F>(x, splat<F>(least)), splat<F>(most));
}

// The outputs of the network for an overlap.
template <class F>
struct Overlap {
  F outputs[up_to_eights(detail::network_outputs)];
  F point[3];  // −1 to 1 between the bounds
  F volume;    // of the patch box's

  BC_INLINE Overlap(const Network& network, const Features<F>& features, int wanted) {
    answer(network, features.numbers, wanted, outputs);
    for (int i = 0; i < 3; ++i) {
      F share = within<F>((1.0F / fade) * abs(features.numbers[i]), 0.0F, 1.0F);
      point[i] = (features.flip[i] * share) * within<F>(outputs[i], -1.0F, 1.0F);
    }
    volume = within<F>(outputs[3] * outputs[3], least_volume, 1.0F);
  }
  // Move a point that is outside of a box inwards, within the bounds.
  BC_INLINE void move_into(const Side<F>& slabs, const F (&by_half2)[3]) {
    Triple<F> at =
        (point[0] * slabs.slope[0] + point[1] * slabs.slope[1]) + point[2] * slabs.slope[2];
    Triple<F> off = min(slabs.plus, max(-slabs.minus, at)) - at;
    for (int i = 0; i < 3; ++i) {
      F moved = point[i] + (way_inwards * by_half2[i]) * dot(slabs.slope[i], off);
      point[i] = within<F>(moved, -1.0F, 1.0F);
    }
  }
};

// The covariance L Lᵀ, in the common frame. The network gives the lower triangle L: xx, yy, zz, yx, zx, zy
// [half extents].
template <class T>
BC_INLINE Sym<T> covariance(const PatchBox<T>& box, const Features<Floats<T>>& features,
                            const Overlap<Floats<T>>& overlap, int block) {
  using F = Floats<T>;
  Triple<F> axis[3];
  F root[6];
  for (int i = 0; i < 3; ++i) {
    int j = i == 2 ? 1 : 0, k = i == 0 ? 1 : 2;  // of yx, zx, zy
    const F* outputs = overlap.outputs + point_outputs;
    axis[i] = box.half[i] * box.a.axes[i];
    root[i] = within<F>(outputs[i], least_deviation, most_deviation);
    root[3 + i] = (features.flip[j] * features.flip[k]) *
                  within<F>(outputs[3 + i], -most_deviation, most_deviation);
  }
  Triple<F> columns[3] = {(root[0] * axis[0] + root[3] * axis[1]) + root[4] * axis[2],
                          root[1] * axis[1] + root[5] * axis[2], root[2] * axis[2]};
  Triple<T> c[3];
  for (int i = 0; i < 3; ++i)
    c[i] = box.meetings[block].unit *
           (box.queries[block]->pair.axes_a * triple_of_doubles<T>(columns[i], block));
  // Products of floats are exact in float64, so no eigenvalue is below 0 but for the last digit.
  Triple<T> squares = (c[0] * c[0] + c[1] * c[1]) + c[2] * c[2];
  Triple<T> beside = (c[0] * rotated(c[0]) + c[1] * rotated(c[1])) + c[2] * rotated(c[2]);
  return {{squares[0], squares[1], squares[2], beside[1], beside[2], beside[0]}};
}

}  // namespace mlp

// What the network finds of an overlap. `FoundOf`: Moments, or PointAndVolume.
template <class T, template <class> class FoundOf>
struct OverlapByNetwork {
  using Found = FoundOf<T>;

  BC_INLINE OverlapByNetwork(const Network& network, Queries<T> queries)
      : box(queries), features(box), overlap(network, features, wanted) {
    F by_half2[3];
    for (int i = 0; i < 3; ++i) by_half2[i] = 1.0F / (box.half[i] * box.half[i]);
    for (int n = 0; n < mlp::moves_inwards; ++n) {
      overlap.move_into(box.a, by_half2);
      overlap.move_into(box.b, by_half2);
    }
    for (int i = 0; i < 3; ++i) from_origin[i] = box.centre[i] + box.half[i] * overlap.point[i];
    volume = (8.0F * ((box.half[0] * box.half[1]) * box.half[2])) * overlap.volume;
  }
  BC_INLINE void write(int block, Found& found) const {
    T unit = box.meetings[block].unit, unit3 = (unit * unit) * unit;
    found.centroid = components<T>(
        point_in_common_frame(box.queries[block]->pair, box.point(from_origin, block)));
    found.volume = unit3 * doubles<T>(volume, block);
    if constexpr (patch) found.covariance = mlp::covariance(box, features, overlap, block);
  }

 private:
  using F = Floats<T>;
  static constexpr bool patch = std::is_same_v<Found, Moments<T>>;
  static constexpr int wanted = patch ? detail::network_outputs : mlp::point_outputs;

  mlp::PatchBox<T> box;
  mlp::Features<F> features;
  mlp::Overlap<F> overlap;
  F from_origin[3], volume;
};

template <class T>
using MomentsByNetwork = OverlapByNetwork<T, Moments>;
template <class T>
using PointAndVolumeByNetwork = OverlapByNetwork<T, PointAndVolume>;

using MlpModel = NetworkModel<MomentsByNetwork>;
using MlpPointModel = NetworkModel<PointAndVolumeByNetwork>;

}  // namespace box_contact::BOX_CONTACT_SET
