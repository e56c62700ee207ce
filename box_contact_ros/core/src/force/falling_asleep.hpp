// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// When islands fall asleep: at the end of an advance, once they were slow for a while, and contacts hold them.
#pragma once

#include <algorithm>
#include <vector>

#include "body_step.hpp"
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

class FallingAsleep {
 public:
  FallingAsleep(Islands& islands, const std::vector<Body>& bodies,
                const std::vector<Patch>& patches, const Given& given, const SubSteps& steps)
      : islands_(islands), bodies_(bodies), patches_(patches), given_(given), steps_(steps) {}

  // Count for how long an island is slow, and return whether it falls asleep. `stays(body)`: whether a body
  // that no force moves is where it was.
  template <class Stays>
  bool falls_asleep(const Island& island, const Stays& stays) const {
    bool is_slow = island.block < island.block_end, is_calm = true;
    for (size_t k = island.body; is_slow && k < island.body_end; ++k) {
      Moving& moving = islands_.moving[k];
      auto body = size_t(moving.body);
      moving.speed_squared = speed_squared(bodies_[body], moving);
      is_slow = bodies_[body].is_free() ? moving.speed_squared < limit : stays(body);
    }
    double time = sleep_time;
    each_free(island, islands_, [&](Moving& moving) {
      SlowTime& slow = moving.slow;
      if (slow.time == 0.0 || moving.speed_squared < slow.least) slow.least = moving.speed_squared;
      slow.time = is_slow ? slow.time + steps_.dt : 0.0;
      time = std::min(time, slow.time);
      is_calm = is_calm && moving.speed_squared <= std::max(slow.least, calm);
    });
    if (time < sleep_time) return false;
    if (is_calm && is_supported(island) && has_stayed(island)) return true;
    each_free(island, islands_, [](Moving& moving) { moving.slow = {}; });
    return false;
  }
  // The impulses of an advance as the loads have them: after relaxation.
  void count_loads(const Island& island) const {
    each_free(island, islands_,
              [](Moving& moving) { moving.impulse = moving.angular_impulse = {}; });
    for (size_t k = island.block; k < island.block_end; ++k) {
      Block& block = islands_.blocks[k];
      block.normal_impulses = block.normal_sum;
      block.friction_impulses = block.friction_sum;
      block.normal_counted = block.friction_counted = {};
      count<double>(block, islands_.moving[size_t(block.a)], islands_.moving[size_t(block.b)]);
    }
  }

 private:
  static constexpr double limit = sleep_speed * sleep_speed, calm = calm_share * calm_share * limit;

  // Whether all bodies of an island were slow on the mean of an advance: what slid, or fell, and stopped within
  // it does not rest where it was given.
  bool has_stayed(const Island& island) const {
    bool have_all = true;
    each_free(island, islands_, [&](const Moving& moving) {
      const Body& body = bodies_[size_t(moving.body)];
      Placed from = placed_at(given_.poses[moving.body], body.centre);
      double rate = 1.0 / steps_.dt;
      Motion mean{rate * (moving.placed.position - from.position),
                  rate * rotation(from, moving.placed)};
      have_all = have_all && speed_squared(body, moving.placed, mean) < limit;
    });
    return have_all;
  }
  // Whether contacts hold all bodies of an island, from those that no force moves on: friction could stop
  // them within the advance. What lies on ice, floats or goes on a belt is not at rest.
  bool is_supported(const Island& island) const {
    std::vector<Moving>& all = islands_.moving;
    for (size_t k = island.body; k < island.body_end; ++k)
      all[k].is_supported = all[k].inverse_mass == 0.0;
    for (bool goes_on = true; goes_on;) {
      goes_on = false;
      for (size_t k = island.block; k < island.block_end; ++k) {
        const Block& block = islands_.blocks[k];
        const Patch& patch = patches_[size_t(block.patch)];
        if (dot(patch.surface, patch.surface) != 0.0 || patch.age > steps_.overdue) return false;
        Moving &a = all[size_t(block.a)], &b = all[size_t(block.b)];
        if (a.is_supported == b.is_supported) continue;
        const Moving& other = a.is_supported ? b : a;
        double most = block.friction * block.normal_sum[0] * other.inverse_mass;  // [m/s]
        if (most > 0.0 && other.speed_squared <= most * most)
          a.is_supported = b.is_supported = goes_on = true;
      }
    }
    return std::all_of(all.begin() + long(island.body), all.begin() + long(island.body_end),
                       [](const Moving& moving) { return moving.is_supported; });
  }

  Islands& islands_;
  const std::vector<Body>& bodies_;
  const std::vector<Patch>& patches_;
  const Given& given_;
  const SubSteps& steps_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
