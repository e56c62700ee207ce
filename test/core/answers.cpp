// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Print what the library answers for a list of pairs, and where a tower ends, for comparison with
// another build of it.
//
// usage: answers PAIRS
//
// PAIRS has a line for each pair: two poses and two sizes, 20 numbers. The program prints a line for
// each pair and model: verdict, separation and normal; and a line for each pair: verdict, distance and
// normal; and a line for each pair on the way to the poses of the next one: both times and the least
// distance. Then it prints a line for each body of the tower:
// pose and velocity. The exit status is 1 if a row of a batch has other bits than its single call.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "box_contact/force.hpp"

using box_contact::Contact;
using box_contact::Pose;
using box_contact::Size;

namespace {

// NaN are the same, whatever their sign and payload.
bool same_bits(const double* one, const double* other, long count) {
  return std::equal(one, one + count, other, [](double a, double b) {
    return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0;
  });
}

struct Pairs {
  std::vector<Pose> poses_a, poses_b;
  std::vector<Size> sizes_a, sizes_b;
};

Pairs read_pairs(const char* path) {
  std::ifstream file(path);
  std::string word;
  double numbers[20];
  Pairs pairs;
  for (int k = 0; file >> word;) {
    numbers[k] = std::strtod(word.c_str(), nullptr);  // streams read no hexadecimal numbers
    if (++k < 20) continue;
    k = 0;
    Pose a, b;
    Size size_a, size_b;
    std::memcpy(&a, numbers, sizeof a), std::memcpy(&b, numbers + 7, sizeof b);
    std::memcpy(&size_a, numbers + 14, sizeof size_a);
    std::memcpy(&size_b, numbers + 17, sizeof size_b);
    pairs.poses_a.push_back(a), pairs.poses_b.push_back(b);
    pairs.sizes_a.push_back(size_a), pairs.sizes_b.push_back(size_b);
  }
  return pairs;
}

// Print the single calls of a model. Returns how many differ from their row of a batch.
long print_answers(const Pairs& pairs, box_contact::Model model) {
  const long count = long(pairs.poses_a.size());
  const box_contact::Query query{model};
  std::unique_ptr<bool[]> colliding(new bool[count]);
  std::vector<double> separation(count), normal(3 * count), point(3 * count), volume(count),
      covariance(9 * count);
  box_contact::Results results{colliding.get(), separation.data(), normal.data(),
                               point.data(),    volume.data(),     covariance.data()};
  long different = box_contact::collide(
                       {pairs.poses_a, pairs.poses_b, pairs.sizes_a, pairs.sizes_b}, results, query,
                       2) != -1;
  for (long row = 0; row < count; ++row) {
    const Contact one = box_contact::collide({pairs.poses_a[row], pairs.sizes_a[row]},
                                             {pairs.poses_b[row], pairs.sizes_b[row]}, query);
    different += one.colliding != colliding[row] ||
                 !same_bits(&one.separation, &separation[row], 1) ||
                 !same_bits(one.normal, &normal[3 * row], 3) ||
                 !same_bits(one.point, &point[3 * row], 3) ||
                 !same_bits(&one.volume, &volume[row], 1) ||
                 !same_bits(one.covariance[0], &covariance[9 * row], 9);
    std::printf("%d %a %a %a %a\n", one.colliding, one.separation, one.normal[0], one.normal[1],
                one.normal[2]);
  }
  return different;
}

// Print the distances of single calls. Returns how many differ from their row of a batch.
long print_distances(const Pairs& pairs) {
  const long count = long(pairs.poses_a.size());
  std::vector<double> distance(count), normal(3 * count), point_a(3 * count), point_b(3 * count);
  box_contact::NearestResults results{nullptr, distance.data(), normal.data(), point_a.data(),
                                      point_b.data()};
  long different = box_contact::distance(
                       {pairs.poses_a, pairs.poses_b, pairs.sizes_a, pairs.sizes_b}, results,
                       2) != -1;
  for (long row = 0; row < count; ++row) {
    const box_contact::Nearest one = box_contact::distance({pairs.poses_a[row], pairs.sizes_a[row]},
                                                           {pairs.poses_b[row], pairs.sizes_b[row]});
    different += !same_bits(&one.distance, &distance[row], 1) ||
                 !same_bits(one.normal, &normal[3 * row], 3) ||
                 !same_bits(one.point_a, &point_a[3 * row], 3) ||
                 !same_bits(one.point_b, &point_b[3 * row], 3);
    std::printf("%d %a %a %a %a\n", one.colliding, one.distance, one.normal[0], one.normal[1],
                one.normal[2]);
  }
  return different;
}

// Print when pairs touch on the way to the poses of the next pair, and how near they come. Returns how
// many differ from their row of a batch.
long print_motion(const Pairs& pairs) {
  const long count = long(pairs.poses_a.size());
  auto next = [](std::vector<Pose> poses) {
    std::rotate(poses.begin(), poses.begin() + 1, poses.end());
    return poses;
  };
  const std::vector<Pose> ends_a = next(pairs.poses_a), ends_b = next(pairs.poses_b);
  std::vector<double> first(count), least(count);
  box_contact::SweepRows rows{{pairs.poses_a, pairs.poses_b, pairs.sizes_a, pairs.sizes_b},
                              ends_a, ends_b};
  long different = 0;
  box_contact::time_of_impact(rows, {first.data(), nullptr, {}}, 0.0, 1e-6, 2);
  box_contact::least_distance(rows, {least.data(), nullptr, {}}, 1e-6, 2);
  for (long row = 0; row < count; ++row) {
    if (first[row] == -1.0) {  // a turn of two ways, or coordinates without such a tolerance
      std::puts("-1 -1 -1");
      different += least[row] != -1.0;
      continue;
    }
    const box_contact::Sweep a{pairs.poses_a[row], ends_a[row], pairs.sizes_a[row], {}};
    const box_contact::Sweep b{pairs.poses_b[row], ends_b[row], pairs.sizes_b[row], {}};
    const box_contact::Approach hit = box_contact::time_of_impact(a, b);
    const box_contact::Approach low = box_contact::least_distance(a, b);
    different += !same_bits(&hit.time, &first[row], 1) || !same_bits(&low.time, &least[row], 1);
    std::printf("%a %a %a\n", hit.time, low.time, low.nearest.distance);
  }
  return different;
}

// Print where cubes on the ground end that stand askew: after 400 steps of 5 ms, each with an answer.
// test_builds.py has the same loop in Python.
void print_tower() {
  constexpr int count = 12;  // with the ground
  const double h = 0.005;
  std::vector<box_contact::Body> bodies(count, {600.0, {100.0, 100.0, 100.0}});
  std::vector<Size> sizes(count, {1.0, 1.0, 1.0});
  std::vector<Pose> poses(count, {{0.0, 0.0, -0.5}, {0.0, 0.0, 0.0, 1.0}});
  std::vector<box_contact::Velocity> velocities(count, box_contact::Velocity{});
  std::vector<box_contact::Wrench> weights(count, {{0.0, 0.0, -9.81 * 600.0}, {}});
  std::vector<std::int64_t> pairs;
  bodies[0] = {0.0, {}}, weights[0] = {};
  sizes[0] = {20.0, 20.0, 1.0};
  for (int k = 1; k < count; ++k) {
    poses[k] = {{0.03 * (k % 3), 0.02 * (k % 2), k - 0.499}, {0.0, 0.0, 0.01 * k, 1.0}};
    pairs.insert(pairs.end(), {k - 1, k});
  }
  constexpr int rows = count - 1;
  double separation[rows], normal[3 * rows], point[3 * rows], volume[rows], covariance[9 * rows];
  const box_contact::Rows asked{poses, poses, sizes, sizes, pairs};
  const box_contact::Results found{nullptr, separation, normal, point, volume, covariance};
  box_contact::PatchForces forces(bodies);
  for (int step = 0; step < 400; ++step) {
    box_contact::collide(asked, found);
    forces.hold({asked, found}, poses);
    forces.advance(h, poses, velocities, weights);
  }
  for (int k = 0; k < count; ++k) {
    for (double number : poses[k].position) std::printf("%a ", number);
    for (double number : poses[k].quaternion) std::printf("%a ", number);
    for (double number : velocities[k].linear) std::printf("%a ", number);
    for (double number : velocities[k].angular) std::printf("%a ", number);
    std::puts("");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const Pairs pairs = read_pairs(argv[1]);
  const long different = print_answers(pairs, box_contact::Model::exact) +
                         print_answers(pairs, box_contact::Model::mlp) + print_distances(pairs) +
                         print_motion(pairs);
  print_tower();
  if (different) std::fprintf(stderr, "%ld rows differ from their single calls\n", different);
  return different != 0;
}
