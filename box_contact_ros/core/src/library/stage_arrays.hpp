// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What every stage of a pair computes, as named arrays: for training, reports and tests.
#pragma once

#include <cstdint>

namespace box_contact::detail {

// Arrays with a row for each pair, nullptr where one is not wanted. core/stages.py documents them.
struct StageArrays {
  bool *colliding{}, *frame_b{}, *in_range{}, *certain{};
  int64_t *axis{}, *face{};
  double *separation{}, *touch{}, *size{}, *normal{}, *rotation{}, *offset_a{}, *offset_b{};
  double *pressed_offset_a{}, *pressed_offset_b{}, *centroid{}, *clipped_centroid{};
  double *volume{}, *clipped_volume{}, *covariance{}, *clipped_covariance{};
  double *bounds_middle{}, *bounds_half{};
  double *other_axes{}, *other_offset{}, *other_half{}, *answer{}, *answer_volume{},
      *answer_covariance{};
  float *features{}, *vectors{}, *slant{}, *cut{};

  // Call visit(name, pointer, shape of a row) for each array.
  template <class Visit>
  void each(Visit visit) {
    visit("colliding", colliding, {});
    visit("frame_b", frame_b, {});
    visit("in_range", in_range, {});
    visit("certain", certain, {});
    visit("axis", axis, {});
    visit("face", face, {});
    visit("separation", separation, {});
    visit("touch", touch, {});
    visit("size", size, {});
    visit("normal", normal, {3});
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
    visit("bounds_middle", bounds_middle, {3});
    visit("bounds_half", bounds_half, {3});
    visit("other_axes", other_axes, {3, 3});
    visit("other_offset", other_offset, {3});
    visit("other_half", other_half, {3});
    visit("answer", answer, {3});
    visit("answer_volume", answer_volume, {});
    visit("answer_covariance", answer_covariance, {3, 3});
    visit("features", features, {9, 12});
    visit("vectors", vectors, {9, 3});
    visit("slant", slant, {3, 3});
    visit("cut", cut, {3});
  }
};

}  // namespace box_contact::detail
