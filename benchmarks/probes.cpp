// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Probes: what lies behind the answers of the core. probes.py compiles and calls them.
#include <algorithm>
#include <cstdint>

#include "mlp/mlp_model.hpp"
#include "overlap/exact.hpp"
#include "rows.hpp"

namespace {

using namespace box_contact::BOX_CONTACT_SET;
using box_contact::detail::Rows;

void write(const Triple<double>& v, double* numbers) {
  for (int k = 0; k < 3; ++k) numbers[k] = v[k];
}

// Call probe(query, row) for each row. Returns the first whose poses or sizes are refused, or −1.
template <class Probe>
int64_t each_query(int64_t count, const double* const* pairs, Probe probe) {
  Rows rows{pairs[0], pairs[1], pairs[2], pairs[3], 3, 3};
  for (int64_t row = 0; row < count; ++row) {
    Query<double> q;
    query_rows(rows, row, row + 1, q);
    if (!q.pair.valid) return row;
    probe(q, row);
  }
  return -1;
}

// Whether planes are certain of a pair that touches, so that it is not clipped.
bool are_certain(const Query<double>& q) {
  if (are_parallel(q.pair)) return true;
  Pressed<double> pressed(q);
  planes::PairOfBoxes<double> boxes(q.pair, q.axis, pressed.from_a, pressed.from_b, pressed.depth);
  Moments<double> found;
  auto by_planes = any_of(boxes.p.both | boxes.q.both) ? overlap_by_planes<true, Moments<double>, double>
                                                       : overlap_by_planes<false, Moments<double>, double>;
  auto certificate = by_planes(q.pair, boxes, pressed.origin_b, pressed_depth(q), found);
  return certificate.holds || (certificate.cancelled && find_about(q, pressed, found.centroid, found));
}

}  // namespace

extern "C" {

// `pairs`: poses and sizes of A and B. Patch boxes of pairs that touch: axes as columns (3, 3), middle
// (3) and half extents (3), common frame [m], and the network's features, mirrored as the axes are.
int64_t patch_boxes(int64_t count, const double* const* pairs, double* axes, double* middle,
                    double* half, double* features) {
  constexpr int feature_count = box_contact::detail::network_features;
  return each_query(count, pairs, [&](const Query<double>& q, int64_t row) {
    const Query<double>* queries[] = {&q};
    mlp::PatchBox<double> box(queries);
    mlp::Features<float> found(box);
    std::copy_n(found.numbers, feature_count, features + feature_count * row);
    write(point_in_common_frame(q.pair, box.point(box.centre, 0)), middle + 3 * row);
    for (int k = 0; k < 3; ++k) {
      auto axis = k == 2 ? q.axis.normal : triple_of_doubles<double>(box.a.axes[k], 0);
      Triple<double> common = q.pair.axes_a * (double(found.flip[k]) * axis);
      for (int i = 0; i < 3; ++i) axes[9 * row + 3 * i + k] = common[i];
      half[3 * row + k] = box.meetings[0].unit * box.half[k];
    }
  });
}

// Point, volume and covariance of pairs that touch, all by clipping.
int64_t clipped(int64_t count, const double* const* pairs, double* point, double* volume,
                double* covariance) {
  return each_query(count, pairs, [&](Query<double> q, int64_t row) {
    if (depth_floor * q.pair.size + q.axis.separation > 0.0)
      enforce_minimum_depth(q.pair, q.axis, true);
    auto found = overlap_by_clipping<Moments<double>>(q.pair, int(q.axis.face));
    write(triple(found.centroid), point + 3 * row);
    volume[row] = found.volume;
    for (int k = 0; k < 9; ++k) covariance[9 * row + k] = found.covariance(k / 3, k % 3);
  });
}

// Whether pairs are clipped: those that touch and of which planes are not certain.
int64_t is_clipped(int64_t count, const double* const* pairs, bool* found) {
  return each_query(count, pairs, [&](const Query<double>& q, int64_t row) {
    found[row] = q.touching && !are_certain(q);
  });
}

}  // extern "C"
