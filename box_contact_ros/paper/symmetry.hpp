// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Box symmetries: they bring any touching pair into the networks' domain, and the answer back.
//
// A box stays the same when an axis changes its sign. A cube also stays the same when two axes
// change places. The whole pair may be reflected. Let t be the second box's offset, and R its
// orientation, in the first box's frame. A fold replaces them:
//
//     t' = M t,   R' = M R Nᵀ,   det M · det N = 1.
//
// M and N are signed permutations, chosen from the pose alone. The folded pair is a pair of the
// same boxes. Points and directions of its contact go back by Mᵀ.
#pragma once

#include <algorithm>

#include "../core/src/lanes/vectors.hpp"

namespace box_contact::paper {

// The second box in the first box's frame.
struct Placement {
  Vec<double> offset;    // t [m]
  Mat<double> rotation;  // R: the second box's axes as columns
};

// Ways into a network's domain.
enum class FoldTo {
  nothing,   // the pair stays as it is
  octant,    // boxes of any shape: t' ≥ 0, and roll, pitch and yaw in [−π/2, π/2]
  features,  // cubes: the features that meet become the reference features
};

// Subsets on which the map from pose to contact has no discontinuity, with the features that are
// their reference.
enum class Subset {
  none = -1,
  vertex_face,  // face +x of the first box, vertex (−, −, −) of the second
  edge_edge,    // the first box's edge along z at (+, +), the second's along y at (−, −)
};

// A folded pair.
struct Fold {
  Mat<double> map_first{}, map_second{};  // M and N
  Placement placement{};                  // t' and R'
  Subset subset = Subset::none;
};

inline double sign(double x) { return x >= 0.0 ? 1.0 : -1.0; }

inline double determinant(const Mat<double>& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

// Set t' and R'. The sums for R' begin with +0, so no entry is −0, which `atan2` would tell apart.
inline void apply(Fold& fold, const Placement& placement) {
  const Mat<double>&m = fold.map_first, &n = fold.map_second;
  fold.placement.offset = m * placement.offset;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double total = 0.0;
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l) total += m[i][k] * placement.rotation[k][l] * n[j][l];
      fold.placement.rotation[i][j] = total;
    }
}

// Reflect along the folded z axis if det M · det N = −1: the sign of M's third row is free.
inline void make_proper(Fold& fold) {
  if (determinant(fold.map_first) * determinant(fold.map_second) < 0.0)
    for (double& entry : fold.map_first.m[2]) entry = -entry;
}

inline Fold fold_to_nothing(const Placement& placement) {
  Fold fold;
  for (int k = 0; k < 3; ++k) fold.map_first[k][k] = fold.map_second[k][k] = 1.0;
  apply(fold, placement);
  return fold;
}

inline Fold fold_to_octant(const Placement& placement) {
  const Vec<double>& t = placement.offset;
  const Mat<double>& r = placement.rotation;
  Fold fold;
  Mat<double>&m = fold.map_first, &n = fold.map_second;
  for (int k = 0; k < 3; ++k) m[k][k] = sign(t[k]);
  n[0][0] = sign(m[0][0] * r[0][0]);  // cos(yaw) cos(pitch) ≥ 0
  n[2][2] = sign(m[2][2] * r[2][2]);  // cos(pitch) cos(roll) ≥ 0
  n[1][1] = (m[0][0] * m[1][1] * m[2][2]) * (n[0][0] * n[2][2]);
  apply(fold, placement);
  return fold;
}

// A vertex of the second box on the face `axis` (0–2) of the first; `normal` points to the second.
inline Fold fold_vertex_face(const Placement& placement, int axis, const Vec<double>& normal) {
  const Mat<double>& r = placement.rotation;
  Fold fold;
  fold.subset = Subset::vertex_face;
  Mat<double>&m = fold.map_first, &n = fold.map_second;
  // M takes the face to +x. N takes the vertex to (−, −, −). N also orders the vertex's edges by
  // how steeply they rise from the face, the steepest first. Equally steep edges keep their order.
  double side = sign(normal[axis]);
  m[0][axis] = side;
  Vec<double> rise = side * row(r, axis), steepness = abs(rise);
  int steepest = 0;
  for (int j = 0; j < 3; ++j) {
    int rank = 0;
    for (int k = 0; k < 3; ++k)
      rank += steepness[k] > steepness[j] || (steepness[k] == steepness[j] && k < j);
    n[rank][j] = sign(rise[j]);
    if (rank == 0) steepest = j;
  }
  // Of the four turns of the face, M takes the one that brings the projection of the steepest edge
  // onto the face within 45° of −y.
  int a = (axis + 1) % 3, b = (axis + 2) % 3;
  Vec<double> projection = sign(rise[steepest]) * column(r, steepest);
  if (std::abs(projection[a]) < std::abs(projection[b])) std::swap(a, b);
  m[1][a] = -sign(projection[a]);
  m[2][b] = 1.0;
  make_proper(fold);
  apply(fold, placement);
  return fold;
}

// The first box's edge along axis `i` meets the second's along `j`; `normal` points to the second.
inline Fold fold_edge_edge(const Placement& placement, int i, int j, const Vec<double>& normal) {
  const Mat<double>& r = placement.rotation;
  Fold fold;
  fold.subset = Subset::edge_edge;
  Mat<double>&m = fold.map_first, &n = fold.map_second;
  // M takes the edge to z, and its two faces to +x and +y. The face nearer to the normal is +x.
  int a = (i + 1) % 3, b = (i + 2) % 3;
  if (std::abs(normal[a]) < std::abs(normal[b])) std::swap(a, b);
  m[0][a] = sign(normal[a]);
  m[1][b] = sign(normal[b]);
  m[2][i] = 1.0;
  // N takes the second box's edge to y, pointing along the first box's y, and its two faces to −x
  // and −z. The face nearer to the normal is −x.
  Vec<double> normal_in_second = transposed_times(r, normal);
  int c = (j + 1) % 3, d = (j + 2) % 3;
  if (std::abs(normal_in_second[c]) < std::abs(normal_in_second[d])) std::swap(c, d);
  n[0][c] = sign(normal_in_second[c]);
  n[1][j] = sign(sign(normal[b]) * r[b][j]);
  n[2][d] = sign(normal_in_second[d]);
  make_proper(fold);
  apply(fold, placement);
  return fold;
}

// Whether `axis` is a face of the first box (0–2) or a pair of edges (6 + 3 i + j).
inline bool has_reference_features(long axis) {
  return (0 <= axis && axis < 3) || (6 <= axis && axis < 15);
}

// Fold a pair. `axis` and `normal` are those of the separating-axis test, in the first box's frame;
// only `FoldTo::features` reads them.
inline Fold fold_pair(FoldTo to, const Placement& placement, int axis, const Vec<double>& normal) {
  switch (to) {
    case FoldTo::octant:
      return fold_to_octant(placement);
    case FoldTo::features:
      return axis < 3 ? fold_vertex_face(placement, axis, normal)
                      : fold_edge_edge(placement, (axis - 6) / 3, (axis - 6) % 3, normal);
    default:
      return fold_to_nothing(placement);
  }
}

// Roll, pitch and yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll).
inline Vec<double> euler_angles(const Mat<double>& r) {
  return {std::atan2(r[2][1], r[2][2]), std::asin(std::min(1.0, std::max(-1.0, -r[2][0]))),
          std::atan2(r[1][0], r[0][0])};
}

}  // namespace box_contact::paper
