// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Print what the library answers for a list of pairs, for comparison with another build of it.
//
// usage: answers PAIRS
//
// PAIRS has a line for each pair: two poses and two sizes, 20 numbers. The program prints a line for
// each pair and model: verdict, separation and normal. The exit status is 1 if a row of a batch has
// other bits than its single call.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "box_contact/box_contact.hpp"

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

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const Pairs pairs = read_pairs(argv[1]);
  const long different = print_answers(pairs, box_contact::Model::exact) +
                         print_answers(pairs, box_contact::Model::mlp);
  if (different) std::fprintf(stderr, "%ld rows differ from their single calls\n", different);
  return different != 0;
}
