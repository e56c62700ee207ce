// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Finding pairs allocates no memory after the first calls. A call that is told which boxes changed finds
// what one finds that reads them all.
#include "box_contact/broad_phase.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <random>
#include <vector>

#include "allocations.hpp"

namespace {

int count_allocating_calls() {
  const int columns = 12, count = columns * columns * columns;
  std::vector<bc_size> sizes(count, {{1.0, 1.0, 1.0}});
  std::vector<bc_pose> poses(count);
  bc_boxes boxes{};
  boxes.size = sizeof boxes, boxes.count = count, boxes.sizes = sizes.data();
  bc_broad_phase* phase;
  bc_near near{};
  near.size = sizeof near;
  int failures = bc_broad_phase_create(&boxes, &phase);
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
    failures += bc_broad_phase_find(phase, poses.data(), INT64_MAX, &near) != BC_OK;
    failures += near.count < count;
  }
  failures += allocations == 0 || allocations != before;
  bc_broad_phase_destroy(phase);
  std::printf("%lld pairs, %d failures\n", (long long)near.count, failures);
  return failures;
}

// Boxes rest, move, come, go, get other sizes and bad poses; some are fixed, some pairs are listed.
int count_wrong_answers() {
  const int count = 200;
  std::mt19937 random(7);
  auto below = [&random](int limit) { return int(random() % unsigned(limit)); };
  auto place = [](int k) {
    return bc_pose{{1.01 * (k % 10), 1.01 * (k / 10), 0.0}, {0.0, 0.0, 0.0, 1.0}};
  };
  auto one_that_moves = [&below] { return 1 + 5 * below(40) + below(4); };
  std::vector<bc_size> sizes(count, {{1.0, 1.0, 1.0}});
  std::vector<bc_pose> poses(count);
  std::unique_ptr<bool[]> fixed(new bool[count]);
  std::vector<int32_t> groups(count);
  for (int k = 0; k < count; ++k) {
    poses[k] = place(k);
    fixed[k] = k % 5 == 0;
    groups[k] = k % 7 != 0;  // the others are in listed pairs alone
  }
  const int64_t listed[] = {7, 8, 14, 15, 21, 20};
  const uint8_t allowed[] = {0, 0, 0, 1};
  bc_boxes boxes{};
  boxes.size = sizeof boxes, boxes.count = count, boxes.sizes = sizes.data();
  boxes.fixed = fixed.get(), boxes.listed = listed, boxes.listed_count = 3;
  boxes.groups = groups.data(), boxes.group_count = 2, boxes.allowed = allowed;
  bc_broad_phase *told, *other;
  int wrong = bc_broad_phase_create(&boxes, &told) || bc_broad_phase_create(&boxes, &other);
  bc_near by_names{}, by_all{};
  by_names.size = by_all.size = sizeof by_all;
  std::vector<int64_t> changed;
  for (int tick = 0; tick < 3000; ++tick) {
    changed.clear();
    for (int turn = below(4); turn > 0; --turn) {
      int k = one_that_moves();
      changed.insert(changed.end(), 1 + size_t(below(2)), k);
      poses[k] = place(k);
      poses[k].position[0] += 1e-3 * below(tick % 2 ? 20 : 2000);
      if (below(20) == 0) std::fill_n(poses[k].position, 7, NAN);
      if (below(20)) continue;
      bc_size size = {{1.0 + 0.1 * below(5), 1.0, 1.0}};
      k = one_that_moves();
      wrong += bc_broad_phase_resize(told, k, &size) || bc_broad_phase_resize(other, k, &size);
    }
    int bad = below(20) || changed.empty() ? -1 : int(changed[0]);
    if (bad >= 0) poses[bad].quaternion[3] = 0.0;
    int64_t most = below(10) ? INT64_MAX : 100;
    bc_status status = bc_broad_phase_find(other, poses.data(), most, &by_all);
    wrong += bc_broad_phase_find_changed(told, poses.data(), changed.data(),
                                         int64_t(changed.size()), most, &by_names) != status;
    wrong += (status != BC_OK) != (bad >= 0);
    if (bad >= 0) poses[bad] = place(bad);
    if (status) continue;
    if (by_all.count > most) {  // which of them were found first is nobody's
      wrong += by_names.count <= most;
      continue;
    }
    wrong += by_names.count != by_all.count || by_names.stale_count != by_all.stale_count ||
             !std::equal(by_all.pairs, by_all.pairs + 2 * by_all.count, by_names.pairs) ||
             !std::equal(by_all.stale, by_all.stale + 2 * by_all.stale_count, by_names.stale);
  }
  int64_t none[] = {count};
  wrong += bc_broad_phase_find_changed(told, poses.data(), none, 1, 1, &by_names) != BC_BAD_ROWS;
  wrong +=
      bc_broad_phase_find_changed(told, poses.data(), none, -1, 1, &by_names) != BC_BAD_ARGUMENT;
  bc_broad_phase_destroy(told);
  bc_broad_phase_destroy(other);
  std::printf("%d wrong answers\n", wrong);
  return wrong;
}

}  // namespace

int main() { return count_allocating_calls() + count_wrong_answers() != 0; }
