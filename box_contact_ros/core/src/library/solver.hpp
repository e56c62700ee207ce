// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// One solver: it owns sizes, model, network, counts and threads. C, C++ and Python are faces of it.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "../../include/box_contact/box_contact.h"
#include "../kernel.hpp"

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

using Extents = std::array<double, 3>;

// Whether a loader believes a weight: trained ones stay below 1e2, a flipped exponent bit does not.
inline bool is_weight(float number) { return std::fabs(number) <= 1e4F; }

class Solver {
 public:
  // Rows that a thread takes at a time: some 100 µs of work, and whole groups of blocks.
  static constexpr long rows_per_chunk = 512;

  // What a solver is made of.
  struct Setup {
    const Kernel* kernel;
    Model model = Model::exact;
    Extents size_a{}, size_b{};  // full extents [m]
    double margin = 0.0;         // [m]
    std::vector<float>
        network;  // of model `mlp`: bias of the output, then the numbers of each unit
  };

  explicit Solver(Setup setup) : setup_(std::move(setup)) {}

  const Setup& setup() const { return setup_; }
  const NetworkNumbers network() const {
    return {setup_.network.data(), long(setup_.network.size())};
  }

  // Solve one pair. Sizes nullptr: the solver's. Returns false, and leaves `contact`, if poses or
  // sizes are refused.
  bool solve(const double* pose_a, const double* pose_b, const double* size_a, const double* size_b,
             bc_patch patch, bc_contact& contact) {
    bc_contact found;
    double* covariance = found.covariance[0];
    Rows rows{pose_a,
              pose_b,
              size_a ? size_a : setup_.size_a.data(),
              size_b ? size_b : setup_.size_b.data(),
              0,
              0,
              nullptr};
    Results results{&found.colliding,
                    &found.separation,
                    found.normal,
                    found.point,
                    patch >= BC_VOLUME ? &found.volume : nullptr,
                    patch == BC_COVARIANCE ? covariance : nullptr,
                    &found.axis,
                    setup_.margin};
    Counts counts{};
    if (solve_chunk(rows, 0, 1, results, counts) >= 0) return false;
    if (patch < BC_COVARIANCE) std::fill_n(covariance, 9, std::nan(""));
    if (patch < BC_VOLUME) found.volume = found.colliding ? std::nan("") : 0.0;
    add(counts);
    contact = found;
    return true;
  }

  // Solve `count` rows, in as many threads as are asked for and worth it. Each takes the next chunk
  // until none is left: a thread that starts late costs little. Rows are independent, so no bit
  // depends on the number of threads. Returns the first row that is refused, or −1; the contacts of
  // a batch with such a row are not counted.
  long solve(const Rows& rows, long count, Results results, long threads) {
    results.margin = setup_.margin;
    long chunks = (count + rows_per_chunk - 1) / rows_per_chunk;
    threads = std::min(threads, chunks);
    Counts counts{};
    long refused = threads <= 1 ? solve_chunk(rows, 0, count, results, counts)
                                : solve_in_threads(rows, count, results, threads, counts);
    if (refused < 0) add(counts);
    return refused;
  }

  bc_counts counts() const { return {clipped_, exact_}; }

 private:
  void add(const Counts& counts) {
    if (counts.clipped) clipped_ += counts.clipped;
    if (counts.exact) exact_ += counts.exact;
  }

  long solve_in_threads(const Rows& rows, long count, const Results& results, long threads,
                        Counts& counts) const {
    long chunks = (count + rows_per_chunk - 1) / rows_per_chunk;
    std::vector<Counts> counts_of(threads, Counts{});
    std::vector<long> refused_of(threads, count);
    std::atomic<long> next{0};
    auto work = [&](long thread) {
      for (long chunk = next++; chunk < chunks; chunk = next++) {
        long begin = chunk * rows_per_chunk, end = std::min(begin + rows_per_chunk, count);
        long refused = solve_chunk(rows, begin, end, results, counts_of[thread]);
        if (refused >= 0) refused_of[thread] = std::min(refused_of[thread], refused);
      }
    };
    std::vector<std::thread> others;
    others.reserve(threads - 1);
    try {
      for (long thread = 1; thread < threads; ++thread) others.emplace_back(work, thread);
    } catch (const std::exception&) {
      // No more threads, or no memory for them: those that run take all chunks.
    }
    work(0);
    for (std::thread& other : others) other.join();
    for (const Counts& part : counts_of) {
      counts.clipped += part.clipped;
      counts.exact += part.exact;
    }
    long refused = *std::min_element(refused_of.begin(), refused_of.end());
    return refused < count ? refused : -1;
  }

  // Solve rows `begin` to `end` in this thread.
  long solve_chunk(const Rows& rows, long begin, long end, const Results& results,
                   Counts& counts) const {
    auto* solve_rows =
        setup_.kernel
            ->solve_rows[int(setup_.model)][int(results.covariance ? Finds::patch : Finds::point)];
    return solve_rows(network(), rows, begin, end, results, counts);
  }

  Setup setup_;
  std::atomic<long> clipped_{0}, exact_{0};
};

}  // namespace box_contact::detail
