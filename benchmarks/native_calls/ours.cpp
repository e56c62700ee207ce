// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact through its C interface: models `exact` and `mlp`, single calls and batches.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numeric>
#include <random>

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
  bc_query query = bc_default_query();
  query.model = model;
  query.patch = patch;
  std::string name = model == BC_EXACT ? "exact" : "mlp";
  name += patch == BC_VOLUME ? " volume" : " covariance";

  bc_contact& contact = *new bc_contact;
  auto call = [=, &poses, &contact](size_t i) {
    // call: bc_collide
    bc_collide(&poses.box_a[i], &poses.box_b[i], &query, &contact);
    // end of call
    return contact.separation;
  };
  all.push_back(single(name, calls, call, [&contact] { return contact.separation; }));

  Found& found = *new Found(poses.count());
  auto batch = [=, &poses, &found](size_t) {
    // call: bc_collide_rows
    int64_t n = int64_t(poses.count());
    bc_rows rows = {sizeof rows,         n, n, poses.a.data(), poses.b.data(), poses.size_a.data(),
                    poses.size_b.data(), n, n, nullptr};
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
  all.push_back({name + ", batch", poses.count(), batch, [=, &found](size_t pair) {
                   if (pair == 0) batch(0);
                   return found.separation[pair];
                 }});
}

using Clock = std::chrono::steady_clock;

double nanoseconds(Clock::duration time) {
  return std::chrono::duration<double, std::nano>(time).count();
}

// What two readings of the clock take with nothing between them [ns], the least of many.
double empty_reading() {
  double least = APART;
  for (int k = 0; k < 100000; ++k) {
    Clock::time_point start = Clock::now();
    least = std::min(least, nanoseconds(Clock::now() - start));
  }
  return least;
}

}  // namespace

void time_each_contact(const Poses& poses, size_t passes) {
  double clock = empty_reading();
  bc_query query = bc_default_query();
  query.patch = BC_COVARIANCE;
  bc_contact contact;
  std::vector<double> least[2];
  for (auto& times : least) times.assign(poses.count(), APART);
  // Each pass goes through all contacts in another order. No branch is known from the call before, and
  // no contact comes first each time after a change of model, or of set, when code is not in the cache.
  std::vector<size_t> order(poses.count());
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 random;
  for (size_t pass = 0; pass < passes; ++pass) {
    std::shuffle(order.begin(), order.end(), random);
    for (bc_model model : {BC_EXACT, BC_MLP}) {
      query.model = model;
      std::vector<double>& times = least[model == BC_MLP];
      for (size_t i : order) {
        bc_box a = poses.box_a[i], b = poses.box_b[i];  // in the cache before the clock starts
        Clock::time_point start = Clock::now();
        bc_collide(&a, &b, &query, &contact);
        times[i] = std::min(times[i], nanoseconds(Clock::now() - start) - clock);
        kept += contact.separation;
      }
    }
  }
  for (size_t i = 0; i < poses.count(); ++i) std::printf("%.1f\t%.1f\n", least[0][i], least[1][i]);
}

void add_ours(const Poses& poses, size_t calls, Contestants& all) {
  for (bc_model model : {BC_EXACT, BC_MLP})
    for (bc_patch patch : {BC_VOLUME, BC_COVARIANCE}) add(poses, calls, model, patch, all);
}
