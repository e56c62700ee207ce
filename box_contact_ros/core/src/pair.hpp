// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A pair alone: from its numbers in memory to a contact.
#pragma once

#include "../include/box_contact/box_contact.h"
#include "kernel.hpp"
#include "overlap/moments.hpp"
#include "query.hpp"

namespace box_contact::BOX_CONTACT_SET {

BC_INLINE void store(const Triple<double>& v, double* numbers) {
  for (int k = 0; k < 3; ++k) numbers[k] = v[k];
}
// Numbers in memory, without a copy.
BC_INLINE const Vec<double>& size_at(const double* numbers) {
  return *reinterpret_cast<const Vec<double>*>(numbers);
}
BC_INLINE const Pose<double>& pose_at(const double* numbers) {
  return *reinterpret_cast<const Pose<double>*>(numbers);
}

BC_INLINE void store(const PointAndVolume<double>& overlap, bc_contact& contact) {
  contact.volume = overlap.volume;
  for (int k = 0; k < 3; ++k) contact.point[k] = overlap.centroid[k];
}
BC_INLINE void store(const Moments<double>& overlap, bc_contact& contact) {
  store(static_cast<const PointAndVolume<double>&>(overlap), contact);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) contact.covariance[i][j] = overlap.covariance(i, j);
}

// Returns false, and leaves the contact, if poses or sizes are refused. What is not asked of the model
// stays NaN.
template <class Model>
BC_INLINE bool solve_pair(const Model& model, const detail::PairNumbers& pair, double margin,
                          bc_contact& contact) {
  Query<double> q;
  query(pose_at(pair.pose_a), pose_at(pair.pose_b), size_at(pair.size_a), size_at(pair.size_b), q);
  if (!q.pair.valid) return false;
  contact.separation = q.axis.separation;
  contact.colliding = q.touching;
  contact.axis = q.pair.swapped ? swapped_axis(q.axis.axis) : q.axis.axis;
  const Triple<double> unknown = uniform(not_a_number);
  using Found = typename Model::template Found<double>;
  if (!q.touching || !std::is_same_v<Found, Moments<double>>)
    for (double(&row)[3] : contact.covariance) store(unknown, row);
  if (!q.touching) {
    store(unknown, contact.point);
    contact.volume = 0.0;
    store(unknown, contact.normal);
    if (!(q.axis.separation <= margin)) return true;
  }
  Triple<double> normal = q.pair.axes_a * q.axis.normal;
  // Zeros keep no sign on a swap.
  normal = select(q.pair.swapped, Triple<double>{} - normal, normal);
  store(normal, contact.normal);
  if (!q.touching) return true;
  Found overlap;
  model.solve(q, overlap);  // a pair alone is left to nobody
  store(overlap, contact);
  if constexpr (Found::has_normal) store(triple(overlap.normal), contact.normal);
  return true;
}

}  // namespace box_contact::BOX_CONTACT_SET
