// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Fill the arrays of what every stage of a pair computes.
#pragma once

#include "../mlp/mlp_model.hpp"
#include "stage_arrays.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::StageArrays;

template <class Number, class Value>
inline void put(Number* array, long row, Value value) {
  if (array) array[row] = Number(value);
}
inline void put(double* array, long row, const Vec<double>& v) {
  for (int k = 0; array && k < 3; ++k) array[3 * row + k] = v[k];
}
inline void put(double* array, long row, const Mat<double>& m) {
  for (int i = 0; array && i < 3; ++i)
    for (int j = 0; j < 3; ++j) array[9 * row + 3 * i + j] = m[i][j];
}

inline void put_features(const StageArrays& arrays, long row, const CutCube<double> (&cubes)[1]) {
  SiteFeatures<float> features;
  SiteVectors<float> vectors;
  CutCube<float> cube = narrow(cubes);
  describe(cube, features, vectors);
  for (int f = 0; f < 3; ++f) {
    put(arrays.cut, 3 * row + f, cube.cut[f]);
    for (int q = 0; q < 3; ++q) {
      long site = site_count * row + 3 * f + q;
      for (int k = 0; arrays.features && k < 4; ++k) {
        float* at = arrays.features + site_features * site + k;
        at[0] = features.of_site[q][k][f];
        at[4] = features.of_faces[k][f];
        at[8] = features.of_axis[k][q];
      }
      for (int k = 0; arrays.vectors && k < point_outputs; ++k)
        arrays.vectors[point_outputs * site + k] = vectors.along[q][k][f];
      put(arrays.slant, site, cube.slant[q][f]);
    }
  }
}

// Fill one row. Returns false if its poses or sizes are refused. `network` may be nullptr.
template <Network::Bounds method>
bool fill_stages(const Rows& rows, long row, const NetworkView* network,
                 const StageArrays& arrays) {
  Query<double> q;
  query_rows(rows, row, row + 1, q);
  if (!q.pair.valid) return false;
  put(arrays.colliding, row, q.touching);
  put(arrays.axis, row, q.axis.axis);
  put(arrays.face, row, q.axis.face);
  put(arrays.separation, row, q.axis.separation);
  put(arrays.touch, row, q.pair.touch);
  put(arrays.size, row, q.pair.size);
  put(arrays.normal, row, q.axis.normal);
  put(arrays.rotation, row, q.pair.rotation);
  put(arrays.offset_a, row, q.pair.offset_a);
  put(arrays.offset_b, row, q.pair.offset_b);
  if (arrays.centroid || arrays.volume || arrays.covariance || arrays.certain) {
    Counts counts{};
    Moments<double> exact = exact_overlap(q, counts);
    put(arrays.centroid, row, exact.centroid);
    put(arrays.volume, row, exact.volume);
    put(arrays.covariance, row, matrix(exact.covariance));
    put(arrays.certain, row, counts.clipped == 0);
  }
  Pair<double> pressed = q.pair;
  bool was_pressed = enforce_minimum_depth(pressed, q.axis);
  if (arrays.clipped_centroid || arrays.clipped_volume || arrays.clipped_covariance) {
    Moments<double> clipped = clipped_overlap(pressed, int(q.axis.face), was_pressed);
    put(arrays.clipped_centroid, row, clipped.centroid);
    put(arrays.clipped_volume, row, clipped.volume);
    put(arrays.clipped_covariance, row, matrix(clipped.covariance));
  }
  put(arrays.pressed_offset_a, row, pressed.offset_a);
  put(arrays.pressed_offset_b, row, pressed.offset_b);
  OverlapBounds<double> bounds = MlpModelBy<method>::bounds_of(pressed, q.axis);
  put(arrays.frame_b, row, bounds.in_b);
  put(arrays.in_range, row, in_range(pressed, q.axis.separation, bounds));
  put(arrays.bounds_middle, row, components<double>(bounds.middle));
  put(arrays.bounds_half, row, components<double>(bounds.half));
  put(arrays.other_axes, row, matrix(bounds.other_axes));
  put(arrays.other_offset, row, components<double>(bounds.other_offset));
  put(arrays.other_half, row, components<double>(bounds.other_half));
  CutCube<double> cubes[1] = {cut_cube(bounds, q.pair.size)};
  if (network) {
    CubeMoments<double> said[1];
    ask<site_outputs>(*network, cubes, said);
    const auto &diagonal = said[0].variance, &rest = said[0].covariant;
    put(arrays.answer, row, components<double>(said[0].centroid));
    put(arrays.answer_volume, row, said[0].volume[0]);
    put(arrays.answer_covariance, row,
        matrix(Sym<double>{{diagonal[0], diagonal[1], diagonal[2], rest[0], rest[1], rest[2]}}));
  }
  if (arrays.features || arrays.vectors || arrays.slant || arrays.cut)
    put_features(arrays, row, cubes);
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET
