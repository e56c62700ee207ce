// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A kernel: the core compiled for one instruction set, as a table of functions without templates.
#pragma once

#include "../rows.hpp"
#include "stage_arrays.hpp"

namespace box_contact::detail {

enum class Model { exact, mlp };
constexpr int model_count = 2;

// Whether a function finds point and volume alone, or all moments.
enum class Finds { point, patch };

// A network in memory: the bias of its output, then the numbers of each unit.
struct NetworkNumbers {
  const float* numbers;
  long count;
};

struct Kernel {
  const char* name;   // as BOX_CONTACT_INSTRUCTION_SET has it
  const char* title;  // for people
  int lanes;          // pairs that a batch solves side by side

  // Solve rows `begin` to `end`. Returns the first row that is refused, or −1.
  long (*solve_rows[model_count][2])(const NetworkNumbers&, const Rows&, long begin, long end,
                                     const Results&, Counts&);
  // Fill one row; see stages.hpp.
  bool (*fill_stages)(const Rows&, long row, const StageArrays&);
};

extern const Kernel kernel_baseline, kernel_avx2, kernel_avx512;

}  // namespace box_contact::detail
