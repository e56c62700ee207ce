// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of pairs in memory, and where their answers go: plain data without code, which files compiled
// for different instruction sets may share.
#pragma once

#include <cstdint>

namespace box_contact::detail {

// The network of model `mlp`: sites at which it is asked, features and outputs of each, and those of
// the outputs that give the point. `network_format` counts changes of what the numbers mean.
constexpr int network_format = 2;
constexpr int site_count = 9, site_features = 12, site_outputs = 7, point_outputs = 3;
// Numbers of a unit: its bias, its weights for the features, and its weights to the outputs.
constexpr int unit_numbers = 1 + site_features + site_outputs;

// A step of 0 gives all rows the same sizes, one of 3 each row its own.
struct Rows {
  const double *poses_a, *poses_b;  // 7 numbers a row: x y z qx qy qz qw
  const double *sizes_a, *sizes_b;  // full extents [m]
  long size_step_a, size_step_b;
  const int64_t* pairs;  // (count, 2): the rows of a pair's boxes; nullptr: row i of both
};

// Normals and points have three numbers a row, covariances nine. What is nullptr is not wanted.
struct Results {
  bool* colliding;
  double *separation, *normal, *point;
  double *volume, *covariance;
  int32_t* axis;
  double margin;  // [m]; normals are given up to this separation
};

// How many contacts took another way than most.
struct Counts {
  long contacts;
  long clipped;  // by model `exact`: clipped, because the certificate did not hold
  long exact;    // by model `mlp`: answered by `exact`: outside the trained range, or a box
};

}  // namespace box_contact::detail
