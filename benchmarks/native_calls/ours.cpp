// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact through its C interface: models `exact` and `mlp`, single calls and batches.
#include <memory>

#include "contestants.hpp"

namespace {

// Arrays of the results of a batch.
struct Found {
  std::unique_ptr<bool[]> colliding;
  std::vector<double> separation, normal, point, volume, covariance;

  explicit Found(size_t n)
      : colliding(new bool[n]),
        separation(n),
        normal(3 * n),
        point(3 * n),
        volume(n),
        covariance(9 * n) {}
};

void add(const Poses& poses, size_t calls, bc_model model, bc_patch patch, Contestants& all) {
  bc_options options = BC_DEFAULT_OPTIONS;
  options.model = model;
  bc_solver* solver;
  if (bc_solver_create(&poses.size_a[0], &poses.size_b[0], &options, &solver) != BC_OK)
    fail(bc_error_text());
  std::string name = model == BC_EXACT ? "exact" : "mlp";
  name += patch == BC_VOLUME ? " volume" : " covariance";

  bc_contact& contact = *new bc_contact;
  auto call = [=, &poses, &contact](size_t i) {
    // call: bc_solve
    bc_solve(solver, &poses.a[i], &poses.b[i], &poses.size_a[i], &poses.size_b[i], patch, &contact);
    // end of call
    return contact.separation;
  };
  all.push_back(single(name, calls, call, [&contact] { return contact.separation; }));

  Found& found = *new Found(poses.count());
  auto batch = [=, &poses, &found](size_t) {
    // call: bc_solve_rows
    bc_rows rows = {sizeof rows,         int64_t(poses.count()), poses.a.data(), poses.b.data(),
                    poses.size_a.data(), poses.size_b.data(),    nullptr,        0};
    double* covariance = patch == BC_VOLUME ? nullptr : found.covariance.data();
    bc_results results = {sizeof results,
                          found.colliding.get(),
                          found.separation.data(),
                          found.normal.data(),
                          found.point.data(),
                          found.volume.data(),
                          covariance,
                          nullptr};
    bc_solve_rows(solver, &rows, &results, 1, nullptr);
    // end of call
  };
  all.push_back({name + ", batch", poses.count(), batch, [=, &found](size_t pair) {
                   if (pair == 0) batch(0);
                   return found.separation[pair];
                 }});
}

}  // namespace

void add_ours(const Poses& poses, size_t calls, Contestants& all) {
  for (bc_model model : {BC_EXACT, BC_MLP})
    for (bc_patch patch : {BC_VOLUME, BC_COVARIANCE}) add(poses, calls, model, patch, all);
}
