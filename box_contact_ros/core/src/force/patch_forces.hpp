// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to forces, in steps of the caller's: advances and loads.
//
// Nothing but + − · / √ is computed, so all instruction sets give the same bits.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "loads.hpp"
#include "patch_store.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

class PatchForces : public PatchStore {
 public:
  using PatchStore::PatchStore;

  // A copy, whose advance takes no memory either.
  PatchForces copy() const {
    PatchForces twin = *this;
    twin.own_.make_room();
    twin.make_room(0);
    return twin;
  }

  size_t load_count() const {
    return state_.has_loads ? state_.loads.size() + sleep_.loads().size() : 0;
  }
  // Write what each pair carried in the last advance. With boxes, corners are those of the faces, and
  // the pads of two bodies share as rubber ones do.
  void write_loads(bc_load* loads) const {
    std::vector<Load>& all = loads_room_.all;
    all.resize(load_count());
    if (all.empty()) return;
    std::merge(state_.loads.begin(), state_.loads.end(), sleep_.loads().begin(),
               sleep_.loads().end(), all.begin(), ByPair{});
    for (size_t k = 0; k < all.size(); ++k) loads[k] = all[k].mean();
    if (!boxes().empty()) share_on_faces(loads_room_, bodies_, boxes(), poses_, loads);
  }
  // Write the poses at which the next step's forces that depend on poses are to be taken: see SubSteps::ahead.
  void write_ahead(double dt, const bc_pose* poses, const bc_velocity* velocities,
                   bc_pose* ahead) const {
    const SubSteps steps = Clock(state_.clock).begin(dt, options_.substeps);
    auto write = [&](size_t k, double time) {
      const Given given{poses, velocities, nullptr};
      ahead[k] = goes_by_poses(k, given)
                     ? pose_after(time, bodies_[k], poses_[k], velocity_to(k, poses[k], dt))
                     : pose_after(time, bodies_[k], poses[k], velocities[k]);
    };
    for (size_t k = 0; k < bodies_.size(); ++k) write(k, steps.ahead());
    if (!own_.is_used()) return;
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
    if (!own_.is_used()) next_.patches = state_.patches;
    wake_into(!own_.is_used() ? next_.patches : woken_);
  }
  // Return where bodies begin a step `dt`: one that goes by its poses where it ended, so that it is beside what
  // stands on it, and is where it is given at the end.
  Given started(double dt, const Given& given) {
    Given step = given;
    step.ends = given.poses;
    for (int32_t body : sleep_.fixed()) {
      auto k = size_t(body);
      carriers_[k] = given.velocities[k];
      if (!goes_by_poses(k, given)) continue;
      if (step.poses == given.poses) {
        std::copy_n(given.poses, bodies_.size(), starts_.begin());
        step.poses = starts_.data();
      }
      starts_[k] = poses_[k];
      carriers_[k] = velocity_to(k, given.poses[k], dt);
    }
    return step;
  }
  // Solve the contacts of one's own at the start of a step `dt`, and read them: see OwnContacts::solve.
  template <class Solve, class InThreads>
  long solve_own(double dt, const Given& given, const Solve& solve, SolvePair solve_pair,
                 InThreads& in_threads, HoldResult& result) {
    result = HoldResult::all;
    if (!own_.is_used()) return -1;
    const Gaps gaps(bodies_, boxes(), dt, given, carriers_);
    if (own_.finds_pairs())
      find_pairs(dt, given, gaps);
    else
      own_.choose(sleep_.revision(), sleep_.is_any_asleep(),
                  [this](size_t box) { return sleep_.is_quiet(size_t(body_of(int64_t(box)))); });
    long refused = own_.solve(given.poses, gaps, solve, solve_pair);
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
                    own_.is_used() ? &own_ : nullptr, solve_pair};
    BodyStep body_step(bodies_, step.steps, given, carriers_, all, state_.is_moved_by_wrenches, ended_);
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
    own_.cancel();
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
  // Find the pairs of a step that are of something that moves.
  void find_pairs(double dt, const Given& given, const Gaps& gaps) {
    auto each_active = [this](const auto& visit) {
      each_read([&](size_t body) {
        if (!sleep_.is_quiet(body)) visit(body);
      });
    };
    auto pose_of = [&](size_t body) -> const bc_pose& { return sleep_.pose_of(body, given); };
    make_room(own_.find(dt, sleep_.revision(), gaps, bodies_, each_active, pose_of));
  }
  // Islands that a new patch joins to what is awake wake up. Their patches are those of their poses.
  void wake_touched() {
    for (const Patch& patch : next_.patches) sleep_.mark(patch);
    wake_into(next_.patches);
  }
  // Bodies that fell asleep end where they began.
  void lay_down() {
    for (int32_t k : sleep_.awake())
      if (sleep_.is_asleep(size_t(k)))
        ended_[size_t(k)] = {{}, {}, ended_[size_t(k)].fineness.asleep(), {}};
    sleep_.lay_down(bodies_, state_.patches, state_.loads);
    is_grouped_ = false;
  }

  mutable LoadsRoom loads_room_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
