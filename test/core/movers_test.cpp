// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Finding pairs allocates no memory after the first calls.
#include "box_contact/index.h"

#include <cstdint>
#include <cstdio>
#include <vector>

#include "allocations.hpp"

namespace {

int count_allocating_calls() {
  const int columns = 12, count = columns * columns * columns;
  std::vector<bc_size> sizes(count, {{1.0, 1.0, 1.0}});
  std::vector<bc_pose> poses(count);
  bc_movers* movers;
  bc_near near{};
  near.size = sizeof near;
  int failures = bc_movers_create(sizes.data(), count, 0.0, nullptr, nullptr, &movers);
  long before = 0;
  for (int tick = 0; tick < 400; ++tick) {
    if (tick == 200) before = allocations;
    // Boxes pass each other along x. In every tenth tick, all of them are a metre away.
    for (int k = 0; k < count; ++k) {
      double place[] = {double(k % columns), double(k / columns % columns),
                        double(k / columns / columns)};
      place[tick / 10 % 3] += tick % 10 == 0;
      place[0] += 0.003 * (tick % 100) * (k % 7);
      poses[k] = {{place[0], place[1], place[2]}, {0.0, 0.0, 0.0, 1.0}};
    }
    failures += bc_movers_find(movers, poses.data(), INT64_MAX, &near) != BC_OK;
    failures += near.count < count;
  }
  failures += allocations == 0 || allocations != before;
  bc_movers_destroy(movers);
  std::printf("%lld pairs, %d failures\n", (long long)near.count, failures);
  return failures;
}

}  // namespace

int main() { return count_allocating_calls() != 0; }
