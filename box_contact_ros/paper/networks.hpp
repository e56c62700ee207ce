// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Models `paper`, `paper-continuous` and `paper-committee`: contact point and normal from the source
// paper's networks.
//
// The separating-axis test decides whether the boxes touch, and gives the separation. Then:
//
// 1. `touching_pair`: the box whose face wins is the first box (on an edge axis, A). The boxes are
//    moved apart along the normal until they touch, because the networks know touching boxes only.
// 2. `fold_pair`: symmetries bring the pair into the network's domain (symmetry.hpp).
// 3. `forward`: offset, roll, pitch and yaw → azimuth and elevation of the impact point, seen from
//    the first box's centre, and of the normal. Only this runs in float32. A committee combines the
//    directions of its experts, each weighted by what the classifier says of its class.
// 4. `leave_box`: the impact point is where that direction leaves the first box.
// 5. `contact_in_frame_a`: point and normal go back to A's frame, the point to the middle of the
//    overlap's depth.
//
// Both boxes have one size: cubes of any edge, or the very size that a network was trained for.
#pragma once

#include "../core/src/contact.hpp"
#include "../core/src/library/kernel.hpp"
#include "symmetry.hpp"

namespace box_contact::paper {

// Of a network: t_x t_y t_z roll pitch yaw → azimuth and elevation of the point, of the normal.
constexpr long input_count = 6, output_count = 4;
// Most units of a layer.
constexpr long most_units = 256;
// Experts of a committee: vertex, edge, face. Its classifier has an output for each.
constexpr int expert_count = 3;
constexpr int most_networks = 1 + expert_count;
// Relative difference of extents up to which two sizes are one, and a size that of the weights.
constexpr double same_size = 1e-6;

// A network in memory: units of the layers from the inputs on (6 20 18 4), then for each layer after
// the inputs its weights (outputs × inputs, row by row) and its biases.
struct Network {
  const float* widths;
  long layers;  // the inputs among them
  const float* parameters;

  long width(long layer) const { return long(widths[layer]); }
  long outputs() const { return width(layers - 1); }
  // How many parameters it has, or −1 if there are fewer than two layers, one without units or with
  // too many, or more parameters than `most`.
  long parameter_count(long most) const {
    long count = layers < 2 ? -1 : 0;
    for (long layer = 0; layer < layers && count >= 0; ++layer) {
      bool possible = widths[layer] >= 1.0f && widths[layer] <= float(most_units);
      if (possible && layer > 0) count += (width(layer - 1) + 1) * width(layer);
      if (!possible || count > most) count = -1;
    }
    return count;
  }
};

// The values of the units of two neighbouring layers.
struct Units {
  float layers[2][most_units];
};

// Run a network on inputs. Returns its outputs, in `units`. Hidden units are tanh.
inline const float* forward(const Network& network, const float* inputs, Units& units) {
  const float *from = inputs, *parameters = network.parameters;
  for (long layer = 1; layer < network.layers; ++layer) {
    long count = network.width(layer - 1), outputs = network.width(layer);
    const float* biases = parameters + count * outputs;
    bool hidden = layer + 1 < network.layers;
    float* to = units.layers[layer % 2];
    for (long unit = 0; unit < outputs; ++unit) {
      float total = biases[unit];
      for (long k = 0; k < count; ++k) total += parameters[unit * count + k] * from[k];
      to[unit] = hidden ? std::tanh(total) : total;
    }
    from = to;
    parameters = biases + outputs;
  }
  return from;
}

// The networks of a model, in the numbers that Python packs: `fold_to`, the extents of the boxes,
// and for each network the number of its layers, their units and its parameters.
struct PaperModel {
  FoldTo fold_to = FoldTo::nothing;
  Vec<double> size{};  // full extents [m] of the boxes of the weights
  bool cubes = false;  // the weights are for cubes of edge 2, and so for cubes of any edge
  int count = 0;  // 1; with `FoldTo::features` one a subset; of a committee, the classifier first
  Network networks[most_networks];

  // `count` stays 0 where the numbers are something else.
  explicit PaperModel(const detail::NetworkNumbers& packed) {
    const float *at = packed.numbers, *end = at + packed.count;
    if (packed.count < 5) return;
    fold_to = FoldTo(int(*at++));
    for (int k = 0; k < 3; ++k) size[k] = *at++;
    cubes = size[0] == size[1] && size[1] == size[2];
    int found = 0;
    for (; at < end && found < most_networks; ++found) {
      long layers = *at >= 2.0f && *at < float(end - at) ? long(*at) : 0;
      Network& network = networks[found] = {at + 1, layers, at + 1 + layers};
      long parameters = network.parameter_count(end - network.parameters);
      long wanted = output_count;
      if (found == 0 && fold_to == FoldTo::octant && at + 1 + layers + parameters < end)
        wanted = expert_count;  // more follow: the classifier of a committee
      if (parameters < 0 || network.width(0) != input_count || network.outputs() != wanted) return;
      at = network.parameters + parameters;
    }
    int expected = fold_to == FoldTo::features ? 2 : is_committee(found) ? most_networks : 1;
    if (at == end && found == expected) count = found;
  }
  static bool is_committee(int networks) { return networks == most_networks; }

  // Whether it answers for two boxes of these half extents.
  bool fits(const Vec<double>& half_a, const Vec<double>& half_b) const {
    bool fit = count > 0;
    for (int k = 0; k < 3; ++k) {
      double wanted = cubes ? half_a[0] : 0.5 * size[k];
      fit = fit && std::abs(half_a[k] - half_b[k]) <= same_size * half_a[k] &&
            std::abs(half_a[k] - wanted) <= same_size * wanted;
    }
    return fit;
  }
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

// Directions of the impact point and of the normal, in a network's domain.
struct Directions {
  Vec<double> point, normal;
};

inline Directions directions(const Network& network, const float* inputs, Units& units) {
  const float* out = forward(network, inputs, units);
  return {direction_from_angles(out[0], out[1]), direction_from_angles(out[2], out[3])};
}

// The experts' mean. Weights are what the classifier says of their classes, negative ones 0. The
// likeliest expert answers alone where no other has a weight, or where the normals cancel.
inline Directions of_committee(const Network* networks, const float* inputs, Units& units) {
  double weights[expert_count];
  const float* out = forward(networks[0], inputs, units);
  for (int k = 0; k < expert_count; ++k) weights[k] = std::max(0.0f, out[k]);
  int likeliest = int(std::max_element(out, out + expert_count) - out);
  Directions mean{}, first{};
  for (int k = 0; k < expert_count; ++k) {
    Directions one = directions(networks[1 + k], inputs, units);
    if (k == likeliest) first = one;
    mean.point = mean.point + weights[k] * one.point;
    mean.normal = mean.normal + weights[k] * one.normal;
  }
  double length = std::sqrt(dot(mean.normal, mean.normal));
  if (!(length > 0.0 && dot(mean.point, mean.point) > 0.0)) return first;
  return {mean.point, (1.0 / length) * mean.normal};
}

// The networks' answer for a touching pair, in the first box's frame: the impact point, and the
// normal to the second box. `half` are the half extents of either box.
inline PointAndNormal ask(const PaperModel& model, const TouchingPair& pair,
                          const Vec<double>& half, Units& units) {
  Placement second = pair.second;
  if (model.cubes)
    for (int k = 0; k < 3; ++k) second.offset[k] /= half[0];
  Fold fold = fold_pair(model.fold_to, second, pair.axis, pair.normal);
  Vec<double> angles = euler_angles(fold.placement.rotation);
  float inputs[input_count];
  for (int k = 0; k < 3; ++k) {
    inputs[k] = float(fold.placement.offset[k]);
    inputs[3 + k] = float(angles[k]);
  }
  Directions found =
      PaperModel::is_committee(model.count)
          ? of_committee(model.networks, inputs, units)
          : directions(model.networks[fold.subset == Subset::edge_edge], inputs, units);
  // The ray is folded back before it leaves the box: a container's extents would change places.
  return {leave_box(transposed_times(fold.map_first, found.point), half),
          transposed_times(fold.map_first, found.normal)};
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

// Solve rows `begin` to `end`, as a kernel does. Returns the first row whose poses or sizes are
// refused, or −1; what is written to such a row has no meaning.
inline long solve_rows(const detail::NetworkNumbers& packed, const Rows& rows, long begin, long end,
                       const Results& results, Counts&) {
  PaperModel model(packed);
  Units units;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  long refused = -1;
  for (long row = begin; row < end; ++row) {
    Query<double> q;
    query_rows(rows, row, row + 1, q);
    bool valid = q.pair.valid && model.fits(q.pair.half_a, q.pair.half_b);
    if (!valid && refused < 0) refused = row;
    PointAndNormal contact{{nan, nan, nan}, {nan, nan, nan}};
    if (q.touching && valid) {
      TouchingPair pair = touching_pair(q);
      contact = contact_in_frame_a(q, pair, ask(model, pair, q.pair.half_a, units));
      contact = {point_in_common_frame(q.pair, contact.point),
                 direction_in_common_frame(q.pair, contact.normal)};
    }
    results.colliding[row] = q.touching;
    results.separation[row] = q.axis.separation;
    results.axis[row] = int32_t(q.axis.axis);
    for (int k = 0; k < 3; ++k) results.normal[3 * row + k] = contact.normal[k];
    for (int k = 0; k < 3; ++k) results.point[3 * row + k] = contact.point[k];
    if (results.volume) results.volume[row] = q.touching ? nan : 0.0;
    if (results.covariance) std::fill_n(results.covariance + 9 * row, 9, nan);
  }
  return refused;
}

}  // namespace box_contact::paper
