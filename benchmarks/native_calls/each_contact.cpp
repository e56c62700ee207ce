// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact's calls of contacts, each timed alone.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <numeric>
#include <random>

#include "contestants.hpp"

namespace {

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
