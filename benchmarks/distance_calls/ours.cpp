// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact through its C interface: a single call, and rows.
#include <vector>

#include "../native_calls/contestants.hpp"

namespace {

// Arrays of the results of rows.
struct Found {
  std::vector<double> distance, normal, point_a, point_b;
  explicit Found(size_t n) : distance(n), normal(3 * n), point_a(3 * n), point_b(3 * n) {}
};

}  // namespace

void add_ours(const Poses& poses, size_t calls, Contestants& all) {
  bc_nearest& nearest = *new bc_nearest{};
  nearest.size = sizeof nearest;
  auto call = [&poses, &nearest](size_t i) {
    // call: bc_distance
    bc_distance(&poses.box_a[i], &poses.box_b[i], &nearest);
    // end of call
    return nearest.distance;
  };
  all.push_back(single("bc_distance", calls, call, [&nearest] { return nearest.distance; }));

  Found& found = *new Found(poses.count());
  auto batch = [&poses, &found](size_t) {
    // call: bc_distance_rows
    int64_t n = int64_t(poses.count());
    bc_rows rows = {sizeof rows,         n, n, poses.a.data(), poses.b.data(), poses.size_a.data(),
                    poses.size_b.data(), n, n, nullptr};
    bc_nearest_results results = {sizeof results,       nullptr,
                                  found.distance.data(), found.normal.data(),
                                  found.point_a.data(), found.point_b.data()};
    bc_distance_rows(&rows, &results, 1, nullptr);
    // end of call
  };
  all.push_back({"bc_distance_rows, batch", poses.count(), batch, [=, &found](size_t pair) {
                   if (pair == 0) batch(0);
                   return found.distance[pair];
                 }});
}
