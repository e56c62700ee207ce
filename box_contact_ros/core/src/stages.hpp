// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Fill the arrays of what every stage of a pair computes.
#pragma once

#include "mlp/mlp_model.hpp"
#include "rows.hpp"
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
  Columns<double> to_axes = transpose(frame.b_is_incident ? boxes.axes_b : boxes.axes_a);
  Triple<double> centre = frame.b_is_incident ? boxes.origin_b : boxes.origin_a;
  Triple<double> t = to_axes * (triple(exact.centroid) - centre);
  Vec<double> mean;
  Sym<double> covariance = rotated(to_axes, exact.covariance);
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

// A single pair as the caller names its boxes, in the frame of the caller's A.
struct CallersFrame {
  const Pair<double>& pair;

  double axis(double axis) const { return pair.swapped ? swapped_axis(axis) : axis; }
  // From A to B.
  Vec<double> normal(const Triple<double>& n) const {
    return components<double>(pair.swapped ? -(pair.a_in_b * n) : n);
  }
  Vec<double> point(const Triple<double>& p) const {
    return components<double>(pair.swapped ? pair.a_in_b * p - pair.offset_b : p);
  }
  Vec<double> from_common_frame(const Vec<double>& point) const {
    const Columns<double>& axes = pair.swapped ? pair.axes_b : pair.axes_a;
    const Triple<double>& origin = pair.swapped ? pair.origin_b : pair.origin_a;
    return components<double>(transpose(axes) * (triple(point) - origin));
  }
  Vec<double> offset_a() const {
    return components<double>(pair.swapped ? -pair.offset_b : pair.offset_a);
  }
  Vec<double> offset_b() const {
    return components<double>(pair.swapped ? -pair.offset_a : pair.offset_b);
  }
  Mat<double> axes_a() const { return matrix(pair.swapped ? pair.axes_b : pair.axes_a); }
  // B's axes as columns.
  Mat<double> rotation() const { return matrix(pair.swapped ? pair.a_in_b : pair.b_in_a); }
};

// Fill one row. Returns false if its poses or sizes are refused.
inline bool fill_stages(const Rows& rows, long row, const StageArrays& arrays) {
  Query<double> q;
  query_rows(rows, row, row + 1, q);
  if (!q.pair.valid) return false;
  CallersFrame callers{q.pair};
  put(arrays.colliding, row, q.touching);
  put(arrays.axis, row, callers.axis(q.axis.axis));
  put(arrays.face, row, callers.axis(q.axis.face));
  put(arrays.separation, row, q.axis.separation);
  put(arrays.touch, row, q.pair.touch);
  put(arrays.size, row, q.pair.size);
  put(arrays.normal, row, callers.normal(q.axis.normal));
  put(arrays.axes_a, row, callers.axes_a());
  put(arrays.rotation, row, callers.rotation());
  put(arrays.offset_a, row, callers.offset_a());
  put(arrays.offset_b, row, callers.offset_b());
  bool of_columns = arrays.accurate || arrays.unit || arrays.true_volume || arrays.true_mean ||
                    arrays.true_covariance || arrays.columns_volume || arrays.columns_mean ||
                    arrays.columns_covariance || arrays.upper_volume || arrays.upper_least ||
                    arrays.upper_most || arrays.upper_features || arrays.upper_points ||
                    arrays.upper_carries;
  if (of_columns || arrays.centroid || arrays.volume || arrays.covariance || arrays.certain) {
    Counts counts{};
    Moments<double> exact = exact_overlap(q, counts);
    put(arrays.centroid, row, callers.from_common_frame(exact.centroid));
    put(arrays.volume, row, exact.volume);
    put(arrays.covariance, row, matrix(exact.covariance));
    put(arrays.certain, row, counts.clipped == 0);
    Query<double> queries[1] = {q};
    if (of_columns) put_columns(arrays, row, queries, exact);
  }
  Pair<double> pressed = q.pair;
  bool was_pressed = enforce_minimum_depth(pressed, q.axis);
  CallersFrame pressed_callers{pressed};
  if (arrays.clipped_centroid || arrays.clipped_volume || arrays.clipped_covariance) {
    Moments<double> clipped = clipped_overlap(pressed, int(q.axis.face), was_pressed);
    put(arrays.clipped_centroid, row, pressed_callers.point(triple(clipped.centroid)));
    put(arrays.clipped_volume, row, clipped.volume);
    put(arrays.clipped_covariance, row, matrix(clipped.covariance));
  }
  put(arrays.pressed_offset_a, row, pressed_callers.offset_a());
  put(arrays.pressed_offset_b, row, pressed_callers.offset_b());
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET
