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

template <int count>
inline void put(float* array, long row, const float (&numbers)[count]) {
  if (array) std::memcpy(array + count * row, numbers, sizeof numbers);
}

// The patch box in the common frame, and what model `mlp` knows of the overlap.
inline void put_patch(const StageArrays& arrays, long row, const Query<double>& query) {
  mlp::PatchBox<double> box(query);
  mlp::Chords<float> chords(box);
  mlp::PlacedBox<double> placed(query.pair, box);
  put(arrays.patch_axes, row, matrix(placed.axes));
  put(arrays.patch_middle, row, components<double>(placed.middle));
  put(arrays.patch_half, row, Vec<double>{box.half[0], box.half[1], box.half[2]});
  float told[detail::network_features];
  chords.tell(told);
  put(arrays.features, row, told);
  put(arrays.body_volume, row, chords.volume);
  put(arrays.body_mean, row, chords.mean);
  put(arrays.body_variance, row, chords.variance);
  put(arrays.body_beside, row, chords.beside);
  put(arrays.flip, row, chords.flip);
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
  if (arrays.centroid || arrays.volume || arrays.covariance || arrays.certain) {
    Counts counts{};
    Moments<double> exact = exact_overlap(q, counts);
    put(arrays.centroid, row, callers.from_common_frame(exact.centroid));
    put(arrays.volume, row, exact.volume);
    put(arrays.covariance, row, matrix(exact.covariance));
    put(arrays.certain, row, counts.clipped == 0);
  }
  if (q.touching && (arrays.features || arrays.patch_half)) put_patch(arrays, row, q);
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
