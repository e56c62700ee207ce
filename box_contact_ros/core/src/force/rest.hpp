// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rest: an island that was slow for a while, and that contacts hold, is laid down. Its bodies keep the
// poses that were given, without a velocity, and its patches their impulses. Until an input of it
// differs, nothing of it is solved, looked for or moved.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "advance_inputs.hpp"
#include "rest_conditions.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// An island is slow while all its bodies are slower than this, by their energies [m/s].
constexpr double rest_speed = 1e-4;
// It is laid down once it was slow for this time [s].
constexpr double rest_time = 0.5;
// Then it is no faster than it was within that time, or than this share of what is slow [1]: what begins
// to tip gains speed.
constexpr double calm_share = 0.1;
// By how much the first answer to a patch at rest may differ from the one that it has [m].
constexpr double settled_gap = 1e-5;
// What is awake rests since then [s].
constexpr double never = -1e300;

// Move rows to others, where `goes(place)`. Both are by pair, and there is room.
template <class Row, class Goes>
void hand_over(std::vector<Row>& from, std::vector<Row>& to, const Goes& goes) {
  size_t count = 0, old = to.size(), kept = 0;
  for (size_t k = 0; k < from.size(); ++k) count += goes(k);
  size_t end = old + count;
  to.resize(end);
  for (size_t k = from.size(); end > old && k-- > 0;) {
    if (!goes(k)) continue;
    while (old > 0 && from[k].pair() < to[old - 1].pair()) to[--end] = to[--old];
    to[--end] = from[k];
  }
  for (size_t k = 0; k < from.size(); ++k)
    if (!goes(k)) from[kept++] = from[k];
  from.resize(kept);
}

class Rest {
 public:
  // Bodies that forces move, but for those at rest; and bodies that no force moves.
  const std::vector<int32_t>& awake() const { return awake_; }
  const std::vector<int32_t>& fixed() const { return fixed_; }
  const std::vector<Patch>& patches() const { return patches_; }
  const std::vector<Load>& loads() const { return loads_; }
  bool is_any() const { return !patches_.empty(); }
  bool has(const BoxPair& pair) const { return find(patches_, pair) != nullptr; }
  bool is_at_rest(size_t body) const { return of_[body].island >= 0; }
  // Whether a body is where it was, and stays there.
  bool is_quiet(size_t body) const { return is_at_rest(body) || of_[body].is_fixed_still; }

  void make_room(size_t bodies, size_t patches) {
    patches_.reserve(patches);
    loads_.reserve(patches);
    is_marked_.reserve(bodies);
    of_.reserve(bodies);
    awake_.reserve(bodies);
    fixed_.reserve(bodies);
  }
  // Take other bodies; those that are changed are awake. They begin with no pose of before.
  void change_bodies(const std::vector<Body>& bodies, const std::vector<uint8_t>& is_changed) {
    make_room(bodies.size(), 0);
    of_.resize(bodies.size());
    is_marked_.resize(bodies.size());
    for (size_t k = 0; k < bodies.size(); ++k)
      if (k < is_changed.size() && is_changed[k]) of_[k] = {};
    list(bodies);
  }
  // All bodies, which are awake.
  void set_bodies(const std::vector<Body>& bodies) {
    of_.assign(bodies.size(), {});
    is_marked_.assign(bodies.size(), 0);
    is_any_marked_ = false;
    patches_.clear();
    loads_.clear();
    list(bodies);
  }

  // Mark islands, which then wake.
  void mark(size_t body) {
    if (!is_at_rest(body)) return;
    is_marked_[size_t(of_[body].island)] = 1;
    is_any_marked_ = true;
  }
  void mark(const Patch& patch) {
    mark(size_t(patch.a));
    mark(size_t(patch.b));
  }
  void mark_those(const std::vector<uint8_t>& is_chosen) {  // and what touches them
    for (size_t k = 0; k < of_.size(); ++k)
      if (is_chosen[k]) mark(k);
    mark_if([&](const Patch& patch) {
      return is_chosen[size_t(patch.a)] || is_chosen[size_t(patch.b)];
    });
  }
  void mark_all() {
    for (size_t k = 0; k < of_.size(); ++k) mark(k);
  }
  template <class Condition>
  void mark_if(const Condition& condition) {
    for (const Patch& patch : patches_)
      if (condition(patch)) mark(patch);
  }
  void unmark() {
    std::fill(is_marked_.begin(), is_marked_.end(), uint8_t(0));
    is_any_marked_ = false;
  }
  bool is_any_marked() const { return is_any_marked_; }
  bool is_marked(const Patch& patch) const {
    return is_marked_[size_t(std::max(of_[size_t(patch.a)].island, of_[size_t(patch.b)].island))];
  }

  // Mark what is given otherwise than when it was laid down, and what lies on a body that no force
  // moves, and that moves. Returns whether other bodies of mass 0 move than lately.
  bool compare(const Given& given, const Changed& changed) {
    size_t count = !is_any() ? 0 : changed.is_known ? size_t(changed.count) : of_.size();
    for (size_t k = 0; k < count; ++k) {
      size_t body = changed.is_known ? size_t(changed.bodies[k]) : k;
      if (is_at_rest(body) && !is_as_laid(body, given)) mark(body);
    }
    bool is_other = false, is_bearing = false;
    for (int32_t body : fixed_) {
      OfBody& of = of_[size_t(body)];
      bool stays = is_still(given.velocities[body]) && have_same_bits(of.pose, given.poses[body]);
      is_other |= stays != of.is_fixed_still;
      of.is_fixed_still = stays;
      is_bearing |= !stays && of.bears;
    }
    if (is_bearing)
      mark_if([this](const Patch& patch) {
        return !is_quiet(size_t(patch.a)) || !is_quiet(size_t(patch.b));
      });
    return is_other;
  }

  // Take what an answer, asked so long ago at poses, says of patches at rest: it goes from `next`, by pair.
  // Islands of which it says something new are marked.
  void take(const std::vector<Body>& bodies, std::vector<Patch>& next, double age,
            const bc_pose* asked) {
    auto told = next.begin();
    auto is_awake = [&](int32_t k) {
      return bodies[size_t(k)].is_free() && !is_at_rest(size_t(k));
    };
    // What moves may have come to touch since the question.
    auto mark_new = [&](const Patch& patch) {
      if (patch.age >= 0.0 && (!is_of_before(patch, age) || is_awake(patch.a) || is_awake(patch.b)))
        mark(patch);
    };
    for (Patch& patch : patches_) {
      for (; told != next.end() && told->pair() < patch.pair(); ++told) mark_new(*told);
      bool is_told = told != next.end() && told->pair() == patch.pair();
      const Patch* again = is_told ? &*told++ : nullptr;
      if ((again && again->age < 0.0) || is_of_before(patch, age)) continue;
      if (!again || !is_told_again(patch, *again, asked)) {
        mark(patch);
        continue;
      }
      Patch before = patch;
      patch = *again;
      patch.keep(before);
    }
    std::for_each(told, next.end(), mark_new);
  }
  // Whether a patch is of something at rest.
  bool rests(const Patch& patch) const {
    return is_at_rest(size_t(patch.a)) || is_at_rest(size_t(patch.b));
  }

  // Wake the islands that are marked: their patches and loads go to those that are awake. Impulses are
  // those of a window, as long as it is now.
  void wake(const std::vector<Body>& bodies, double window, double age, std::vector<Patch>& patches,
            std::vector<Load>& loads) {
    auto wakes = [this](size_t k) { return is_marked(patches_[k]); };
    for (size_t k = 0; k < patches_.size(); ++k) {
      if (!wakes(k)) continue;
      patches_[k].scale(window / window_of(patches_[k]));
      patches_[k].age = age;
    }
    hand_over(loads_, loads, wakes);
    hand_over(patches_, patches, wakes);
    for (OfBody& of : of_)
      if (of.island >= 0 && is_marked_[size_t(of.island)]) of = {};
    unmark();
    list(bodies);
  }

  // Count for how long islands are slow at the end of an advance, and note what is given of those that
  // come to rest. Returns whether any does.
  bool count(Islands& islands, const std::vector<Body>& bodies, const std::vector<Patch>& patches,
             const Given& given, const SubSteps& steps) {
    bool is_any = false;
    for (const Island& island : islands.all) {
      if (!comes_to_rest(island, islands, bodies, patches, given.poses, steps)) continue;
      is_any = true;
      int32_t name = islands.moving[island.body].body;
      add_loads(island, islands);
      each_free(island, islands, [&](const Moving& moving) {
        auto k = size_t(moving.body);
        of_[k].island = name;
        of_[k].pose = given.poses[k];
        of_[k].outside = given.outside ? given.outside[k] : bc_wrench{};
        of_[k].window = steps.window;
        of_[k].since = now_;
        for (int i = 0; i < 3; ++i) {
          of_[k].wrench.force[i] = moving.impulse[i] / steps.dt;
          of_[k].wrench.torque[i] = moving.angular_impulse[i] / steps.dt;
        }
      });
    }
    return is_any;
  }
  // Lay down the bodies that came to rest, with their patches and loads.
  void lay_down(const std::vector<Body>& bodies, std::vector<Patch>& patches,
                std::vector<Load>& loads) {
    auto goes = [&](size_t k) { return rests(patches[k]); };
    hand_over(loads, loads_, goes);
    hand_over(patches, patches_, goes);
    list(bodies);
  }
  // Write where bodies end that come to rest, before they are laid down.
  void write_new_ends(const bc_motion& motion) const {
    for (int32_t body : awake_)
      if (is_at_rest(size_t(body))) write_end(size_t(body), motion);
  }
  // Write where all bodies at rest end.
  void write_ends(const bc_motion& motion) const {
    for (size_t k = 0; k < of_.size(); ++k)
      if (is_at_rest(k)) write_end(k, motion);
  }
  // Write which bodies are awake.
  void write_awake(unsigned char* is_awake) const {
    std::fill_n(is_awake, of_.size(), static_cast<unsigned char>(0));
    for (int32_t body : awake_) is_awake[body] = 1;
    for (int32_t body : fixed_) is_awake[body] = !of_[size_t(body)].is_fixed_still;
  }
  // End an advance: keep where the bodies that no force moves were given.
  void end(const bc_pose* poses, double dt) {
    now_ += dt;
    for (int32_t body : fixed_) of_[size_t(body)].pose = poses[body];
  }

 private:
  struct OfBody {
    // As it was laid down. Of a body that no force moves: its pose in the last advance.
    bc_pose pose{};
    bc_wrench outside{};
    bc_wrench wrench{};           // of contacts: the loads
    double window = 0.0;          // of its patches' impulses [s]
    double since = never;         // when that was [s]
    int32_t island = -1;          // the lowest body of its island; −1: it is awake
    bool is_fixed_still = false;  // of a body that no force moves
    bool bears = false;           // the same: whether something at rest lies on it
    // While it is awake.
    double slow_time = 0.0;  // for how long its island was slow [s]
    double least = 0.0;      // the least square of its speed since then [m²/s²]
  };

  // Whether all that is given of a body at rest is as it was when it was laid down, to the bit.
  bool is_as_laid(size_t k, const Given& given) const {
    const OfBody& of = of_[k];
    constexpr bc_wrench no_wrench{};
    return have_same_bits(of.pose, given.poses[k]) && is_still(given.velocities[k]) &&
           have_same_bits(of.outside, given.outside ? given.outside[k] : no_wrench);
  }
  void write_end(size_t k, const bc_motion& motion) const {
    motion.poses[k] = of_[k].pose;
    if (motion.velocities) motion.velocities[k] = {};
    if (motion.wrenches) motion.wrenches[k] = of_[k].wrench;
  }

  // Whether an answer says of a patch at rest what was known. The first one is of poses a little other
  // than those of the patch.
  bool is_told_again(const Patch& patch, const Patch& next, const bc_pose* asked) const {
    if (!have_same_bits(of_[size_t(patch.a)].pose, asked[patch.a]) ||
        !have_same_bits(of_[size_t(patch.b)].pose, asked[patch.b]) ||
        next.friction != patch.friction || next.stiffness != patch.stiffness ||
        !have_same_bits(next.surface, patch.surface))
      return false;
    if (have_same_bits(next.asked_a, patch.asked_a) && have_same_bits(next.asked_b, patch.asked_b))
      return have_same_bits(next.normal, patch.normal) && have_same_bits(next.point, patch.point) &&
             next.depth == patch.depth;
    return std::fabs(next.depth - patch.depth) <= settled_gap;
  }
  // Whether a question, asked so long ago, is of the time before the bodies of a patch came to rest: it
  // tells nothing of them.
  bool is_of_before(const Patch& patch, double age) const {
    return now_ - age < std::max(of_[size_t(patch.a)].since, of_[size_t(patch.b)].since);
  }
  double window_of(const Patch& patch) const {
    return std::max(of_[size_t(patch.a)].window, of_[size_t(patch.b)].window);
  }
  void list(const std::vector<Body>& bodies) {
    awake_.clear();
    fixed_.clear();
    for (size_t k = 0; k < bodies.size(); ++k) {
      if (!bodies[k].is_free()) {
        fixed_.push_back(int32_t(k));
        of_[k].bears = false;
      } else if (!is_at_rest(k)) {
        awake_.push_back(int32_t(k));
      }
    }
    for (const Patch& patch : patches_)
      for (int32_t body : {patch.a, patch.b}) of_[size_t(body)].bears = true;
  }

  bool comes_to_rest(const Island& island, Islands& islands, const std::vector<Body>& bodies,
                     const std::vector<Patch>& patches, const bc_pose* given, const SubSteps& steps) {
    double least = rest_time, limit = rest_speed * rest_speed,
           calm = calm_share * calm_share * limit;
    bool is_slow = island.block < island.block_end, is_calm = true;
    for (size_t k = island.body; is_slow && k < island.body_end; ++k) {
      Moving& moving = islands.moving[k];
      auto body = size_t(moving.body);
      moving.speed_squared = speed_squared(bodies[body], moving);
      is_slow = bodies[body].is_free() ? moving.speed_squared < limit : of_[body].is_fixed_still;
    }
    each_free(island, islands, [&](const Moving& moving) {
      OfBody& of = of_[size_t(moving.body)];
      if (of.slow_time == 0.0 || moving.speed_squared < of.least) of.least = moving.speed_squared;
      of.slow_time = is_slow ? of.slow_time + steps.dt : 0.0;
      least = std::min(least, of.slow_time);
      is_calm = is_calm && moving.speed_squared <= std::max(of.least, calm);
    });
    if (least < rest_time) return false;
    if (is_calm && is_held(island, islands, patches, steps) &&
        have_stayed(island, islands, bodies, given, steps.dt, limit))
      return true;
    each_free(island, islands,
              [&](const Moving& moving) { of_[size_t(moving.body)].slow_time = 0.0; });
    return false;
  }

  std::vector<OfBody> of_;
  std::vector<int32_t> awake_, fixed_;
  std::vector<Patch> patches_;      // of what is at rest, by pair
  std::vector<Load> loads_;         // theirs
  std::vector<uint8_t> is_marked_;  // of islands, by their names
  bool is_any_marked_ = false;
  double now_ = 0.0;  // since the first advance [s]
};

}  // namespace box_contact::BOX_CONTACT_SET::force
