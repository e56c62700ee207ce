// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Iterations: the blocks of an island are solved in turn, and what presses in an impact is scaled.
#pragma once

#include <algorithm>
#include <vector>

#include "islands.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A smaller change of a patch's speeds [m/s] does not make its neighbours be solved again. With 1e-6 a
// jittered tower of 20 sways for 8 s.
constexpr double least_change = 1e-8;

// An impact goes on being solved, at most so often, while an iteration changes a closing speed by more
// than this [m/s]. What is left of a closing speed comes back as an overlap that is pushed out.
constexpr double impact_change = 0.01;
constexpr int impact_iterations = 100;
// After every so many of them, all that presses in the island is scaled, where the factor is far from 1:
// by this or more, or by its inverse or less.
constexpr int scaled_every = 8;
constexpr double least_factor = 2.0;

class Iterations {
 public:
  explicit Iterations(Islands& islands) : moving_(islands.moving), blocks_(islands.blocks) {}

  // Solve the blocks of an island in turn, so many times. A block whose bodies have not changed since
  // its last turn is left out.
  void operator()(const Island& island, int iterations, NormalRows Block::* rows) const {
    for (size_t k = island.body; k < island.body_end; ++k) moving_[k].changed = 0;
    bool is_solved = false;
    double fastest = 0.0;  // change of a closing speed in the last iteration [m/s]
    auto goes_on = [&](int iteration) {
      return iteration <= iterations || (fastest > impact_change && iteration <= impact_iterations);
    };
    for (int iteration = 1; !is_solved && goes_on(iteration); ++iteration) {
      is_solved = true;
      fastest = 0.0;
      for (size_t k = island.block; k < island.block_end; ++k) {
        Block& block = blocks_[k];
        Moving &a = moving_[size_t(block.a)], &b = moving_[size_t(block.b)];
        if (std::max(a.changed, b.changed) < iteration - 1) continue;
        double closing = solve_normal(block, block.*rows, a, b);
        double slipping = solve_friction(block, a, b);  // bounded by what presses now
        fastest = std::max(fastest, closing);
        if (std::max(closing, slipping) <= least_change) continue;
        is_solved = false;
        if (a.inverse_mass > 0.0) a.changed = iteration;
        if (b.inverse_mass > 0.0) b.changed = iteration;
      }
      if (fastest > impact_change && iteration % scaled_every == 0) scale(island, rows, iteration);
    }
  }

 private:
  // Scale what presses by the factor that leaves least energy, which all bounds allow. Iterations hardly
  // stop a heavy body that falls on light ones, nor take back what stopped it in the sub-step before.
  void scale(const Island& island, NormalRows Block::* rows, int iteration) const {
    auto each = [&](const auto& visit) {
      for (size_t k = island.block; k < island.block_end; ++k)
        visit(blocks_[k], moving_[size_t(blocks_[k].a)], moving_[size_t(blocks_[k].b)]);
    };
    double with = 0.0, without = 0.0;  // power along all impulses [W s]
    each([&](Block& block, Moving& a, Moving& b) {
      const Vec<double>& x = block.normal_impulses;
      with += dot(x, pressing_speeds(block, block.*rows, a, b) + (block.*rows).softness * x);
    });
    each([&](Block& block, Moving& a, Moving& b) {
      apply_normal(block, -block.normal_impulses, a, b);
    });
    each([&](Block& block, Moving& a, Moving& b) {
      without += dot(block.normal_impulses, pressing_speeds(block, block.*rows, a, b));
    });
    double factor = with > without ? std::max(0.0, without / (without - with)) : 1.0;
    if (factor < least_factor && factor * least_factor > 1.0) factor = 1.0;
    each([&](Block& block, Moving& a, Moving& b) {
      block.normal_impulses = factor * block.normal_impulses;
      apply_normal(block, block.normal_impulses, a, b);
      if (a.inverse_mass > 0.0) a.changed = iteration;
      if (b.inverse_mass > 0.0) b.changed = iteration;
    });
  }

  std::vector<Moving>& moving_;
  std::vector<Block>& blocks_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
