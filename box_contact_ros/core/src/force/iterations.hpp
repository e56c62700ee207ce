// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Iterations: the blocks of islands are solved in order, and what presses in an impact is scaled.
#pragma once

#include <algorithm>
#include <limits>

#include "block.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// With late answers no change of a closing speed is an impact [m/s]. Their patches are soft, and slow what
// closes over several steps.
constexpr double no_impact = std::numeric_limits<double>::infinity();

// The factor of over-relaxation in an island of so many blocks: one alone is solved at once [1].
inline double over_relaxation(size_t blocks) {
  return 1.0 + (most_over_relaxation - 1.0) * (1.0 - 1.0 / double(blocks));
}

// Where stacks sway, impulses take more iterations to agree. Slower, they rest; faster, they fall or slide.
inline bool is_sway(double speed, bool has_swayed) {
  return speed > (has_swayed ? least_sway : begun_sway) && speed < most_sway;
}
// How many times as many iterations an island takes that has swayed for a time [s]; 0: it does not sway.
inline int rounds_of(double swayed) {
  if (swayed == 0.0) return 1;
  constexpr int most_times = most_rounds / more_rounds;
  return more_rounds * int(min(1.0 + swayed / sway_time, double(most_times)));
}
// How fast the bodies of a patch pass each other, at its rims at most [m/s].
inline double passing_speed(const Patch& patch, const Moving& a, const Moving& b) {
  auto speed = [&](const Moving& moving) {
    return moving.linear + cross(moving.angular, patch.point - moving.placed.position);
  };
  double reach = max(patch.shape.half_1, patch.shape.half_2);
  return length(speed(b) - speed(a) + patch.surface) + reach * length(b.angular - a.angular);
}

struct Island {
  size_t body, body_end;  // among those that move
  size_t block, block_end;
  double over_relaxation;  // see above
  double fastest;          // as which its bodies pass each other at the start of an advance [m/s]
  bool is_new;             // whether it had no patch before this advance
  int rounds;              // how many times as many iterations it takes
  double factor;           // by which its sub-steps are finer; 0: its advance is over
  bool is_due;             // whether it is among those that are solved now
  double impact;           // a larger change of a closing speed is an impact [m/s]
  bool is_struck;          // whether the last iteration changed a closing speed as in an impact
};

// Before iterations begin, no speed has changed.
inline void forget_changes(const Island& island, Moving* moving) {
  for (size_t k = island.body; k < island.body_end; ++k) moving[k].last_change = 0;
}

// A larger change of a closing speed is an impact in a sub-step of this length [m/s].
inline double least_impact(const Island& island, double length) {
  return island.is_new ? impact_change : max(impact_change, impact_acceleration * length);
}

template <class T>
BC_INLINE NormalRows<T>& rows_of(Rows<T>& block, bool is_pushing) {
  return is_pushing ? block.pushing : block.relaxed;
}

// Scale what presses by the factor that leaves least energy, which all bounds allow. Iterations hardly
// stop a heavy body that falls on light ones, nor take back what stopped it in the sub-step before.
inline void scale(const Island& island, bool is_pushing, int iteration, Moving* moving,
                  Block* blocks) {
  auto each = [&](const auto& visit) {
    for (size_t k = island.block; k < island.block_end; ++k)
      visit(blocks[k], rows_of(blocks[k], is_pushing), moving[blocks[k].a], moving[blocks[k].b]);
  };
  using Normal = NormalRows<double>;
  double with = 0.0, without = 0.0;  // power along all impulses [W s]
  each([&](Block& block, Normal& rows, Moving& a, Moving& b) {
    const Vec<double>& x = block.normal_impulses;
    with += dot(x, pressing_speeds(block, rows, a, b) + rows.softness * x);
  });
  each([&](Block& block, Normal&, Moving& a, Moving& b) {
    apply_normal(block, -block.normal_impulses, a, b);
  });
  each([&](Block& block, Normal& rows, Moving& a, Moving& b) {
    without += dot(block.normal_impulses, pressing_speeds(block, rows, a, b));
  });
  double factor = with > without ? max(without / (without - with), 0.0) : 1.0;
  if (factor < least_factor && factor * least_factor > 1.0) factor = 1.0;
  each([&](Block& block, Normal&, Moving& a, Moving& b) {
    block.normal_impulses = factor * block.normal_impulses;
    apply_normal(block, block.normal_impulses, a, b);
    if (factor == 1.0) return;
    if (a.inverse_mass > 0.0) a.last_change = iteration;
    if (b.inverse_mass > 0.0) b.last_change = iteration;
  });
}

// Solve the blocks of islands in order, `count` times, each island as if alone. Beyond them only impacts
// go on. Changes were forgotten. `solve(iteration, is_beyond)`: all of them; returns whether a speed
// changed, and beyond, whether one did as in an impact. `scale(island, iteration)`: see above.
template <class Solve, class Scale>
void iterate(Island* first, Island* last, int count, Moving* moving, const Solve& solve,
             const Scale& scale) {
  for (int iteration = 1;; ++iteration) {
    for (Island* island = first; island < last; ++island) island->is_struck = false;
    if (!solve(iteration, iteration > 1 && iteration >= count)) return;
    bool goes_on = iteration < count;
    for (Island* island = first; island < last; ++island) {
      if (!island->is_struck || iteration >= impact_iterations) {
        if (iteration >= count) forget_changes(*island, moving);  // it is not solved again
        continue;
      }
      if (iteration % scaled_every == 0) scale(*island, iteration);
      goes_on = true;
    }
    if (!goes_on) return;
  }
}

}  // namespace box_contact::BOX_CONTACT_SET::force
