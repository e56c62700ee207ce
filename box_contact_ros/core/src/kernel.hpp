// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A kernel: the core compiled for one instruction set, as a table of functions without templates, and
// the plain data that they share.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../include/box_contact/box_contact.h"

namespace box_contact::detail {

// A step of 0 gives all rows the same sizes, one of 3 each row its own.
struct Rows {
  const double *poses_a, *poses_b;  // 7 numbers a row: x y z qx qy qz qw
  const double *sizes_a, *sizes_b;  // full extents [m]
  long size_step_a, size_step_b;
  const int64_t* pairs = nullptr;  // (count, 2): the rows of a pair's boxes; nullptr: row i of both
  long pose_count = 0;             // of either array; read with `pairs` alone
};

// The numbers of a pair alone, as a row has them.
struct PairNumbers {
  const double *pose_a, *pose_b, *size_a, *size_b;
};

// Normals and points have three numbers a row, covariances nine. What is nullptr is not wanted.
struct Results {
  bool* colliding;
  double *separation, *normal, *point;
  double *volume, *covariance;
  int32_t* axis;
  double margin;  // [m]; normals are given up to this separation
};

// The same of distances. What is nullptr is not wanted.
struct NearestResults {
  bool* colliding;
  double *distance, *normal, *point_a, *point_b;
};

enum class Model { exact, mlp, paper };
constexpr int model_count = 3;

// Whether a function finds point and volume alone, or all moments.
enum class Finds { point, patch };

// Blocks of forces side by side, by stages: see force/stages.hpp, and Work for what they take.
struct ForceKernel {
  int lanes;
  size_t group_size;  // [bytes]
  void (*load)(void*);
  void (*push)(void*);
  void (*move)(void*);
  void (*relax)(void*);
  void (*end)(void*);
};

struct Kernel {
  const char* name;   // as BOX_CONTACT_INSTRUCTION_SET has it
  const char* title;  // for people
  int lanes;          // pairs that a batch solves side by side

  // Solve a pair alone. Returns false, and leaves `contact`, if it is refused. What is not found of the
  // overlap is NaN.
  bool (*solve_pair[model_count][2])(const float* network, const PairNumbers&, double margin,
                                     bc_contact& contact);
  // Solve rows `begin` to `end`. Returns the first row that is refused, or −1.
  long (*solve_rows[model_count][2])(const float* network, const Rows&, long begin, long end,
                                     const Results&);

  // The same of distances.
  bool (*nearest_pair)(const PairNumbers&, bc_nearest& nearest);
  long (*nearest_rows)(const Rows&, long begin, long end, const NearestResults&);

  ForceKernel side;
};

extern const Kernel kernel_baseline, kernel_avx2, kernel_avx512;

}  // namespace box_contact::detail
