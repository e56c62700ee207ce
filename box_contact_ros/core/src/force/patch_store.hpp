// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bodies, boxes and patches, and what changes them between advances: other bodies or boxes, answers, and to
// forget.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "../../include/box_contact/force.h"
#include "island_step.hpp"
#include "own_contacts.hpp"
#include "patch_reader.hpp"
#include "rims.hpp"
#include "sleep.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// What an advance leads from one to another, of what is awake. One that fails leaves the first as it is: bodies,
// and what sleeps, are written at its end.
struct State {
  std::vector<Patch> patches;  // by pair
  std::vector<Load> loads;     // of the last advance, by pair
  Clock clock;
  bool has_loads = true;  // none since bodies or boxes were changed, or patches forgotten
  bool is_moved_by_wrenches = false;  // whether the caller moves the bodies since the last advance
};

class PatchStore {
 public:
  enum class HoldResult { all, pair_twice, no_patch };

  // side: the kernel's, or null.
  PatchStore(std::vector<Body> bodies, const Options& options, const detail::ForceKernel* side)
      : bodies_(std::move(bodies)),
        options_(options),
        ended_(bodies_.size()),
        poses_(bodies_.size()),
        carriers_(bodies_.size()),
        starts_(bodies_.size()),
        islands_(side) {
    sleep_.set_bodies(bodies_);
    rims_.set_bodies(bodies_.size());
    make_room(0);
  }

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<bc_body_box>& boxes() const { return own_.boxes(); }
  int threads() const { return options_.threads; }
  int64_t box_count() const { return int64_t(boxes().empty() ? bodies_.size() : boxes().size()); }
  int64_t body_of(int64_t box) const { return boxes().empty() ? box : boxes()[size_t(box)].body; }

  // Change masses, add bodies at the end, or drop bodies there with their patches.
  void set_bodies(std::vector<Body> bodies) {
    std::vector<uint8_t> is_changed(bodies_.size());
    for (size_t k = 0; k < bodies_.size(); ++k)
      is_changed[k] = k >= bodies.size() || !have_same_bits(bodies[k], bodies_[k]);
    sleep_.mark_those(is_changed);
    wake();
    for (size_t k = 0; k < std::min(bodies.size(), bodies_.size()); ++k)
      if (bodies[k].is_free() != bodies_[k].is_free()) begin_anew(k);
    ended_.resize(bodies.size());
    poses_.resize(bodies.size());
    carriers_.resize(bodies.size());
    starts_.resize(bodies.size());
    surfaces_.reserve(bodies.size());
    rims_.set_bodies(bodies.size());
    sleep_.change_bodies(bodies, is_changed);
    bodies_ = std::move(bodies);  // last: there may be no memory for the others
    auto count = int32_t(bodies_.size());
    make_room(state_.patches.size());
    if (!surfaces_.empty()) surfaces_.resize(size_t(box_count()));
    drop([this, count](const Patch& patch) {
      return !is_of_boxes(patch) || std::max(patch.a, patch.b) >= count ||
             !(bodies_[size_t(patch.a)].is_free() || bodies_[size_t(patch.b)].is_free());
    });
  }
  // Change which boxes the bodies have. Patches of boxes that stay with their body stay. Pairs are found of
  // what is awake: so those are whose boxes changed, and all bodies at first.
  void set_boxes(std::vector<bc_body_box> boxes, bool finds_pairs) {
    auto is_kept = [&](int32_t box) {
      auto k = size_t(box);
      return k < boxes.size() && k < this->boxes().size() &&
             have_same_bits(boxes[k], this->boxes()[k]);
    };
    sleep_.mark_if(
        [&](const Patch& patch) { return !is_kept(patch.box_a) || !is_kept(patch.box_b); });
    std::vector<uint8_t> is_changed(bodies_.size(), finds_pairs && !own_.finds_pairs());
    for (const std::vector<bc_body_box>* all : {&std::as_const(boxes), &this->boxes()})
      for (size_t k = 0; finds_pairs && k < all->size(); ++k)
        if (!is_kept(int32_t(k))) is_changed[size_t((*all)[k].body)] = 1;
    sleep_.mark_those(is_changed);
    wake();
    sleep_.change_bodies(bodies_, is_changed);
    if (finds_pairs) state_.clock.answer_each_step();
    surfaces_.reserve(boxes.size());
    own_.set_boxes(std::move(boxes), finds_pairs);
    if (!surfaces_.empty()) surfaces_.resize(size_t(box_count()));
    drop([this](const Patch& patch) { return !is_of_boxes(patch); });
  }
  // Those of all boxes.
  const Surfaces& surfaces() {
    surfaces_.resize(size_t(box_count()));
    return surfaces_;
  }
  // Set the surface of a box, which lasts. What touches it wakes. Answers to come add its velocity, and have its
  // friction.
  void set_surface(int64_t box, const Surface& surface) {
    Surface last = surfaces()[size_t(box)];
    if (have_same_bits(last, surface)) return;
    auto touches = [box](const Patch& patch) { return patch.box_a == box || patch.box_b == box; };
    sleep_.mark_if(touches);
    wake();
    for (Patch& patch : state_.patches)
      if (touches(patch))
        patch.surface += (patch.box_a == box ? -1.0 : 1.0) * (surface.velocity - last.velocity);
    surfaces_[size_t(box)] = surface;
  }
  // Forget the patches of bodies.
  void forget(const int64_t* bodies, int64_t count) {
    std::vector<uint8_t> is_forgotten(bodies_.size(), 0);
    for (int64_t k = 0; k < count; ++k) {
      is_forgotten[size_t(bodies[k])] = 1;
      begin_anew(size_t(bodies[k]));
    }
    sleep_.mark_those(is_forgotten);
    wake();
    drop([&is_forgotten](const Patch& patch) {
      return is_forgotten[size_t(patch.a)] || is_forgotten[size_t(patch.b)];
    });
  }
  void reset() {
    state_.patches.clear();
    state_.loads.clear();
    state_.clock = {};
    state_.is_moved_by_wrenches = false;
    ended_.assign(bodies_.size(), {});
    poses_.assign(bodies_.size(), {});
    sleep_.set_bodies(bodies_);
    is_grouped_ = false;
  }

  // Take an answer, and the poses of its question. Pairs that are missing are forgotten. Nothing changes
  // for a pair that comes twice, and for a patch beyond float64's range. `in_threads` shares chunks of work.
  template <class InThreads>
  HoldResult hold(const bc_patches& answer, const bc_pose* poses, InThreads& in_threads) {
    HoldResult result = read(answer, poses, false, in_threads);
    if (result != HoldResult::all) return result;
    hear_of_sleep(answer.age, poses);
    if (!keep_impulses(state_.patches, next_.patches)) is_grouped_ = false;
    state_.patches.swap(next_.patches);
    make_room(state_.patches.size() + sleep_.patches().size());
    own_.forget();
    state_.clock.answer(answer.age, answer.period);
    return result;
  }
  bool finds_pairs() const { return own_.finds_pairs(); }
  // The boxes of a pair of one's own that is solved.
  const int64_t* own_pair(long row) const { return own_.answer().pairs + 2 * row; }
  // Whether contacts of one's own are those of these pairs already.
  bool holds(const bc_patches& pairs) const { return own_.is_asked(pairs); }
  // Take pairs whose contacts are solved at the start of each advance. Impulses stay.
  HoldResult hold(const bc_patches& pairs) {
    bool were_told = state_.clock.is_told();
    if (!own_.ask(pairs, sleep_.is_any_asleep(),
                  [this](const BoxPair& pair) { return sleep_.has(pair); }))
      return HoldResult::pair_twice;
    state_.clock.answer_each_step();
    make_room(own_.count());
    sleep_.mark_if([&](const Patch& patch) {
      return were_told || !own_.is_asked(patch, surfaces_, options_.friction);
    });
    wake();
    if (own_.count() == 0) drop([](const Patch&) { return true; });
    return HoldResult::all;
  }

 protected:
  // Wake the islands that are marked, in an advance.
  void wake_into(std::vector<Patch>& patches) {
    if (sleep_.wake(bodies_, state_.clock.window(), state_.clock.since(), patches))
      is_grouped_ = false;
  }
  // The same, between advances.
  void wake() {
    wake_into(state_.patches);
    if (!sleep_.is_any_waking()) return;
    sleep_.wake_loads(state_.loads);
    sleep_.finish_waking(bodies_);
  }
  // Hear what an answer says of patches asleep, which then go from it. What it says new things of wakes.
  void hear_of_sleep(double age, const bc_pose* asked) {
    if (!sleep_.is_any_asleep()) return;
    sleep_.hear(bodies_, next_.patches, age, asked);
    wake();
    next_.patches.erase(
        std::remove_if(next_.patches.begin(), next_.patches.end(),
                       [this](const Patch& patch) { return sleep_.is_asleep(patch); }),
        next_.patches.end());
  }
  // What is let go, gripped or forgotten has not ended an advance: it needs no shorter sub-steps yet, and its
  // pose tells no velocity.
  void begin_anew(size_t body) {
    ended_[body] = {};
    poses_[body] = {};
  }
  // Whether the caller moves a body that no force moves by its poses alone: from where it ended to the pose
  // that is given.
  bool goes_by_poses(size_t body, const Given& given) const {
    return !bodies_[body].is_free() && is_still(given.velocities[body]) &&
           squared_norm(poses_[body].quaternion) > 0.0 &&
           !have_same_bits(poses_[body], given.poses[body]);
  }
  bc_velocity velocity_to(size_t body, const bc_pose& pose, double dt) const {
    return velocity_between(poses_[body], pose, bodies_[body].centre, dt);
  }
  bool is_of_boxes(const Patch& patch) const {
    return 0 <= patch.box_a && patch.box_a < patch.box_b && patch.box_b < box_count() &&
           body_of(patch.box_a) == patch.a && body_of(patch.box_b) == patch.b && patch.a >= 0 &&
           patch.b >= 0 && size_t(std::max(patch.a, patch.b)) < bodies_.size();
  }
  // So that an advance takes no memory. It doubles, so many answers of more and more pairs are cheap.
  void make_room(size_t patches) {
    if (patches > room_) room_ = std::max(patches, 2 * room_);
    for (auto* state : {&state_, &next_}) {
      state->patches.reserve(room_);
      state->loads.reserve(room_);
    }
    woken_.reserve(room_);
    sleep_.make_room(bodies_.size(), room_);
    islands_.make_room(bodies_.size(), room_);
    reader_.make_room(room_);
  }
  // Loads name boxes, which may be others or none from now on.
  template <class Condition>
  void drop(Condition condition) {
    std::vector<Patch>& patches = state_.patches;
    state_.has_loads = false;
    patches.erase(std::remove_if(patches.begin(), patches.end(), condition), patches.end());
    is_grouped_ = false;
  }

  // Read an answer, by pair.
  template <class InThreads>
  HoldResult read(const bc_patches& answer, const bc_pose* poses, bool is_own,
                  InThreads& in_threads) {
    std::vector<Patch>& found = next_.patches;
    const Answered all{answer, poses, bodies_, boxes(), surfaces_, options_.friction};
    reader_.read_rows(
        all,
        [&](size_t place) { return is_own ? own_.row(place) : place; }, found,
        [&](long count, const auto& work) { in_threads(options_.threads, count, work); });
    for (const Patch& patch : found)
      if (patch.age >= 0.0 && !patch.has_area()) return HoldResult::no_patch;
    if (!boxes().empty()) rims_.drop(all, found);
    auto same = [](const Patch& p, const Patch& q) { return p.pair() == q.pair(); };
    if (!std::is_sorted(found.begin(), found.end(), ByPair{}))
      std::sort(found.begin(), found.end(), ByPair{});
    bool is_any_twice = std::adjacent_find(found.begin(), found.end(), same) != found.end();
    return is_any_twice ? HoldResult::pair_twice : HoldResult::all;
  }

  std::vector<Body> bodies_;
  Options options_;
  OwnContacts own_;
  Surfaces surfaces_;
  std::vector<Ended> ended_;    // of the bodies
  std::vector<bc_pose> poses_;  // of the bodies at the end of the last advance; none: all zero
  std::vector<bc_velocity> carriers_;  // of the bodies that no force moves, in an advance
  std::vector<bc_pose> starts_;        // of all bodies, where one of them goes by its poses
  State state_, next_;          // as the last advance ended, and as the next one will
  std::vector<Patch> woken_;    // of what wakes in this advance, as it was
  Sleep sleep_;                 // patches and loads of what is asleep are there
  // Memory that calls use again.
  PatchReader reader_;
  Rims rims_;
  Islands islands_;
  size_t room_ = 0;          // for patches
  bool is_grouped_ = false;  // whether islands are those of the patches
};

}  // namespace box_contact::BOX_CONTACT_SET::force
