// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to forces, in steps of the caller's: bodies, boxes, answers, advances, loads.
//
// Nothing but + − · / √ is computed, so all instruction sets give the same bits.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "../../include/box_contact/force.h"
#include "island_step.hpp"
#include "loads.hpp"
#include "own_contacts.hpp"
#include "patch_reader.hpp"
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

class PatchForces {
 public:
  enum class HoldResult { all, pair_twice, no_patch };

  // side: the kernel's, or null.
  PatchForces(std::vector<Body> bodies, const Options& options, const detail::ForceKernel* side)
      : bodies_(std::move(bodies)),
        options_(options),
        ended_(bodies_.size()),
        poses_(bodies_.size()),
        islands_(side) {
    sleep_.set_bodies(bodies_);
    make_room(0);
  }

  // A copy, whose advance takes no memory either.
  PatchForces copy() const {
    PatchForces twin = *this;
    twin.own_.make_room();
    twin.make_room(0);
    return twin;
  }

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<bc_body_box>& boxes() const { return own_.boxes(); }
  size_t load_count() const {
    return state_.has_loads ? state_.loads.size() + sleep_.loads().size() : 0;
  }
  // Write what each pair carried in the last advance. With boxes, corners are those of the faces, and
  // the pads of two bodies share as rubber ones do.
  void write_loads(bc_load* loads) const {
    std::vector<Load> all(load_count());
    if (all.empty()) return;
    std::merge(state_.loads.begin(), state_.loads.end(), sleep_.loads().begin(),
               sleep_.loads().end(), all.begin(), ByPair{});
    for (size_t k = 0; k < all.size(); ++k) loads[k] = all[k].mean();
    if (!boxes().empty()) share_on_faces(all, bodies_, boxes(), poses_, loads);
  }
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
    sleep_.change_bodies(bodies, is_changed);
    bodies_ = std::move(bodies);  // last: there may be no memory for the others
    auto count = int32_t(bodies_.size());
    make_room(state_.patches.size());
    drop([this, count](const Patch& patch) {
      return !is_of_boxes(patch) || std::max(patch.a, patch.b) >= count ||
             !(bodies_[size_t(patch.a)].is_free() || bodies_[size_t(patch.b)].is_free());
    });
  }
  // Change which boxes the bodies have. Patches of boxes that stay with their body stay.
  void set_boxes(std::vector<bc_body_box> boxes) {
    auto is_kept = [&](int32_t box) {
      auto k = size_t(box);
      return k < boxes.size() && k < this->boxes().size() &&
             have_same_bits(boxes[k], this->boxes()[k]);
    };
    sleep_.mark_if(
        [&](const Patch& patch) { return !is_kept(patch.box_a) || !is_kept(patch.box_b); });
    wake();
    own_.set_boxes(std::move(boxes));
    drop([this](const Patch& patch) { return !is_of_boxes(patch); });
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
  // Whether contacts of one's own are those of these pairs already.
  bool holds(const bc_patches& pairs) const { return own_.is_asked(pairs, options_.friction); }
  // Take pairs whose contacts are solved at the start of each advance. Impulses stay.
  HoldResult hold(const bc_patches& pairs) {
    bool were_told = state_.clock.is_told();
    if (!own_.ask(pairs, options_.friction, sleep_.is_any_asleep(),
                  [this](const BoxPair& pair) { return sleep_.has(pair); }))
      return HoldResult::pair_twice;
    state_.clock.answer_each_step();
    make_room(own_.count());
    sleep_.mark_if([&](const Patch& patch) { return were_told || !own_.is_asked(patch); });
    wake();
    if (own_.count() == 0) drop([](const Patch&) { return true; });
    return HoldResult::all;
  }
  // Write the poses at which the next step's forces that depend on poses are to be taken: see SubSteps::ahead.
  void write_ahead(double dt, const bc_pose* poses, const bc_velocity* velocities,
                   bc_pose* ahead) const {
    const SubSteps steps = Clock(state_.clock).begin(dt, options_.substeps);
    auto write = [&](size_t k, double time) {
      ahead[k] = pose_after(time, bodies_[k], poses[k], velocities[k]);
    };
    for (size_t k = 0; k < bodies_.size(); ++k) write(k, steps.ahead());
    if (own_.count() == 0) return;
    for (const Patch& patch : state_.patches)
      for (auto k : {size_t(patch.a), size_t(patch.b)})
        if (double factor = ended_[k].fineness.factor; factor > 1.0)
          write(k, steps.finer(factor).ahead());
  }
  // Begin an advance, which `advance` ends or `cancel`. What sleeps and is not given as it was wakes. An advance
  // that gives the wrenches alone moves all bodies.
  void begin(const Given& given, const Changed& changed, const bc_motion& motion) {
    if (!(motion.poses && motion.velocities)) sleep_.mark_if([](const Patch&) { return true; });
    sleep_.compare(given, changed);
    next_.clock = state_.clock;
    woken_.clear();
    if (own_.count() == 0) next_.patches = state_.patches;
    wake_into(own_.count() == 0 ? next_.patches : woken_);
  }
  // Solve the contacts of one's own at the start of a step `dt`, and read them: see OwnContacts::solve.
  template <class Solve, class InThreads>
  long solve_own(double dt, const Given& given, const Solve& solve, SolvePair solve_pair,
                 InThreads& in_threads, HoldResult& result) {
    result = HoldResult::all;
    if (own_.count() == 0) return -1;
    own_.choose(sleep_.revision(), sleep_.is_any_asleep(),
                [this](size_t box) { return sleep_.is_quiet(size_t(body_of(int64_t(box)))); });
    long refused =
        own_.solve(given.poses, Gaps(bodies_, boxes(), dt, given.outside), solve, solve_pair);
    if (refused >= 0) return refused;
    result = read(own_.answer(), given.poses, true, in_threads);
    if (result != HoldResult::all) return refused;
    wake_touched();
    if (!keep_impulses(state_.patches, next_.patches)) is_grouped_ = false;
    keep_impulses(woken_, next_.patches);
    make_room(next_.patches.size() + sleep_.patches().size());
    return refused;
  }
  // From poses, velocities and outside wrenches at the start of a step `dt` to poses and velocities at
  // its end. Or to the mean wrenches of contacts, with those that push overlaps out. Returns −1, or a
  // body whose numbers are not finite at the end: then the advance is to be cancelled.
  template <class InThreads>
  int64_t advance(double dt, const Given& given, const bc_motion& motion, SolvePair solve_pair,
                  InThreads& in_threads) {
    bc_motion all = motion;
    if (!all.poses) all.poses = poses_.data();
    StepInputs step{next_.clock.begin(dt, options_.substeps), given, all,
                    own_.count() > 0 ? &own_ : nullptr, solve_pair};
    BodyStep body_step(bodies_, step.steps, given, all, state_.is_moved_by_wrenches, ended_);
    if (!is_grouped_) islands_.group(bodies_, sleep_.awake(), next_.patches);
    is_grouped_ = true;
    next_.loads.resize(next_.patches.size());
    IslandStep islands(options_, bodies_, step, body_step, next_.patches, next_.loads, islands_);
    if (int64_t lost = islands.solve_all(in_threads); lost >= 0) return lost;
    sleep_.finish_waking(bodies_);
    bool falls_asleep = options_.rest && motion.poses && motion.velocities &&
                        sleep_.fall_asleep(islands_, bodies_, next_.patches, given, step.steps);
    sleep_.end(given.poses, dt);
    islands.write_ends(in_threads);
    for (int32_t k : sleep_.fixed()) body_step.move_alone(size_t(k));
    if (falls_asleep) sleep_.write_new_ends(all);
    if (motion.poses) each_read([&](size_t k) { poses_[k] = motion.poses[k]; });
    std::swap(state_, next_);
    if (falls_asleep) lay_down();
    bool is_in_place = motion.poses == given.poses && motion.velocities == given.velocities;
    if (!is_in_place || motion.wrenches) sleep_.write_ends(all);
    if (motion.awake) sleep_.write_awake(motion.awake);
    own_.settle();
    state_.clock.end(dt);
    state_.has_loads = true;
    state_.is_moved_by_wrenches = motion.wrenches && !motion.poses && !motion.velocities;
    return -1;
  }
  // All is as it was before the advance began.
  void cancel() {
    sleep_.cancel_waking(bodies_);
    is_grouped_ = false;
  }
  // Whether something wakes in this advance.
  bool is_waking() const { return sleep_.is_any_waking(); }
  // The bodies whose rows an advance reads: all but those asleep.
  template <class Visit>
  void each_read(const Visit& visit) const {
    for (const auto* bodies : {&sleep_.awake(), &sleep_.fixed()})
      for (int32_t body : *bodies) visit(size_t(body));
  }

 private:
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
  // Islands that a new patch joins to what is awake wake up. Their patches are those of their poses.
  void wake_touched() {
    for (const Patch& patch : next_.patches) sleep_.mark(patch);
    wake_into(next_.patches);
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
  // What is let go, gripped or forgotten has not ended an advance, and needs no shorter sub-steps yet.
  void begin_anew(size_t body) { ended_[body] = {}; }
  // Bodies that fell asleep end where they began.
  void lay_down() {
    for (int32_t k : sleep_.awake())
      if (sleep_.is_asleep(size_t(k)))
        ended_[size_t(k)] = {{}, {}, ended_[size_t(k)].fineness.asleep(), {}};
    sleep_.lay_down(bodies_, state_.patches, state_.loads);
    is_grouped_ = false;
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
    reader_.read_rows(
        {answer, poses, bodies_, boxes(), options_.friction},
        [&](size_t place) { return is_own ? own_.row(place) : place; }, found,
        [&](long count, const auto& work) { in_threads(options_.threads, count, work); });
    for (const Patch& patch : found)
      if (patch.age >= 0.0 && !patch.has_area()) return HoldResult::no_patch;
    auto same = [](const Patch& p, const Patch& q) { return p.pair() == q.pair(); };
    if (!std::is_sorted(found.begin(), found.end(), ByPair{}))
      std::sort(found.begin(), found.end(), ByPair{});
    bool is_any_twice = std::adjacent_find(found.begin(), found.end(), same) != found.end();
    return is_any_twice ? HoldResult::pair_twice : HoldResult::all;
  }

  std::vector<Body> bodies_;
  Options options_;
  OwnContacts own_;
  std::vector<Ended> ended_;    // of the bodies
  std::vector<bc_pose> poses_;  // of the bodies at the end of the last advance
  State state_, next_;          // as the last advance ended, and as the next one will
  std::vector<Patch> woken_;    // of what wakes in this advance, as it was
  Sleep sleep_;                 // patches and loads of what is asleep are there
  // Memory that calls use again.
  PatchReader reader_;
  Islands islands_;
  size_t room_ = 0;          // for patches
  bool is_grouped_ = false;  // whether islands are those of the patches
};

}  // namespace box_contact::BOX_CONTACT_SET::force
