// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pairs and rows by the kernel of this process, in as many threads as are asked for. C, C++ and Python
// are faces of it.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "../../include/box_contact/box_contact.h"
#include "../kernel.hpp"
#include "threads.hpp"

namespace box_contact::detail {

// The kernels that this machine can run and that were built, best last. No memory is allocated.
struct Kernels {
  std::array<const Kernel*, 3> all{};
  size_t count = 0;

  const Kernel* const* begin() const { return all.data(); }
  const Kernel* const* end() const { return all.data() + count; }
};
const Kernels& kernels();
// The best of them, or the one that the environment names; nullptr for a name that no set has.
const Kernel* chosen_kernel();

// Who answers.
struct Solver {
  const Kernel* kernel;
  Model model;
  const float* network;  // of models `mlp` and `paper`

  // Solve rows `begin` to `end` in this thread. Returns the first row that is refused, or −1.
  long solve(const Rows& rows, long begin, long end, const Results& results) const {
    auto* solve_rows =
        kernel->solve_rows[int(model)][int(results.covariance ? Finds::patch : Finds::point)];
    return solve_rows(network, rows, begin, end, results);
  }
};

// Solve one pair. Returns false, and leaves `contact`, if it is refused.
inline bool solve_pair(const Solver& solver, const PairNumbers& pair, bc_patch patch, double margin,
                       bc_contact& contact) {
  Finds finds = patch == BC_COVARIANCE ? Finds::patch : Finds::point;
  auto* solve = solver.kernel->solve_pair[int(solver.model)][int(finds)];
  if (!solve(solver.network, pair, margin, contact)) return false;
  if (patch == BC_NO_PATCH && contact.colliding)
    contact.volume = std::numeric_limits<double>::quiet_NaN();
  return true;
}

// Rows that a thread takes at a time: some 50 µs of work, and whole blocks. Twice as many are worth a thread.
constexpr long rows_per_chunk = 256;

// Call solve(begin, end), which returns the first row that is refused, or −1, for chunks of `count`
// rows, in as many threads as are asked for and worth it. Rows are independent, so no bit depends on
// the number of threads. `kept`: threads to take; null: those of this call. Returns the first row that is
// refused, or −1.
template <class Solve>
long in_chunks(long count, long threads, const Solve& solve, Threads* kept = nullptr) {
  long chunks = (count + rows_per_chunk - 1) / rows_per_chunk;
  threads = std::min(threads, (chunks + 1) / 2);
  if (threads <= 1) return solve(0, count);
  std::vector<long> refused_of(threads, count);
  Threads own;
  (kept ? *kept : own)(threads, chunks, [&](long thread, long chunk) {
    long begin = chunk * rows_per_chunk, end = std::min(begin + rows_per_chunk, count);
    long refused = solve(begin, end);
    if (refused >= 0) refused_of[thread] = std::min(refused_of[thread], refused);
  });
  long refused = *std::min_element(refused_of.begin(), refused_of.end());
  return refused < count ? refused : -1;
}

// Solve `count` rows. Returns the first row that is refused, or −1.
inline long solve_rows(const Solver& solver, const Rows& rows, long count, const Results& results,
                       long threads, Threads* kept = nullptr) {
  auto solve = [&](long begin, long end) { return solver.solve(rows, begin, end, results); };
  return in_chunks(count, threads, solve, kept);
}

// The same of distances.
inline long nearest_rows(const Kernel& kernel, const Rows& rows, long count,
                         const NearestResults& results, long threads) {
  return in_chunks(count, threads, [&](long begin, long end) {
    return kernel.nearest_rows(rows, begin, end, results);
  });
}

}  // namespace box_contact::detail
