// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What tells whether an island may come to rest at the end of an advance.
#pragma once

#include <algorithm>
#include <vector>

#include "islands.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

template <class Visit>
void each_free(const Island& island, Islands& islands, const Visit& visit) {
  for (size_t k = island.body; k < island.body_end; ++k)
    if (islands.moving[k].inverse_mass > 0.0) visit(islands.moving[k]);
}

// Twice the kinetic energy by the mass [m²/s²].
inline double speed_squared(const Body& body, const Placed& placed, const Motion& motion) {
  Vec<double> turning = transposed_times(placed.axes, motion.angular);
  return dot(motion.linear, motion.linear) +
         body.inverse_mass * dot(turning / body.inverse_inertia, turning);
}
// At the end of an advance: with pushing out, and after relaxation.
inline double speed_squared(const Body& body, const Moving& moving) {
  return std::max(speed_squared(body, moving.placed, moving.pushed),
                  speed_squared(body, moving.placed, {moving.linear, moving.angular}));
}

// Whether the mean speeds of an advance have squares below a limit, of all bodies of an island: what slid, or fell, and stopped within
// it does not rest where it was given.
inline bool have_stayed(const Island& island, Islands& islands, const std::vector<Body>& bodies,
                        const bc_pose* given, double dt, double limit) {
  bool all_have = true;
  each_free(island, islands, [&](const Moving& moving) {
    const Body& body = bodies[size_t(moving.body)];
    Placed from = placed_at(given[moving.body], body.centre);
    double rate = 1.0 / dt;
    Motion mean{rate * (moving.placed.position - from.position), rate * turn(from, moving.placed)};
    all_have = all_have && speed_squared(body, moving.placed, mean) < limit;
  });
  return all_have;
}

// The impulses of an advance as the loads have them: after relaxation.
inline void add_loads(const Island& island, Islands& islands) {
  each_free(island, islands, [](Moving& moving) { moving.impulse = moving.angular_impulse = {}; });
  for (size_t k = island.block; k < island.block_end; ++k) {
    Block& block = islands.blocks[k];
    block.normal_impulses = block.normal_sum;
    block.friction_impulses = block.friction_sum;
    block.normal_counted = block.friction_counted = {};
    count<double>(block, islands.moving[size_t(block.a)], islands.moving[size_t(block.b)]);
  }
}

// Whether contacts hold all bodies of an island, from those that no force moves on: friction could stop
// them within the advance. What lies on ice, floats or goes on a belt is not at rest.
inline bool is_held(const Island& island, Islands& islands, const std::vector<Patch>& patches,
                    const SubSteps& steps) {
  for (size_t k = island.body; k < island.body_end; ++k)
    islands.moving[k].is_held = islands.moving[k].inverse_mass == 0.0;
  for (bool goes_on = true; goes_on;) {
    goes_on = false;
    for (size_t k = island.block; k < island.block_end; ++k) {
      const Block& block = islands.blocks[k];
      const Patch& patch = patches[size_t(block.patch)];
      if (dot(patch.surface, patch.surface) != 0.0 || patch.age > steps.overdue) return false;
      Moving &a = islands.moving[size_t(block.a)], &b = islands.moving[size_t(block.b)];
      if (a.is_held == b.is_held) continue;
      const Moving& other = a.is_held ? b : a;
      double most = block.friction * block.normal_sum[0] * other.inverse_mass;  // [m/s]
      if (most > 0.0 && other.speed_squared <= most * most) a.is_held = b.is_held = goes_on = true;
    }
  }
  return std::all_of(islands.moving.begin() + long(island.body),
                     islands.moving.begin() + long(island.body_end),
                     [](const Moving& moving) { return moving.is_held; });
}

}  // namespace box_contact::BOX_CONTACT_SET::force
