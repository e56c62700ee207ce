// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A pair alone: from its numbers in memory to a contact.
#pragma once

#include "../include/box_contact/box_contact.h"
#include "overlap/exact.hpp"

namespace box_contact::BOX_CONTACT_SET {

BC_INLINE void store(const Triple<double>& v, double* numbers) {
  for (int k = 0; k < 3; ++k) numbers[k] = v[k];
}
BC_INLINE Vec<double> half_of(const double* size) {
  return {0.5 * size[0], 0.5 * size[1], 0.5 * size[2]};
}
BC_INLINE Pose<double> pose_of(const double* p) {
  return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
}

BC_INLINE void store(const PointAndVolume<double>& overlap, bc_contact& contact) {
  contact.volume = overlap.volume;
  for (int k = 0; k < 3; ++k) contact.point[k] = overlap.centroid[k];
}
BC_INLINE void store(const Moments<double>& overlap, bc_contact& contact) {
  contact.volume = overlap.volume;
  for (int k = 0; k < 3; ++k) contact.point[k] = overlap.centroid[k];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) contact.covariance[i][j] = overlap.covariance(i, j);
}

// Returns false, and leaves the contact, if poses or sizes are refused. What is not asked of the model
// stays NaN.
template <class Model>
BC_INLINE bool solve_pair(const Model& model, const detail::PairNumbers& pair, double margin,
                          bc_contact& contact, Counts& counts) {
  Query<double> q;
  query(pose_of(pair.pose_a), pose_of(pair.pose_b), half_of(pair.size_a), half_of(pair.size_b), q);
  if (!q.pair.valid) return false;
  contact.separation = q.axis.separation;
  contact.colliding = q.touching;
  contact.axis = int32_t(q.pair.swapped ? swapped_axis(q.axis.axis) : q.axis.axis);
  const Triple<double> unknown = uniform(not_a_number);
  Triple<double> normal = direction_in_common_frame(q.pair, q.axis.normal);
  // Zeros keep no sign on a swap.
  normal = select(q.pair.swapped, Triple<double>{} - normal, normal);
  store(select(q.touching || q.axis.separation <= margin, normal, unknown), contact.normal);
  store(unknown, contact.point);
  for (double(&row)[3] : contact.covariance) store(unknown, row);
  contact.volume = 0.0;
  if (!q.touching) return true;
  typename Model::template Found<double> overlap;
  model.solve(q, overlap, counts);  // a pair alone is left to nobody
  store(overlap, contact);
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET
