// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Where memory ends in a call, the call says so. Repeated with memory, it answers as if nothing had been.
#include <climits>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

#include "allocations.hpp"
#include "box_contact/force.h"
#include "box_contact/index.h"

namespace {

// Makes calls, of which one may run out of memory, and keeps what they answer.
class Calls {
 public:
  // left: the allocations until memory ends, once.
  explicit Calls(long left) : left_(left) {}

  template <class Call>
  void operator()(const Call& call) {
    const long before = allocations;
    if (!has_ended) allocations_allowed = before + left_;
    bc_status status = call();
    allocations_allowed = LONG_MAX;
    if (status == BC_NO_MEMORY) {
      has_ended = true;
      status = call();
    }
    left_ -= allocations - before;
    faults += status != BC_OK;
  }
  template <class Number>
  void keep(const Number* numbers, int64_t count) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(numbers);
    answers.insert(answers.end(), bytes, bytes + size_t(count) * sizeof(Number));
  }

  bool has_ended = false;
  int faults = 0;
  std::vector<unsigned char> answers;

 private:
  long left_;
};

constexpr int count = 60;

bc_pose pose_at(double x, double y, double z) { return {{x, y, z}, {0.0, 0.0, 0.0, 1.0}}; }

void keep(const bc_near& near, Calls& calls) {
  calls.keep(near.pairs, 2 * near.count);
  calls.keep(near.stale, 2 * near.stale_count);
}

// A yard of which a third moves; then fixed boxes come, and others go; then some go on a path.
void find_pairs(Calls& calls) {
  std::vector<bc_size> sizes(count, {{1.0, 1.0, 1.0}});
  std::vector<bc_pose> poses, standing;
  int64_t kept[count];
  for (int k = 0; k < count; ++k) {
    poses.push_back(pose_at(0.9 * (k % 8), 0.9 * (k / 8), 0.0));
    standing.push_back(poses.back());
    if (k % 3 == 0) std::fill_n(standing.back().position, 7, std::nan(""));
    kept[k] = k % 7 ? k : -1;
  }
  bc_filter_rows rows{};
  rows.size = sizeof rows, rows.count = count;
  bc_filter* filter = nullptr;
  bc_index *first = nullptr, *second = nullptr;
  bc_movers *before = nullptr, *after = nullptr;
  bc_near near{};
  near.size = sizeof near;
  calls([&] { return bc_filter_create(&rows, &filter); });
  calls([&] { return bc_index_create(sizes.data(), standing.data(), count, &first); });
  calls([&] { return bc_movers_create(sizes.data(), count, 0.0, filter, first, &before); });
  calls([&] { return bc_movers_find(before, poses.data(), INT64_MAX, &near); });
  keep(near, calls);
  for (int k = 0; k < count; k += 3) poses[size_t(k)].position[0] += 3.0;
  calls([&] { return bc_movers_find(before, poses.data(), INT64_MAX, &near); });
  keep(near, calls);
  for (int k = 0; k < count; k += 7) standing[size_t(k)].position[1] += 0.5;
  calls([&] { return bc_index_change(first, kept, sizes.data(), standing.data(), count, &second); });
  calls([&] { return bc_movers_create(sizes.data(), count, 0.0, filter, second, &after); });
  calls([&] { return bc_movers_find(after, poses.data(), INT64_MAX, &near); });
  keep(near, calls);

  bc_way way = bc_default_way();
  std::vector<bc_pose> places{poses[0], poses[3], poses[30], poses[59], poses[9], poses[0]};
  way.times = 3, way.count = 2, way.sizes = sizes.data(), way.poses = places.data();
  way.around = second, way.clearance = 0.5;
  bc_path* path = nullptr;
  bc_path_found found{};
  found.size = sizeof found;
  calls([&] { return bc_path_create(&way, &path); });
  bool is_done = false;
  for (int k = 0; k < 1000 && !is_done; ++k)
    calls([&] { return bc_path_advance(path, 20, &is_done); });
  calls([&] { return bc_path_read(path, &found); });
  for (int64_t k = 0; k < found.impact_count; ++k) {
    calls.keep(&found.impacts[k].a, 2);
    calls.keep(&found.impacts[k].approach.time, 1);
  }
  calls.keep(found.held, 2 * found.held_count);
  bc_path_destroy(path);
  bc_movers_destroy(before);
  bc_movers_destroy(after);
  bc_index_destroy(first);
  bc_index_destroy(second);
  bc_filter_destroy(filter);
}

// Boxes on a floor, in two stacks, and how they move.
struct Stacks {
  static constexpr int bodies = 9;

  bc_patch_forces* forces = nullptr;
  std::vector<bc_body> all{{0.0, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}};
  std::vector<bc_body_box> boxes{{0, {pose_at(0.0, 0.0, 0.0), {{20.0, 20.0, 1.0}}}}};
  std::vector<bc_pose> poses{pose_at(0.0, 0.0, -0.5)};
  std::vector<bc_velocity> velocities{bodies};
  std::vector<bc_wrench> outside{bodies};
  std::vector<int64_t> pairs;

  Stacks() {
    for (int k = 1; k < bodies; ++k) {
      all.push_back({10.0, {2.0, 2.0, 2.0}, {0.0, 0.0, 0.0}});
      boxes.push_back({k, {pose_at(0.0, 0.0, 0.0), {{1.0, 1.0, 1.0}}}});
      poses.push_back(pose_at(k % 2 * 3.0, 0.0, 0.5 + (k - 1) / 2));
      outside[size_t(k)].force[2] = -98.1;
      pairs.insert(pairs.end(), {k > 2 ? k - 2 : 0, k});
    }
  }
  Stacks(const Stacks&) = delete;
  ~Stacks() { bc_patch_forces_destroy(forces); }

  void advance(Calls& calls, int steps) {
    bc_motion motion{};
    motion.size = sizeof motion, motion.poses = poses.data(), motion.velocities = velocities.data();
    for (int step = 0; step < steps; ++step)
      calls([&] {
        return bc_patch_forces_advance(forces, 0.02, poses.data(), velocities.data(),
                                       outside.data(), &motion);
      });
    calls.keep(poses.data(), bodies);
    calls.keep(velocities.data(), bodies);
    std::vector<bc_load> loads(size_t(bc_patch_forces_loads(forces, nullptr, 0)));
    for (auto& load : loads) std::memset(static_cast<void*>(&load), 0, sizeof load);
    bc_patch_forces_loads(forces, loads.data(), int64_t(loads.size()));
    calls.keep(loads.data(), int64_t(loads.size()));
  }
  void hold(Calls& calls, int64_t rows) {
    bc_patches answer{};
    answer.size = sizeof answer, answer.count = rows, answer.pairs = pairs.data();
    calls([&] { return bc_patch_forces_hold(forces, &answer, nullptr); });
  }
  // Answers of others to all pairs.
  void hold_answers(Calls& calls) {
    const size_t rows = pairs.size() / 2;
    std::vector<double> separation, normal, point, volume, covariance;
    for (size_t k = 0; k < rows; ++k) {
      auto a = size_t(pairs[2 * k]), b = size_t(pairs[2 * k + 1]);
      const bc_box box_a{poses[a], boxes[a].box.size}, box_b{poses[b], boxes[b].box.size};
      bc_query query = bc_default_query();
      bc_contact found{};
      bc_collide(&box_a, &box_b, &query, &found);
      separation.push_back(found.separation);
      volume.push_back(found.colliding ? found.volume : 0.0);
      normal.insert(normal.end(), found.normal, found.normal + 3);
      point.insert(point.end(), found.point, found.point + 3);
      covariance.insert(covariance.end(), found.covariance[0], found.covariance[0] + 9);
    }
    bc_patches answer{};
    answer.size = sizeof answer, answer.count = int64_t(rows), answer.pairs = pairs.data();
    answer.separation = separation.data(), answer.normal = normal.data();
    answer.point = point.data(), answer.volume = volume.data();
    answer.covariance = covariance.data();
    calls([&] { return bc_patch_forces_hold(forces, &answer, poses.data()); });
  }
};

// Stacks fall asleep, are asked about anew, wake, and get other bodies and boxes.
void move_stacks(Calls& calls) {
  Stacks stacks;
  bc_patch_forces*& forces = stacks.forces;
  calls([&] {
    return bc_patch_forces_create(stacks.all.data(), Stacks::bodies - 1, nullptr, &forces);
  });
  calls([&] { return bc_patch_forces_set_bodies(forces, stacks.all.data(), Stacks::bodies); });
  calls([&] { return bc_patch_forces_set_boxes(forces, stacks.boxes.data(), Stacks::bodies, 0); });
  stacks.hold(calls, Stacks::bodies - 2);
  stacks.advance(calls, 40);
  stacks.hold(calls, Stacks::bodies - 1);
  stacks.advance(calls, 40);
  stacks.hold_answers(calls);
  stacks.advance(calls, 2);
  bc_patch_forces* copy = nullptr;
  calls([&] { return bc_patch_forces_copy(forces, &copy); });
  bc_patch_forces_destroy(forces);
  forces = copy;
  stacks.outside[3].force[0] = 30.0;
  stacks.advance(calls, 2);
  const int64_t forgotten[] = {4};
  calls([&] { return bc_patch_forces_forget(forces, forgotten, 1); });
  stacks.all[5].mass = 20.0;
  calls([&] { return bc_patch_forces_set_bodies(forces, stacks.all.data(), Stacks::bodies); });
  stacks.boxes[6].box.size.extent[0] = 0.9;
  calls([&] { return bc_patch_forces_set_boxes(forces, stacks.boxes.data(), Stacks::bodies, 0); });
  stacks.hold_answers(calls);
  stacks.advance(calls, 2);
}

// Stacks of which the forces find the pairs fall asleep; a belt starts, a box gets another size, and one
// is put aside.
void find_and_move_stacks(Calls& calls) {
  Stacks stacks;
  auto set_boxes = [&] {
    return bc_patch_forces_set_boxes(stacks.forces, stacks.boxes.data(), Stacks::bodies, 1);
  };
  calls([&] {
    return bc_patch_forces_create(stacks.all.data(), Stacks::bodies, nullptr, &stacks.forces);
  });
  calls(set_boxes);
  stacks.advance(calls, 40);
  stacks.boxes[6].box.size.extent[0] = 0.9;
  const double belt[] = {0.5, 0.0, 0.0};
  calls([&] { return bc_patch_forces_set_surface(stacks.forces, 0, belt, nullptr); });
  calls(set_boxes);
  stacks.advance(calls, 2);
  stacks.poses[8] = pose_at(1.5, 0.5, 3.0);
  stacks.advance(calls, 40);
}

// Let memory end at each allocation in turn.
template <class Work>
int count_faults(const char* name, const Work& work) {
  Calls undisturbed(LONG_MAX / 2);
  work(undisturbed);
  int faults = undisturbed.faults;
  long ends = 0;
  for (bool has_ended = true; has_ended; ++ends) {
    Calls calls(ends);
    work(calls);
    has_ended = calls.has_ended;
    const int wrong = calls.faults + (calls.answers != undisturbed.answers);
    if (wrong) std::printf("%s: memory ended at allocation %ld: %d faults\n", name, ends, wrong);
    faults += wrong;
  }
  std::printf("%s: memory ended at %ld allocations, %d faults\n", name, ends - 1, faults);
  return faults + (ends < 20);
}

}  // namespace

int main() {
  return count_faults("pairs", find_pairs) + count_faults("forces", move_stacks) +
             count_faults("forces that find pairs", find_and_move_stacks) !=
         0;
}
