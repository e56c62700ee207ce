// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Sleep: an island that was slow for a while, and that contacts hold, is laid down. Its bodies keep the
// poses that were given, without a velocity, and its patches their impulses. Until an input of it
// differs, nothing of it is solved, looked for or moved.
//
// What is to wake in an advance is copied to what is awake, and leaves what is asleep once the advance
// has succeeded.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "falling_asleep.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// The bodies of which something may be given otherwise than in the last advance.
struct Changed {
  bool is_known;  // false: all
  const int64_t* bodies;
  int64_t count;
};

class Sleep {
 public:
  // Bodies that forces move, but for those asleep; and bodies that no force moves.
  const std::vector<int32_t>& awake() const { return awake_; }
  const std::vector<int32_t>& fixed() const { return fixed_; }
  const std::vector<Patch>& patches() const { return patches_; }
  const std::vector<Load>& loads() const { return loads_; }
  bool has(const BoxPair& pair) const { return find(patches_, pair) != nullptr; }
  bool is_asleep(size_t body) const {
    return of_[body].island >= 0 && wakes_[size_t(of_[body].island)] != Wakes::now;
  }
  bool is_any_asleep() const { return is_any_asleep_; }
  // Whether a body is where it was, and stays there.
  bool is_quiet(size_t body) const { return is_asleep(body) || of_[body].is_fixed_still; }
  // Where a body is at the start of an advance: one asleep is where it was laid down.
  const bc_pose& pose_of(size_t body, const Given& given) const {
    return is_asleep(body) ? of_[body].pose : given.poses[body];
  }
  // Changes with what is asleep or quiet.
  int64_t revision() const { return revision_; }

  void make_room(size_t bodies, size_t patches) {
    patches_.reserve(patches);
    loads_.reserve(patches);
    wakes_.reserve(bodies);
    of_.reserve(bodies);
    awake_.reserve(bodies);
    fixed_.reserve(bodies);
  }
  // Take other bodies; those that are changed are awake. They begin with no pose of before.
  void change_bodies(const std::vector<Body>& bodies, const std::vector<uint8_t>& is_changed) {
    make_room(bodies.size(), 0);
    of_.resize(bodies.size());
    wakes_.resize(bodies.size());
    for (size_t k = 0; k < bodies.size(); ++k)
      if (k < is_changed.size() && is_changed[k]) of_[k] = {};
    list(bodies);
  }
  // All bodies, which are awake.
  void set_bodies(const std::vector<Body>& bodies) {
    of_.assign(bodies.size(), {});
    wakes_.assign(bodies.size(), Wakes::no);
    patches_.clear();
    loads_.clear();
    list(bodies);
  }

  // Mark islands that are to wake.
  void mark(size_t body) {
    if (!is_asleep(body)) return;
    wakes_[size_t(of_[body].island)] = Wakes::soon;
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
  template <class Condition>
  void mark_if(const Condition& condition) {
    for (const Patch& patch : patches_)
      if (condition(patch)) mark(patch);
  }

  // Wake the islands that are marked: copy their patches to those that are awake. Impulses are those of a
  // window, as long as it is now. Returns whether there are any.
  bool wake(const std::vector<Body>& bodies, double window, double age,
            std::vector<Patch>& patches) {
    if (!is_any_marked_) return false;
    auto wakes = [this](size_t k) { return wakes_of(patches_[k]) == Wakes::soon; };
    merge_rows(patches_, patches, wakes);
    for (Patch& patch : patches) {
      if (wakes_of(patch) != Wakes::soon) continue;
      patch.scale(window / window_of(patch));
      patch.age = age;
    }
    for (Wakes& each : wakes_)
      if (each == Wakes::soon) each = Wakes::now;
    is_any_marked_ = false;
    is_any_waking_ = true;
    list(bodies);
    return true;
  }

  // Mark what is given otherwise than when it was laid down, and what lies on a body that no force
  // moves, and that moves.
  void compare(const Given& given, const Changed& changed) {
    size_t count = !is_any_asleep_ ? 0 : changed.is_known ? size_t(changed.count) : of_.size();
    for (size_t k = 0; k < count; ++k) {
      size_t body = changed.is_known ? size_t(changed.bodies[k]) : k;
      if (is_asleep(body) && !is_as_laid(body, given)) mark(body);
    }
    bool is_bearing = false;
    for (int32_t body : fixed_) {
      OfBody& of = of_[size_t(body)];
      bool stays = is_still(given.velocities[body]) && have_same_bits(of.pose, given.poses[body]);
      revision_ += stays != of.is_fixed_still;
      of.is_fixed_still = stays;
      is_bearing |= !stays && of.bears;
    }
    if (is_bearing)
      mark_if([this](const Patch& patch) {
        return !is_quiet(size_t(patch.a)) || !is_quiet(size_t(patch.b));
      });
  }

  // Hear what an answer, asked so long ago at poses, says of patches asleep. Islands of which it says something
  // new are marked.
  void hear(const std::vector<Body>& bodies, const std::vector<Patch>& next, double age,
            const bc_pose* asked) {
    auto told = next.begin();
    auto is_awake = [&](int32_t k) { return bodies[size_t(k)].is_free() && !is_asleep(size_t(k)); };
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
  // Whether a patch is of something asleep.
  bool is_asleep(const Patch& patch) const {
    return is_asleep(size_t(patch.a)) || is_asleep(size_t(patch.b));
  }

  // Copy the loads of what wakes to those of what is awake.
  void wake_loads(std::vector<Load>& loads) const {
    merge_rows(loads_, loads, [this](size_t k) { return wakes_of(patches_[k]) == Wakes::now; });
  }
  // What wakes is awake from now on, as the advance has succeeded.
  void finish_waking(const std::vector<Body>& bodies) {
    if (!is_any_waking_) return;
    auto goes = [this](size_t k) { return wakes_of(patches_[k]) == Wakes::now; };
    drop_rows(loads_, goes);
    drop_rows(patches_, goes);
    for (OfBody& of : of_)
      if (of.island >= 0 && wakes_[size_t(of.island)] == Wakes::now) of = {};
    forget_marks(bodies);
  }
  // What would have woken sleeps on, as the advance has failed.
  void cancel_waking(const std::vector<Body>& bodies) {
    if (is_any_waking_ || is_any_marked_) forget_marks(bodies);
  }
  bool is_any_waking() const { return is_any_waking_; }

  // Note what is given of the islands that fall asleep at the end of an advance. Returns whether any does.
  bool fall_asleep(Islands& islands, const std::vector<Body>& bodies,
                   const std::vector<Patch>& patches, const Given& given, const SubSteps& steps) {
    FallingAsleep falling(islands, bodies, patches, given, steps);
    bool is_any = false;
    for (const Island& island : islands.all) {
      if (!falling.falls_asleep(island, [this](size_t k) { return of_[k].is_fixed_still; }))
        continue;
      is_any = true;
      int32_t name = islands.moving[island.body].body;
      falling.count_loads(island);
      each_free(island, islands, [&](const Moving& moving) {
        OfBody& of = of_[size_t(moving.body)];
        of = {given.poses[moving.body], {}, {}, steps.window, now_, name, false, false};
        if (given.outside) of.outside = given.outside[moving.body];
        for (int i = 0; i < 3; ++i) {
          of.wrench.force[i] = moving.impulse[i] / steps.dt;
          of.wrench.torque[i] = moving.angular_impulse[i] / steps.dt;
        }
      });
    }
    return is_any;
  }
  // Lay down the bodies that fell asleep, with their patches and loads.
  void lay_down(const std::vector<Body>& bodies, std::vector<Patch>& patches,
                std::vector<Load>& loads) {
    auto goes = [&](size_t k) { return is_asleep(patches[k]); };
    merge_rows(loads, loads_, goes);
    drop_rows(loads, goes);
    merge_rows(patches, patches_, goes);
    drop_rows(patches, goes);
    list(bodies);
  }
  // Write where bodies end that fell asleep, before they are laid down.
  void write_new_ends(const bc_motion& motion) const {
    for (int32_t body : awake_)
      if (is_asleep(size_t(body))) write_end(size_t(body), motion);
  }
  // Write where all bodies asleep end.
  void write_ends(const bc_motion& motion) const {
    for (size_t k = 0; k < of_.size(); ++k)
      if (is_asleep(k)) write_end(k, motion);
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
  // Whether an island is to wake, or wakes in this advance.
  enum class Wakes : uint8_t { no, soon, now };
  struct OfBody {
    bc_pose pose{};  // as it was laid down; of a body that no force moves: in the last advance
    bc_wrench outside{};
    bc_wrench wrench{};           // of contacts: the loads
    double window = 0.0;          // of its patches' impulses [s]
    double since = -1e300;        // when that was; of what is awake, before all time [s]
    int32_t island = -1;          // the lowest body of its island; −1: it is awake
    bool is_fixed_still = false;  // of a body that no force moves
    bool bears = false;           // the same: whether something asleep lies on it
  };

  // Whether all that is given of a body asleep is as it was when it was laid down, to the bit.
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

  // Whether an answer says of a patch asleep what was known. The first one is of poses a little other than
  // those of the patch.
  bool is_told_again(const Patch& patch, const Patch& next, const bc_pose* asked) const {
    if (!have_same_bits(of_[size_t(patch.a)].pose, asked[patch.a]) ||
        !have_same_bits(of_[size_t(patch.b)].pose, asked[patch.b]) ||
        next.friction != patch.friction || !have_same_bits(next.surface, patch.surface))
      return false;
    if (have_same_bits(next.asked_a, patch.asked_a) && have_same_bits(next.asked_b, patch.asked_b))
      return have_same_bits(next.normal, patch.normal) && have_same_bits(next.point, patch.point) &&
             next.depth == patch.depth;
    return std::fabs(next.depth - patch.depth) <= settled_gap;
  }
  // Whether a question, asked so long ago, is of the time before the bodies of a patch fell asleep: it
  // tells nothing of them.
  bool is_of_before(const Patch& patch, double age) const {
    return now_ - age < std::max(of_[size_t(patch.a)].since, of_[size_t(patch.b)].since);
  }
  double window_of(const Patch& patch) const {
    return std::max(of_[size_t(patch.a)].window, of_[size_t(patch.b)].window);
  }
  // Of a patch of what is asleep, or wakes. One that joins two islands is none.
  Wakes wakes_of(const Patch& patch) const {
    int32_t island = std::max(of_[size_t(patch.a)].island, of_[size_t(patch.b)].island);
    return island >= 0 ? wakes_[size_t(island)] : Wakes::no;
  }
  void forget_marks(const std::vector<Body>& bodies) {
    std::fill(wakes_.begin(), wakes_.end(), Wakes::no);
    is_any_marked_ = is_any_waking_ = false;
    list(bodies);
  }
  void list(const std::vector<Body>& bodies) {
    awake_.clear();
    fixed_.clear();
    is_any_asleep_ = false;
    ++revision_;
    for (size_t k = 0; k < bodies.size(); ++k) {
      if (!bodies[k].is_free()) {
        fixed_.push_back(int32_t(k));
        of_[k].bears = false;
      } else if (is_asleep(k)) {
        is_any_asleep_ = true;
      } else {
        awake_.push_back(int32_t(k));
      }
    }
    for (const Patch& patch : patches_)
      if (is_asleep(patch))
        for (int32_t body : {patch.a, patch.b}) of_[size_t(body)].bears = true;
  }

  std::vector<OfBody> of_;
  std::vector<int32_t> awake_, fixed_;
  bool is_any_asleep_ = false;
  int64_t revision_ = 0;
  std::vector<Patch> patches_;  // of what is asleep, or wakes, by pair
  std::vector<Load> loads_;     // theirs
  std::vector<Wakes> wakes_;    // of islands, by their names
  bool is_any_marked_ = false, is_any_waking_ = false;
  double now_ = 0.0;  // since the first advance [s]
};

}  // namespace box_contact::BOX_CONTACT_SET::force
