// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Model `mlp`: SAT, chords of the overlap, and a multilayer perceptron that corrects what they sum to.
//
// All pairs take the same instructions, whatever their poses. The patch box (patch_box.hpp) holds A∩B.
// 48 chords in it give volume, centroid and covariance of a body close to A∩B (chords.hpp). The network
// has seven outputs. Each is the exponent of a factor, from 1/4 to 4:
//
//   centroid: of the odds u / (1 − u), with u from 0 to 1 the place between the bounds of a coordinate
//   volume: of the body's volume, up to that of the patch box
//   covariance: of the body's deviation along each axis, up to half of the patch box's extent
//
// So whatever the weights are, the point is within the bounds of A∩B, the volume is positive and not
// above that of the bounds, and the covariance is positive definite.
#pragma once

#include "../overlap/moments.hpp"
#include "chords.hpp"
#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace mlp {

static_assert(features == network_features, "what the chords tell is what the network reads");

// Largest exponent of a factor.
constexpr float most_exponent = 3.0F;
// Least distance of the centroid from the bounds [of the extent].
constexpr float least_margin = 1e-3F;

// A factor from 1/4 to 4, smooth and increasing, by one division.
template <class F>
BC_INLINE F factor(F exponent) {
  F x = min(splat<F>(most_exponent), abs(exponent)) + 1.0F;
  return select<F>(exponent < 0.0F, 1.0F / x, x);
}

// Volume, centroid and covariance of a body in the coordinates of the patch box.
template <class F>
struct Body {
  F volume, mean[3], variance[3], beside[3];

  BC_INLINE Body(const Chords<F>& chords, const F (&answers)[8]) {
    F deviation[3];
    for (int i = 0; i < 3; ++i) {
      F place = min(0.5F + 0.5F * chords.mean[i], splat<F>(1.0F - least_margin));
      F odds = place * factor<F>(answers[i]);
      mean[i] = chords.flip[i] * (2.0F * (odds / (odds + (1.0F - place))) - 1.0F);
      F most = 1.0F / sqrt(chords.variance[i]);
      deviation[i] = min(factor<F>(answers[4 + i]), most);
    }
    volume = min(chords.volume * factor<F>(answers[3]), splat<F>(1.0F));
    for (int i = 0; i < 3; ++i) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      variance[i] = (deviation[i] * deviation[i]) * chords.variance[i];
      beside[i] = (deviation[j] * deviation[k]) *
                  ((chords.flip[j] * chords.flip[k]) * chords.beside[i]);
    }
  }
};

// The patch box in the common frame.
template <class T>
struct PlacedBox {
  Columns<T> axes;
  Triple<T> middle;  // [m]

  BC_INLINE PlacedBox(const Pair<T>& pair, const PatchBox<T>& box) {
    Columns<T> axes_p = select<T>(box.p_is_b, pair.axes_b, pair.axes_a);
    middle = select(box.p_is_b, pair.origin_b, pair.origin_a);
    for (int i = 0; i < 3; ++i) {
      axes[i] = axes_p * box.axes[i];
      middle = middle + box.middle[i] * axes[i];
    }
    // B is what is pressed.
    middle = middle + select<T>(box.p_is_b, box.pressed, T{}) * axes[2];
  }
};

}  // namespace mlp

// `FoundOf`: Moments, or PointAndVolume.
template <template <class> class FoundOf>
struct MlpModelOf {
  Network network;

  template <class T>
  using Found = FoundOf<T>;

  template <class T>
  [[gnu::noinline]] unsigned solve(const Query<T>& query, Found<T>& found, detail::Counts&) const {
    using F = Floats<T>;
    mlp::PatchBox<T> box(query);
    mlp::Chords<F> chords(box);
    F told[network_features], answers[8];
    chords.tell(told);
    mlp::answer(network, told, answers);
    mlp::Body<F> body(chords, answers);

    mlp::PlacedBox<T> placed(query.pair, box);
    const T(&half)[3] = box.half;
    Triple<T> point = placed.middle;
    for (int i = 0; i < 3; ++i)
      point = point + (half[i] * to_doubles<T>(body.mean[i])) * placed.axes[i];
    found.volume = (8.0 * ((half[0] * half[1]) * half[2])) * to_doubles<T>(body.volume);
    found.centroid = components<T>(point);
    if constexpr (std::is_same_v<FoundOf<T>, Moments<T>>) {
      Sym<T> covariance;
      for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        covariance(i, i) = (half[i] * half[i]) * to_doubles<T>(body.variance[i]);
        covariance(j, k) = (half[j] * half[k]) * to_doubles<T>(body.beside[i]);
      }
      found.covariance = rotated(placed.axes, covariance);
    }
    return 0;
  }
  template <class T>
  void solve_left(const Query<T>&, Found<T>&, detail::Counts&) const {}  // nothing is left
};

using MlpModel = MlpModelOf<Moments>;
using MlpPointModel = MlpModelOf<PointAndVolume>;

}  // namespace box_contact::BOX_CONTACT_SET
