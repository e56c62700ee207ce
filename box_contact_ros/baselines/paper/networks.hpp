// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Models `paper` and `paper-continuous`: contact point and normal from the source paper's networks.
//
// The separating-axis test decides whether the boxes touch, and gives the separation. Then:
//
// 1. `touching_pair`: the box whose face wins is the first box (on an edge axis, A). The boxes are
//    moved apart along the normal until they touch, because the networks know touching boxes only.
// 2. `fold_pair`: symmetries bring the pair into the network's domain (symmetry.hpp).
// 3. `forward`: offset, roll, pitch and yaw → azimuth and elevation of the impact point, seen from
//    the first box's centre, and of the normal. Only this runs in float32.
// 4. `leave_box`: the impact point is where that direction leaves the first box.
// 5. `contact_in_frame_a`: point and normal go back to A's frame, the point to the middle of the
//    overlap's depth.
//
// Both boxes have one size: cubes of any edge, or the very size that a network was trained for.
#pragma once

#include <vector>

#include "../../core/src/contact.hpp"
#include "symmetry.hpp"

namespace box_contact::paper {

// Of a network: t_x t_y t_z roll pitch yaw → azimuth and elevation of the point, of the normal.
constexpr long input_count = 6, output_count = 4;

// Units of the layers of a network, inputs first: 6 20 18 4.
using Widths = std::vector<long>;

// How many numbers a network of these widths has.
inline long parameter_count(const Widths& widths) {
  long count = 0;
  for (size_t layer = 1; layer < widths.size(); ++layer)
    count += (widths[layer - 1] + 1) * widths[layer];
  return count;
}

// The values of the units of two neighbouring layers.
struct Units {
  std::vector<float> layer, next;

  explicit Units(const Widths& widths)
      : layer(*std::max_element(widths.begin(), widths.end())), next(layer.size()) {}
};

// Run a network on the inputs in `units.layer`, and leave the outputs there. `parameters` has for
// each layer the weights (outputs × inputs, row by row), then the biases. Hidden units are tanh.
inline void forward(const float* parameters, const Widths& widths, Units& units) {
  for (size_t layer = 1; layer < widths.size(); ++layer) {
    long inputs = widths[layer - 1], outputs = widths[layer];
    const float* biases = parameters + inputs * outputs;
    bool hidden = layer + 1 < widths.size();
    for (long unit = 0; unit < outputs; ++unit) {
      float total = biases[unit];
      for (long k = 0; k < inputs; ++k) total += parameters[unit * inputs + k] * units.layer[k];
      units.next[unit] = hidden ? std::tanh(total) : total;
    }
    std::swap(units.layer, units.next);
    parameters = biases + outputs;
  }
}

// The networks of a model.
struct Networks {
  std::vector<const float*> parameters;  // one network, or with `FoldTo::features` one a subset
  Widths widths;                         // of each of them
  bool cubes;                            // they were trained on cubes of edge 2
  FoldTo fold_to;
};

// A pair in its first box's frame, the boxes moved apart by the depth of their overlap.
struct TouchingPair {
  bool first_is_b;
  int axis;            // winning axis: 0–2 face of the first box, 6–14 edges
  double depth;        // [m]
  Vec<double> normal;  // from the first to the second box
  Placement second;
};

inline TouchingPair touching_pair(const Query<double>& q) {
  const Pair<double>& pair = q.pair;
  TouchingPair found;
  found.axis = int(q.axis.axis);
  found.depth = -q.axis.separation;
  found.first_is_b = 3 <= found.axis && found.axis < 6;
  if (found.first_is_b) {
    found.axis -= 3;
    found.normal = -transposed_times(pair.rotation, q.axis.normal);
    found.second = {-pair.offset_b + found.depth * found.normal, transpose(pair.rotation)};
  } else {
    found.normal = q.axis.normal;
    found.second = {pair.offset_a + found.depth * found.normal, pair.rotation};
  }
  return found;
}

// The unit vector of an azimuth (from x towards y) and an elevation (towards z) [rad].
inline Vec<double> direction_from_angles(double azimuth, double elevation) {
  double level = std::cos(elevation);
  return {level * std::cos(azimuth), level * std::sin(azimuth), std::sin(elevation)};
}

// Where a ray from the centre of a box leaves the box [m].
inline Vec<double> leave_box(const Vec<double>& direction, const Vec<double>& half) {
  Vec<double> relative;
  for (int k = 0; k < 3; ++k) relative[k] = std::abs(direction[k]) / half[k];
  double reach = largest(relative);
  return {direction[0] / reach, direction[1] / reach, direction[2] / reach};
}

struct PointAndNormal {
  Vec<double> point;   // [m]
  Vec<double> normal;  // unit vector
};

// The networks' answer for a touching pair, in the first box's frame: the impact point, and the
// normal to the second box. `half` are the half extents of either box.
inline PointAndNormal ask(const Networks& networks, const TouchingPair& pair,
                          const Vec<double>& half, Units& units) {
  Placement second = pair.second;
  if (networks.cubes)
    for (int k = 0; k < 3; ++k) second.offset[k] /= half[0];
  Fold fold = fold_pair(networks.fold_to, second, pair.axis, pair.normal);
  Vec<double> angles = euler_angles(fold.placement.rotation);
  for (int k = 0; k < 3; ++k) {
    units.layer[k] = float(fold.placement.offset[k]);
    units.layer[3 + k] = float(angles[k]);
  }
  forward(networks.parameters[fold.subset == Subset::edge_edge], networks.widths, units);
  const float* out = units.layer.data();
  // The ray is folded back before it leaves the box: a container's extents would change places.
  Vec<double> ray = transposed_times(fold.map_first, direction_from_angles(out[0], out[1]));
  Vec<double> normal = transposed_times(fold.map_first, direction_from_angles(out[2], out[3]));
  return {leave_box(ray, half), normal};
}

// An answer of the networks in A's frame. The first box's surface lies half the depth beyond the
// middle of the overlap.
inline PointAndNormal contact_in_frame_a(const Query<double>& q, const TouchingPair& pair,
                                         const PointAndNormal& answer) {
  double half_depth = 0.5 * pair.depth;
  const Vec<double>& sat_normal = q.axis.normal;
  if (!pair.first_is_b) return {answer.point - half_depth * sat_normal, answer.normal};
  return {q.pair.offset_a + half_depth * sat_normal + q.pair.rotation * answer.point,
          -(q.pair.rotation * answer.normal)};
}

// Solve rows 0 to `count`. Returns the first row whose poses or sizes are refused, or −1; what is
// written to such a row has no meaning.
inline long solve(const Networks& networks, const Rows& rows, long count, const Results& results) {
  Units units(networks.widths);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  long refused = -1;
  for (long row = 0; row < count; ++row) {
    Query<double> q;
    query_rows(rows, row, row + 1, q);
    if (!q.pair.valid && refused < 0) refused = row;
    PointAndNormal contact{{nan, nan, nan}, {nan, nan, nan}};
    if (q.touching) {
      TouchingPair pair = touching_pair(q);
      contact = contact_in_frame_a(q, pair, ask(networks, pair, q.pair.half_a, units));
      contact = {point_in_common_frame(q.pair, contact.point),
                 direction_in_common_frame(q.pair, contact.normal)};
    }
    results.colliding[row] = q.touching;
    results.separation[row] = q.axis.separation;
    for (int k = 0; k < 3; ++k) results.normal[3 * row + k] = contact.normal[k];
    for (int k = 0; k < 3; ++k) results.point[3 * row + k] = contact.point[k];
  }
  return refused;
}

}  // namespace box_contact::paper
