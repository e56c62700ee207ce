// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What every stage of a pair computes, as named arrays: for training, reports and tests.
#pragma once

#include <cstdint>

namespace box_contact::detail {

// Arrays with a row for each pair, nullptr where one is not wanted. core/stages.py documents them.
struct StageArrays {
  bool *colliding{}, *certain{}, *accurate{};
  int64_t *axis{}, *face{};
  double *separation{}, *touch{}, *size{}, *normal{}, *axes_a{}, *rotation{};
  double *offset_a{}, *offset_b{};
  double *pressed_offset_a{}, *pressed_offset_b{}, *centroid{}, *clipped_centroid{};
  double *volume{}, *clipped_volume{}, *covariance{}, *clipped_covariance{};
  double *unit{}, *true_volume{}, *true_mean{}, *true_covariance{};
  float *columns_volume{}, *columns_mean{}, *columns_covariance{};
  float *upper_volume{}, *upper_least{}, *upper_most{}, *upper_features{}, *upper_points{},
      *upper_carries{};

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
    visit("accurate", accurate, {});
    visit("unit", unit, {});
    visit("true_volume", true_volume, {});
    visit("true_mean", true_mean, {3});
    visit("true_covariance", true_covariance, {3, 3});
    visit("columns_volume", columns_volume, {});
    visit("columns_mean", columns_mean, {3});
    visit("columns_covariance", columns_covariance, {3, 3});
    visit("upper_volume", upper_volume, {3});
    visit("upper_least", upper_least, {3});
    visit("upper_most", upper_most, {3});
    visit("upper_features", upper_features, {3, 6});
    visit("upper_points", upper_points, {3, 2, 3});
    visit("upper_carries", upper_carries, {3, 2});
  }
};

}  // namespace box_contact::detail
