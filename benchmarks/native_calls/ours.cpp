// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact through its C interface: contacts by models `exact` and `mlp`, and distances, single
// calls and batches.
#include <memory>

#include "contestants.hpp"

namespace {

// Arrays of the results of a batch.
struct Contacts {
  std::unique_ptr<bool[]> colliding;
  std::vector<double> separation, normal, point, volume, covariance;

  explicit Contacts(size_t n)
      : colliding(new bool[n]),
        separation(n),
        normal(3 * n),
        point(3 * n),
        volume(n),
        covariance(9 * n) {}
};

struct Distances {
  std::vector<double> distance, normal, point_a, point_b;
  explicit Distances(size_t n) : distance(n), normal(3 * n), point_a(3 * n), point_b(3 * n) {}
};

bc_rows rows_of(const Poses& poses) {
  int64_t n = int64_t(poses.count());
  return {sizeof(bc_rows),     n, n, poses.a.data(), poses.b.data(), poses.size_a.data(),
          poses.size_b.data(), n, n, nullptr};
}

void add_contacts(const Poses& poses, size_t calls, bc_model model, bc_patch patch,
                  Contestants& all) {
  bc_query query = bc_default_query();
  query.model = model;
  query.patch = patch;
  std::string name = model == BC_EXACT ? "exact" : "mlp";
  name += patch == BC_VOLUME ? " volume" : " covariance";

  bc_contact& contact = *new bc_contact;
  auto call = [=, &poses, &contact](size_t i) {
    // contact: bc_collide
    bc_collide(&poses.box_a[i], &poses.box_b[i], &query, &contact);
    // end of call
    return contact.separation;
  };
  all.push_back(single(name, calls, call, [&contact] { return contact.separation; }));

  Contacts& found = *new Contacts(poses.count());
  auto batch = [=, &poses, &found](size_t) {
    // contact: bc_collide_rows
    bc_rows rows = rows_of(poses);
    double* covariance = patch == BC_VOLUME ? nullptr : found.covariance.data();
    bc_results results = {sizeof results,
                          found.colliding.get(),
                          found.separation.data(),
                          found.normal.data(),
                          found.point.data(),
                          found.volume.data(),
                          covariance,
                          nullptr};
    bc_collide_rows(&rows, &query, &results, 1, nullptr);
    // end of call
  };
  all.push_back(batched(name, poses.count(), batch, found.separation.data()));
}

void add_distances(const Poses& poses, size_t calls, Contestants& all) {
  bc_nearest& nearest = *new bc_nearest{};
  nearest.size = sizeof nearest;
  auto call = [&poses, &nearest](size_t i) {
    // distance: bc_distance
    bc_distance(&poses.box_a[i], &poses.box_b[i], &nearest);
    // end of call
    return nearest.distance;
  };
  all.push_back(single("bc_distance", calls, call, [&nearest] { return nearest.distance; }));

  Distances& found = *new Distances(poses.count());
  auto batch = [&poses, &found](size_t) {
    // distance: bc_distance_rows
    bc_rows rows = rows_of(poses);
    bc_nearest_results results = {sizeof results,        nullptr,
                                  found.distance.data(), found.normal.data(),
                                  found.point_a.data(),  found.point_b.data()};
    bc_distance_rows(&rows, &results, 1, nullptr);
    // end of call
  };
  all.push_back(batched("bc_distance_rows", poses.count(), batch, found.distance.data()));
}

}  // namespace

void add_ours(Query query, const Poses& poses, size_t calls, Contestants& all) {
  if (query == Query::distance) return add_distances(poses, calls, all);
  for (bc_model model : {BC_EXACT, BC_MLP})
    for (bc_patch patch : {BC_VOLUME, BC_COVARIANCE}) add_contacts(poses, calls, model, patch, all);
}
