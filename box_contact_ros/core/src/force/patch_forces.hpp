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
#include "rest.hpp"
#include "rollback.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

class PatchForces {
 public:
  enum class Held { all, pair_twice, no_patch };

  // side: the kernel's, or null.
  PatchForces(std::vector<Body> bodies, const Options& options, const detail::ForceKernel* side)
      : bodies_(std::move(bodies)),
        options_(options),
        ended_(bodies_.size()),
        fineness_(bodies_.size()),
        poses_(bodies_.size()),
        islands_(side) {
    rest_.set_bodies(bodies_);
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
  size_t load_count() const { return are_loads_known_ ? loads_.size() + rest_.loads().size() : 0; }
  // Write what each pair carried in the last advance. With boxes, corners are those of the faces, and
  // the pads of two bodies share as rubber ones do.
  void write_loads(bc_load* loads) const {
    if (!are_loads_known_) return;
    std::vector<Load> all(load_count());
    std::merge(loads_.begin(), loads_.end(), rest_.loads().begin(), rest_.loads().end(),
               all.begin(), ByPair{});
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
    rest_.mark_those(is_changed);
    wake();
    for (size_t k = 0; k < std::min(bodies.size(), bodies_.size()); ++k)
      if (bodies[k].is_free() != bodies_[k].is_free()) begin_anew(k);
    ended_.resize(bodies.size());
    fineness_.resize(bodies.size());
    poses_.resize(bodies.size());
    rest_.change_bodies(bodies, is_changed);
    bodies_ = std::move(bodies);  // last: there may be no memory for the others
    is_chosen_ = false;
    auto count = int32_t(bodies_.size());
    make_room(patches_.size());
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
    rest_.mark_if(
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
    rest_.mark_those(is_forgotten);
    wake();
    drop([&is_forgotten](const Patch& patch) {
      return is_forgotten[size_t(patch.a)] || is_forgotten[size_t(patch.b)];
    });
  }
  void reset() {
    patches_.clear();
    loads_.clear();
    ended_.assign(bodies_.size(), {});
    fineness_.assign(bodies_.size(), {});
    rest_.set_bodies(bodies_);
    moves_by_wrenches_ = false;
    clock_ = {};
    is_grouped_ = is_chosen_ = false;
  }

  // Take an answer, and the poses of its question. Pairs that are missing are forgotten. Nothing changes
  // for a pair that comes twice, and for a patch beyond float64's range. `in_threads` shares chunks of work.
  template <class InThreads>
  Held hold(const bc_patches& answer, const bc_pose* poses, InThreads& in_threads) {
    Held held = take(answer, poses, false, in_threads);
    if (held != Held::all) return held;
    own_.forget();
    clock_.answer(answer.age, answer.period);
    return held;
  }
  // Whether contacts of one's own are those of these pairs already.
  bool holds(const bc_patches& pairs) const { return own_.is_asked(pairs); }
  // Take pairs whose contacts are solved at the start of each advance. Impulses stay.
  Held hold(const bc_patches& pairs) {
    bool were_told = clock_.is_told();
    if (!own_.ask(pairs, options_.friction, rest_.is_any(),
                  [this](const BoxPair& pair) { return rest_.has(pair); }))
      return Held::pair_twice;
    clock_.answer_each_step();
    is_chosen_ = false;
    make_room(own_.count());
    rest_.mark_if([&](const Patch& patch) { return were_told || !own_.is_asked(patch); });
    wake();
    if (own_.count() == 0) drop([](const Patch&) { return true; });
    return Held::all;
  }
  // Solve the contacts of one's own at the start of a step `dt`, and take them: see OwnContacts::solve.
  template <class Solve, class InThreads>
  long solve_own(double dt, const bc_pose* poses, const bc_wrench* outside, const Solve& solve,
                 InThreads& in_threads, Held& held) {
    held = Held::all;
    if (own_.count() == 0) return -1;
    if (!is_chosen_)
      own_.choose(rest_.is_any(),
                  [this](size_t box) { return rest_.is_quiet(size_t(body_of(int64_t(box)))); });
    is_chosen_ = true;
    long refused = own_.solve(poses, Gaps(bodies_, boxes(), dt, outside), solve);
    if (refused < 0) held = take(own_.answer(), poses, true, in_threads);
    return refused;
  }

  // From poses, velocities and outside wrenches at the start of a step `dt` to poses and velocities at
  // its end. Or to the mean wrenches of contacts, with those that push overlaps out. Returns −1, or a
  // body whose numbers are not finite at the end: then all is as it was at the last `keep`.
  template <class InThreads>
  int64_t advance(double dt, const Given& given, const bc_motion& motion, SolvePair solve_pair,
                  InThreads& in_threads) {
    bc_motion all = motion;
    if (!all.poses) all.poses = poses_.data();
    Advance step{clock_.begin(dt, options_.substeps), given, all,
                 own_.count() > 0 ? &own_ : nullptr, solve_pair};
    BodyStep body_step(bodies_, step.steps, given, all, moves_by_wrenches_, ended_);
    if (!is_grouped_) islands_.group(bodies_, rest_.awake(), patches_);
    is_grouped_ = true;
    IslandStep islands(options_, bodies_, step, body_step, fineness_, patches_, loads_, islands_);
    if (int64_t lost = islands.advance(in_threads); lost >= 0) {
      restore();
      return lost;
    }
    loads_.resize(patches_.size());
    are_loads_known_ = true;
    window_ = step.steps.window;
    bool is_resting =
        options_.rest && motion.poses && motion.velocities &&
        rest_.count(islands_, bodies_, patches_, given, step.steps);
    rest_.end(given.poses, dt);
    islands.write_ends(in_threads);
    for (int32_t k : rest_.fixed()) body_step.move_alone(size_t(k));
    if (is_resting) rest_.write_new_ends(all);
    if (motion.poses) each_read([&](size_t k) { poses_[k] = motion.poses[k]; });
    if (is_resting) lay_down();
    bool is_in_place = motion.poses == given.poses && motion.velocities == given.velocities;
    if (!is_in_place || motion.wrenches) rest_.write_ends(all);
    if (motion.awake) rest_.write_awake(motion.awake);
    if (own_.settle()) is_chosen_ = false;
    clock_.end(dt);
    moves_by_wrenches_ = motion.wrenches && !motion.poses && !motion.velocities;
    return -1;
  }
  // Keep what an advance changes before its end, for one that fails.
  void keep() {
    rollback_.keep(clock_, fineness_);
    is_taken_ = false;
    if (own_.count() == 0) rollback_.keep_patches(patches_);
  }
  // All is as it was then.
  void restore() {
    if (is_taken_) patches_.swap(next_);
    if (rollback_.restore(patches_, clock_, fineness_, rest_, loads_)) is_chosen_ = false;
    is_grouped_ = false;
  }
  // Wake what rests and is not given as it was, before an advance. One that gives the wrenches alone
  // moves all bodies.
  void rouse(const Given& given, const Changed& changed, const bc_motion& motion) {
    if (!(motion.poses && motion.velocities)) rest_.mark_all();
    if (rest_.compare(given, changed)) is_chosen_ = false;
    wake();
  }
  // Whether something has woken since `keep`.
  bool has_woken() const { return rollback_.has_rest(); }
  // The bodies whose rows an advance reads: all but those at rest.
  template <class Visit>
  void each_read(const Visit& visit) const {
    for (const auto* bodies : {&rest_.awake(), &rest_.fixed()})
      for (int32_t body : *bodies) visit(size_t(body));
  }

 private:
  // Wake the islands that are marked.
  void wake() {
    if (!rest_.is_any_marked()) return;
    rollback_.keep_rest(rest_, patches_, loads_);
    rest_.wake(bodies_, window_, clock_.since(), patches_, loads_);
    is_grouped_ = is_chosen_ = false;
  }
  // Islands that a new patch joins to what is awake wake up. Their patches are those of their poses.
  void wake_touched() {
    for (const Patch& patch : next_)
      for (int32_t body : {patch.a, patch.b}) rest_.mark(size_t(body));
    if (!rest_.is_any_marked()) return;
    size_t found = next_.size();
    for (const Patch& patch : rest_.patches())
      if (rest_.is_marked(patch)) next_.push_back(patch);
    for (size_t k = found; k < next_.size(); ++k) next_[k].age = 0.0;
    wake();
  }
  // Take what an answer says of patches at rest. A patch wakes where the answer says something new.
  void take_at_rest(double age, const bc_pose* asked) {
    rest_.take(bodies_, next_, age, asked);
    wake();
    next_.erase(std::remove_if(next_.begin(), next_.end(),
                               [this](const Patch& patch) { return rest_.rests(patch); }),
                next_.end());
  }
  // What is let go, gripped or forgotten has not ended an advance, and needs no shorter sub-steps yet.
  void begin_anew(size_t body, const Fineness& fineness = {}) {
    ended_[body] = {};
    fineness_[body] = fineness;
  }
  // Bodies that come to rest end where they began.
  void lay_down() {
    for (int32_t k : rest_.awake())
      if (rest_.is_at_rest(size_t(k))) begin_anew(size_t(k), fineness_[size_t(k)].at_rest());
    rest_.lay_down(bodies_, patches_, loads_);
    is_grouped_ = is_chosen_ = false;
  }

  bool is_of_boxes(const Patch& patch) const {
    return 0 <= patch.box_a && patch.box_a < patch.box_b && patch.box_b < box_count() &&
           body_of(patch.box_a) == patch.a && body_of(patch.box_b) == patch.b && patch.a >= 0 &&
           patch.b >= 0 && size_t(std::max(patch.a, patch.b)) < bodies_.size();
  }
  // So that an advance takes no memory. It doubles, so many answers of more and more pairs are cheap.
  void make_room(size_t patches) {
    if (patches > room_) room_ = std::max(patches, 2 * room_);
    patches_.reserve(room_);
    next_.reserve(room_);
    loads_.reserve(room_);
    rest_.make_room(bodies_.size(), room_);
    rollback_.make_room(bodies_.size(), room_);
    islands_.make_room(bodies_.size(), room_);
    reader_.make_room(bodies_.size(), size_t(box_count()), room_);
  }
  // Loads name boxes, which may be others or none from now on.
  template <class Condition>
  void drop(Condition condition) {
    are_loads_known_ = false;
    patches_.erase(std::remove_if(patches_.begin(), patches_.end(), condition), patches_.end());
    is_grouped_ = false;
  }

  template <class InThreads>
  Held take(const bc_patches& answer, const bc_pose* poses, bool is_own, InThreads& in_threads) {
    reader_.read(
        {answer, poses, bodies_, boxes(), options_.friction}, size_t(box_count()),
        [&](size_t turn) { return is_own ? own_.row(turn) : turn; }, next_,
        [&](long count, const auto& work) { in_threads(options_.threads, count, work); });
    for (const Patch& patch : next_)
      if (patch.age >= 0.0 && !patch.has_area()) return Held::no_patch;
    if (is_own) wake_touched();
    auto same = [](const Patch& p, const Patch& q) { return p.pair() == q.pair(); };
    if (!std::is_sorted(next_.begin(), next_.end(), ByPair{}))
      std::sort(next_.begin(), next_.end(), ByPair{});
    if (std::adjacent_find(next_.begin(), next_.end(), same) != next_.end())
      return Held::pair_twice;
    if (!is_own && rest_.is_any()) take_at_rest(answer.age, poses);
    if (!keep_impulses(patches_, next_)) is_grouped_ = false;
    patches_.swap(next_);
    is_taken_ = true;
    make_room(patches_.size() + rest_.patches().size());
    return Held::all;
  }

  std::vector<Body> bodies_;
  Options options_;
  Clock clock_;
  OwnContacts own_;
  std::vector<Ended> ended_;           // of the bodies
  bool moves_by_wrenches_ = false;     // whether the caller does so since the last advance
  std::vector<Fineness> fineness_;     // of the bodies
  std::vector<bc_pose> poses_;         // of the bodies at the end of the last advance
  std::vector<Patch> patches_, next_;  // by pair
  std::vector<Load> loads_;            // of the last advance, by pair
  bool are_loads_known_ = true;
  Rest rest_;            // patches and loads of what rests are there
  double window_ = 0.0;  // of the last advance [s]
  // Memory that calls use again.
  PatchReader reader_;
  Islands islands_;
  Rollback rollback_;        // for an advance that fails
  size_t room_ = 0;          // for patches
  bool is_taken_ = false;    // whether patches were taken since `keep`; those before are in `next_`
  bool is_chosen_ = false;   // whether pairs that are solved are those of what is awake
  bool is_grouped_ = false;  // whether islands are those of the patches
};

}  // namespace box_contact::BOX_CONTACT_SET::force
