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

inline void put(float* array, long row, const Triple<float>& v) {
  for (int k = 0; array && k < 3; ++k) array[3 * row + k] = v[k];
}

// The columns and what cuts them, and the exact moments in the same coordinates.
inline void put_columns(const StageArrays& arrays, long row, const Query<double> (&queries)[1],
                        const Moments<double>& exact) {
  mlp::Described<double, 1> pair(queries);
  const ContactFrame<double>& frame = pair.frames[0];
  ColumnMoments<float> moments = column_moments(pair.columns);
  put(arrays.accurate, row,
      mlp::is_accurate(pair.columns, moments) && frame.depth > 0.0 &&
          frame.depth <= frame.thickness);
  put(arrays.unit, row, pair.unit[0]);
  put(arrays.columns_volume, row, moments.volume);
  put(arrays.columns_mean, row, moments.mean);
  Triple<float> by_z = column_sums::reciprocals(pair.columns.qz);
  for (int k = 0; k < 3; ++k) {
    UpperFace<float> face = upper_face(pair.columns, by_z, k);
    long at = 3 * row + k;
    put(arrays.upper_volume, at, face.volume);
    put(arrays.upper_least, at, face.least);
    put(arrays.upper_most, at, face.most);
    for (int n = 0; n < detail::network_features; ++n)
      put(arrays.upper_features, detail::network_features * at + n, face.features[n]);
    for (int n = 0; n < 2; ++n) {
      put(arrays.upper_carries, 2 * at + n, face.carries[n]);
      put(arrays.upper_points, 2 * at + n, face.at[n]);
    }
  }
  // From A's frame to that of the columns.
  const Pair<double>& boxes = queries[0].pair;
  double by_unit = 1.0 / pair.unit[0];
  Mat<double> axes = frame.b_is_incident ? boxes.axes_b : boxes.axes_a;
  Vec<double> centre = frame.b_is_incident ? boxes.origin_b : boxes.origin_a;
  Vec<double> t = transposed_times(axes, exact.centroid - centre), mean;
  Sym<double> covariance = rotated(transpose(axes), exact.covariance);
  for (int k = 0; k < 3; ++k) {
    mean[k] = by_unit * ((frame.sign[k] * t[k] + frame.half[k]) - frame.start[k]);
    for (int l = 0; l < 3; ++l) {
      long at = 9 * row + 3 * k + l;
      put(arrays.true_covariance, at,
          by_unit * by_unit * frame.sign[k] * frame.sign[l] * covariance(k, l));
      put(arrays.columns_covariance, at, k == l ? moments.variance[k] : moments.beside[3 - k - l]);
    }
  }
  put(arrays.true_mean, row, mean);
  put(arrays.true_volume, row, exact.volume * by_unit * by_unit / pair.depth[0]);
}

// Fill one row. Returns false if its poses or sizes are refused.
inline bool fill_stages(const Rows& rows, long row, const StageArrays& arrays) {
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
  put(arrays.axes_a, row, q.pair.axes_a);
  put(arrays.rotation, row, q.pair.rotation);
  put(arrays.offset_a, row, q.pair.offset_a);
  put(arrays.offset_b, row, q.pair.offset_b);
  bool of_columns = arrays.accurate || arrays.unit || arrays.true_volume || arrays.true_mean ||
                    arrays.true_covariance || arrays.columns_volume || arrays.columns_mean ||
                    arrays.columns_covariance || arrays.upper_volume || arrays.upper_least ||
                    arrays.upper_most || arrays.upper_features || arrays.upper_points ||
                    arrays.upper_carries;
  if (of_columns || arrays.centroid || arrays.volume || arrays.covariance || arrays.certain) {
    Counts counts{};
    Moments<double> exact = exact_overlap(q, counts);
    put(arrays.centroid, row, transposed_times(q.pair.axes_a, exact.centroid - q.pair.origin_a));
    put(arrays.volume, row, exact.volume);
    put(arrays.covariance, row, matrix(exact.covariance));
    put(arrays.certain, row, counts.clipped == 0);
    Query<double> queries[1] = {q};
    if (of_columns) put_columns(arrays, row, queries, exact);
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
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET
