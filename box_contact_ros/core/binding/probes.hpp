// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Probes: what lies behind the answers. Training reads what model `mlp` reads of a pair, and tests
// compare planes with clipping, which answers few pairs.
#pragma once

#include "../src/mlp/mlp_model.hpp"
#include "../src/overlap/exact.hpp"
#include "../src/rows.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

// Call probe(query, row) for each row of (poses_a, poses_b, sizes_a, sizes_b).
template <class Probe>
void each_query(const PairArrays& pairs, Probe probe) {
  for (long row = 0; row < pairs.count; ++row) {
    Query<double> q;
    query_rows(pairs.rows, row, row + 1, q);
    if (!q.pair.valid) {
      PyErr_Format(PyExc_ValueError, "row %ld is refused: its poses or sizes are not valid", row);
      throw PythonError{};
    }
    probe(q, row);
  }
}

// What model `mlp` makes of pairs that touch: the patch box, and what is cut off it.
inline PyObject* mlp_inputs(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) fail(PyExc_TypeError, "mlp_inputs(poses_a, poses_b, sizes_a, sizes_b)");
  PairArrays pairs(args, Py_None);
  npy_intp n = pairs.count;
  constexpr npy_intp features_count = detail::network_features;
  auto axes = make<double>({n, 3, 3}), middle = make<double>({n, 3}), half = make<double>({n, 3});
  auto features = make<double>({n, features_count});
  each_query(pairs, [&](const Query<double>& q, long row) {
    const Query<double>* queries[] = {&q};
    mlp::PatchBox<double> box(queries);
    mlp::Cuts<float> cuts(box);
    std::copy_n(cuts.features, features_count, features.numbers + features_count * row);
    Triple<double> place = box.point(box.centre, 0);
    write(components<double>(point_in_common_frame(q.pair, place)), middle.numbers + 3 * row);
    Columns<double> common;
    for (int k = 0; k < 3; ++k) {
      auto axis = k == 2 ? q.axis.normal : triple_of_doubles<double>(box.a.axes[k], 0);
      common[k] = q.pair.axes_a * (double(cuts.flip[k]) * axis);
      half.numbers[3 * row + k] = box.meetings[0].unit * box.half[k];
    }
    write(matrix(common), axes.numbers + 9 * row);
  });
  return pack(&PyTuple_Type, axes, middle, half, features);
}

// The moments of pairs that touch, all by clipping.
inline PyObject* clipped(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) fail(PyExc_TypeError, "clipped(poses_a, poses_b, sizes_a, sizes_b)");
  PairArrays pairs(args, Py_None);
  npy_intp n = pairs.count;
  auto point = make<double>({n, 3}), volume = make<double>({n}),
       covariance = make<double>({n, 3, 3});
  each_query(pairs, [&](Query<double> q, long row) {
    if (depth_floor * q.pair.size + q.axis.separation > 0.0)
      enforce_minimum_depth(q.pair, q.axis, true);
    auto found = overlap_by_clipping<Moments<double>>(q.pair, int(q.axis.face));
    Triple<double> centroid = point_in_common_frame(q.pair, triple(found.centroid));
    write(components<double>(centroid), point.numbers + 3 * row);
    volume.numbers[row] = found.volume;
    for (int k = 0; k < 9; ++k) covariance.numbers[9 * row + k] = found.covariance(k / 3, k % 3);
  });
  return pack(&PyTuple_Type, point, volume, covariance);
}

}  // namespace box_contact::binding
