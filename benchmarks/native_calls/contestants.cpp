// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What programs share: how they read poses, and how contestants take turns.
#include "contestants.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

double kept;

void fail(const std::string& what) {
  std::fprintf(stderr, "native: %s\n", what.c_str());
  std::exit(2);
}

namespace {

PlacedBox placed(const bc_pose& pose, const bc_size& size) {
  const double* q = pose.quaternion;
  double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
  PlacedBox box = {{},
                   {},
                   {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (int k = 0; k < 3; ++k) {
    box.half[k] = 0.5 * size.extent[k];
    box.position[k] = pose.position[k];
  }
  return box;
}

}  // namespace

Poses::Poses(const char* path) {
  std::FILE* file = std::fopen(path, "rb");
  if (!file) fail(std::string("cannot read ") + path);
  size_t n = size_t(read_items<int64_t>(file, 1)[0]);
  a = read_items<bc_pose>(file, n);
  b = read_items<bc_pose>(file, n);
  size_a = read_items<bc_size>(file, n);
  size_b = read_items<bc_size>(file, n);
  std::fclose(file);
  for (size_t pair = 0; pair < n; ++pair) {
    box_a.push_back({a[pair], size_a[pair]});
    box_b.push_back({b[pair], size_b[pair]});
    placed_a.push_back(placed(a[pair], size_a[pair]));
    placed_b.push_back(placed(b[pair], size_b[pair]));
  }
}

void compare(const Contestants& all, const Poses& poses, size_t rounds, size_t calls,
             const char* answers_path) {
  std::FILE* answers = std::fopen(answers_path, "wb");
  if (!answers) fail(std::string("cannot write ") + answers_path);
  for (const Contestant& one : all) {
    std::printf("%s%s", &one == &all[0] ? "" : "\t", one.name.c_str());
    for (size_t pair = 0; pair < calls; ++pair) {
      double answer = one.answer(pair);
      std::fwrite(&answer, sizeof answer, 1, answers);
    }
  }
  std::printf("\n");
  std::fclose(answers);

  for (size_t round = 0; round <= rounds; ++round)  // the first one warms up
    for (const Contestant& one : all) {
      size_t first = round * calls % (poses.count() - calls + 1);
      auto start = std::chrono::steady_clock::now();
      one.round(first);
      std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - start;
      if (round) std::printf("%s\t%.2f\n", one.name.c_str(), took.count() / double(one.pairs));
    }
}
