// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What every stage of a pair computes, as named arrays: for training, reports and tests.
#pragma once

#include <cstdint>

namespace box_contact::detail {

// Features of the overlap that the network of model `mlp` reads.
constexpr int network_features = 21;

// Arrays with a row for each pair, nullptr where one is not wanted. core/stages.py documents them.
struct StageArrays {
  bool *colliding{}, *certain{};
  int64_t *axis{}, *face{};
  double *separation{}, *touch{}, *size{}, *normal{}, *axes_a{}, *rotation{};
  double *offset_a{}, *offset_b{};
  double *pressed_offset_a{}, *pressed_offset_b{}, *centroid{}, *clipped_centroid{};
  double *volume{}, *clipped_volume{}, *covariance{}, *clipped_covariance{};
  double *patch_axes{}, *patch_middle{}, *patch_half{};
  float *features{}, *body_volume{}, *body_mean{}, *body_variance{}, *body_beside{}, *flip{};

  // Call visit(name, pointer, shape of a row) for each array.
  template <class Visit>
  void each(Visit visit) {
    visit("colliding", colliding, {});
    visit("certain", certain, {});
    visit("axis", axis, {});
    visit("face", face, {});
    visit("separation", separation, {});
    visit("touch", touch, {});
    visit("size", size, {});
    visit("normal", normal, {3});
    visit("axes_a", axes_a, {3, 3});
    visit("rotation", rotation, {3, 3});
    visit("offset_a", offset_a, {3});
    visit("offset_b", offset_b, {3});
    visit("pressed_offset_a", pressed_offset_a, {3});
    visit("pressed_offset_b", pressed_offset_b, {3});
    visit("centroid", centroid, {3});
    visit("clipped_centroid", clipped_centroid, {3});
    visit("volume", volume, {});
    visit("clipped_volume", clipped_volume, {});
    visit("covariance", covariance, {3, 3});
    visit("clipped_covariance", clipped_covariance, {3, 3});
    visit("patch_axes", patch_axes, {3, 3});
    visit("patch_middle", patch_middle, {3});
    visit("patch_half", patch_half, {3});
    visit("features", features, {network_features});
    visit("body_volume", body_volume, {});
    visit("body_mean", body_mean, {3});
    visit("body_variance", body_variance, {3});
    visit("body_beside", body_beside, {3});
    visit("flip", flip, {3});
  }
};

}  // namespace box_contact::detail
