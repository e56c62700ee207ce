// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to forces: each patch is a block of six velocity constraints.
//
// The blocks are solved by sequential impulses (projected Gauss-Seidel) with warm start (Catto,
// "Iterative dynamics with temporal coherence", 2005). A patch has the normal n from A to B, the
// centroid c, and the rectangle of its covariance, with the half lengths l1 and l2. Its rows
// constrain the velocity of B relative to A:
//
//     pressing  N  along n at c            N ≥ 0
//     rocking   τ  about the axes 1 and 2  |τ1| ≤ N·l2, |τ2| ≤ N·l1: no pressure is negative
//     friction  f  in the plane at c       |f|² + (m/r)² ≤ (μ·N)²
//     torsion   m  about n                 r: the radius at which friction resists a spin
//
// Pressing and rocking are solved as one block, friction and torsion as another. Overlaps are pushed
// out by soft constraints; relaxation removes the speed of pushing out again (Catto, "Solver2D",
// 2024). Between answers, depth, centroid and tilt follow the bodies.
//
// Nothing but + − · / √ is computed, so all instruction sets give the same bits.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "../../include/box_contact/force.h"
#include "../library/threads.hpp"
#include "islands.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Steps accepted [s]: at least this long, so that a speed divided by one is a number; and shorter than
// that, as nothing that touches stays within its patch for so long.
constexpr double step_min = 1e-50, step_limit = 1.0;
// Sub-steps are no longer [s], unless answers are late: a step of 0.1 s in four would sink a stack of
// eight by 42 mm.
constexpr double sub_step_limit = 0.005;
// A smaller change of a patch's speeds [m/s] does not make its neighbours be solved again. With 1e-6 a
// jittered tower of 20 sways for 8 s.
constexpr double least_change = 1e-8;
// A period that is not told is the least of so many intervals between answers: some get lost.
constexpr int intervals_kept = 8;
// Patches that a thread takes at a time: some 60 µs of work.
constexpr size_t patches_per_chunk = 64;

class PatchForces {
 public:
  struct Options {
    int substeps, iterations, relaxations, threads;
    double friction;
  };
  enum class Held { all, pair_twice, no_patch };
  // The boxes of pairs that are solved at the start of each advance.
  struct Own {
    std::vector<int64_t> pairs;  // (n, 2)
    std::vector<double> friction, surface, stiffness;
    std::vector<double> separation, normal, point, volume, covariance;  // of the last advance

    size_t count() const { return friction.size(); }
    void resize(size_t n) {
      pairs.resize(2 * n);
      for (auto* column : {&friction, &stiffness, &separation, &volume}) column->resize(n);
      for (auto* column : {&surface, &normal, &point}) column->resize(3 * n);
      covariance.resize(9 * n);
    }
    bc_patches answer() const {
      return {sizeof(bc_patches),
              int64_t(count()),
              pairs.data(),
              separation.data(),
              normal.data(),
              point.data(),
              volume.data(),
              covariance.data(),
              friction.data(),
              surface.data(),
              stiffness.data(),
              0.0,
              0.0};
    }
  };

  PatchForces(std::vector<Body> bodies, const Options& options)
      : bodies_(std::move(bodies)), options_(options), before_(bodies_.size()) {
    make_room(0);
  }

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<Load>& loads() const { return loads_; }
  double load_time() const { return clock_.advance; }
  int threads() const { return options_.threads; }
  int64_t box_count() const { return int64_t(boxes_.empty() ? bodies_.size() : boxes_.size()); }
  int64_t body_of(int64_t box) const { return boxes_.empty() ? box : boxes_[size_t(box)].body; }
  // With sizes: without them box k is body k, and nobody knows its size.
  const std::vector<bc_body_box>& boxes() const { return boxes_; }
  const std::vector<bc_size>& sizes() const { return sizes_; }

  // Change masses, add bodies at the end, or drop bodies there with their patches.
  void set_bodies(std::vector<Body> bodies) {
    bodies_ = std::move(bodies);
    before_.resize(bodies_.size());
    auto count = int32_t(bodies_.size());
    make_room(patches_.size());
    drop([this, count](const Patch& patch) {
      return !is_of_boxes(patch) || std::max(patch.a, patch.b) >= count || !moves(patch.a, patch.b);
    });
  }
  // Change which boxes the bodies have. Patches of boxes that stay with their body stay.
  void set_boxes(std::vector<bc_body_box> boxes) {
    boxes_ = std::move(boxes);
    own_.resize(0);
    read_sizes();
    drop([this](const Patch& patch) { return !is_of_boxes(patch); });
  }
  // Forget the patches of bodies.
  void forget(const int64_t* bodies, int64_t count) {
    std::vector<uint8_t> is_forgotten(bodies_.size(), 0);
    for (int64_t k = 0; k < count; ++k) {
      is_forgotten[size_t(bodies[k])] = 1;
      before_[size_t(bodies[k])] = {};
    }
    drop([&is_forgotten](const Patch& patch) {
      return is_forgotten[size_t(patch.a)] || is_forgotten[size_t(patch.b)];
    });
  }
  void reset() {
    patches_.clear();
    loads_.clear();
    before_.assign(bodies_.size(), {});
    clock_ = {};
    is_grouped_ = false;
  }

  // Take an answer, and the poses of its question. Pairs that are missing are forgotten. Nothing
  // changes for a pair that comes twice, and for a patch whose numbers leave float64's range.
  Held hold(const bc_patches& answer, const bc_pose* poses) {
    Held held = take(answer, poses);
    if (held != Held::all) return held;
    own_.resize(0);
    if (clock_.since > 0.0) {
      std::copy_backward(clock_.intervals, clock_.intervals + intervals_kept - 1,
                         clock_.intervals + intervals_kept);
      clock_.intervals[0] = clock_.since;
    }
    clock_.period = answer.period > 0.0 ? answer.period : clock_.least_interval();
    clock_.late = answer.age;
    clock_.since = 0.0;
    return held;
  }

  // Take pairs whose contacts are solved at the start of each advance. Impulses stay.
  Held hold_own(const bc_patches& asked) {
    keys_.clear();
    for (int64_t k = 0; k < asked.count; ++k) {
      auto a = int32_t(asked.pairs[2 * k]), b = int32_t(asked.pairs[2 * k + 1]);
      keys_.push_back(std::minmax(a, b));
    }
    std::sort(keys_.begin(), keys_.end());
    if (std::adjacent_find(keys_.begin(), keys_.end()) != keys_.end()) return Held::pair_twice;
    auto n = size_t(asked.count);
    own_.resize(n);
    std::copy_n(asked.pairs, 2 * n, own_.pairs.begin());
    auto copy = [](const double* from, std::vector<double>& to, double otherwise) {
      if (from)
        std::copy_n(from, to.size(), to.begin());
      else
        std::fill(to.begin(), to.end(), otherwise);
    };
    copy(asked.friction, own_.friction, options_.friction);
    copy(asked.surface, own_.surface, 0.0);
    copy(asked.stiffness, own_.stiffness, 0.0);
    clock_.since = -1.0;
    clock_.period = clock_.late = 0.0;
    make_room(n);
    if (n == 0) drop([](const Patch&) { return true; });
    return Held::all;
  }
  Own& own() { return own_; }
  // The poses of all boxes with the bodies at `poses`.
  const bc_pose* place_boxes(const bc_pose* poses) {
    for (size_t k = 0; k < boxes_.size(); ++k)
      box_poses_[k] = in_common_frame(poses[boxes_[k].body], boxes_[k].box.pose);
    return box_poses_.data();
  }
  // Take what was solved for the pairs with the bodies at `poses`.
  Held take_own(const bc_pose* poses) { return take(own_.answer(), poses); }

  // From poses, velocities and outside wrenches at the start of a step `dt` to poses and velocities at
  // its end. Or to the mean wrenches of contacts, with those that push overlaps out.
  void advance(double dt, const bc_pose* poses, const bc_velocity* velocities,
               const bc_wrench* outside, const bc_motion& motion) {
    // A late answer bears no stiffer patches in shorter sub-steps: all iterations are in one.
    double longest = std::max({dt, clock_.advance, clock_.advance_before});
    double shrunk = clock_.step / window_shrinkage;
    if (longest > clock_.step || longest < shrunk) clock_.step = std::max(longest, shrunk);
    bool is_late = frequency_of(clock_.late, clock_.period) < soft_frequency / clock_.step;
    int least = options_.substeps;
    int parts = is_late ? 1 : std::max(least, int(std::ceil(dt / sub_step_limit)));
    double window = is_late ? clock_.step : std::min(clock_.step / least, sub_step_limit);
    Advance step{dt,     dt / parts, parts, is_late ? least : 1, poses, velocities, outside,
                 motion, {},         {}};
    step.first = sub_step(step, window);
    step.later = sub_step(step, window);
    if (!is_grouped_) islands_.group(bodies_, patches_);
    is_grouped_ = true;
    loads_.resize(patches_.size());
    in_chunks([&](const Island& island) { advance(island, step); });
    for (size_t k = 0; k < bodies_.size(); ++k)
      if (!bodies_[k].is_free()) move_alone(k, step);
    if (clock_.since >= 0.0) clock_.since += dt;
    clock_.advance_before = clock_.advance;
    clock_.advance = dt;
  }

 private:
  struct Clock {
    double since = -1.0;                    // the last answer [s]; below 0: there was none
    double period = 0.0;                    // between answers [s]
    double late = 0.0;                      // age of the last answer when it came [s]
    double step = 0.0;                      // the longest one lately, or a little more [s]
    double window = 0.0;                    // in which the patches' impulses were given [s]
    double advance = 0.0;                   // length of the last one [s]
    double advance_before = 0.0;            // and of the one before [s]
    double intervals[intervals_kept] = {};  // between answers, the last one first; 0: none [s]

    double least_interval() const {
      double least = 0.0;
      for (double interval : intervals)
        if (interval > 0.0 && (least == 0.0 || interval < least)) least = interval;
      return least;
    }
  };
  // The velocities with which a body ended the last advance: before relaxation, and after it.
  struct Ended {
    Motion pushed, relaxed;
  };
  struct Advance {
    double dt, h;
    int parts, rounds;  // sub-steps, and how many times all iterations are in each
    const bc_pose* poses;
    const bc_velocity* velocities;
    const bc_wrench* outside;
    const bc_motion& motion;
    SubStep first, later;
  };

  void read_sizes() {
    sizes_.clear();
    for (const bc_body_box& box : boxes_) sizes_.push_back(box.box.size);
    box_poses_.resize(boxes_.size());
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
    islands_.make_room(bodies_.size(), room_);
  }
  bool moves(int32_t a, int32_t b) const {
    return bodies_[size_t(a)].is_free() || bodies_[size_t(b)].is_free();
  }

  // Loads name boxes, which may be others or none from now on.
  template <class Condition>
  void drop(Condition condition) {
    loads_.clear();
    patches_.erase(std::remove_if(patches_.begin(), patches_.end(), condition), patches_.end());
    is_grouped_ = false;
  }

  Held take(const bc_patches& answer, const bc_pose* poses) {
    next_.clear();
    for (int64_t k = 0; k < answer.count; ++k) {
      bool is_stale = answer.separation[k] != answer.separation[k];
      if (!is_stale && !(answer.volume[k] > 0.0)) continue;
      const int64_t* boxes = answer.pairs + 2 * k;
      if (!moves(int32_t(body_of(boxes[0])), int32_t(body_of(boxes[1])))) continue;
      next_.push_back(read(answer, k, is_stale, poses));
      if (!is_stale && !next_.back().has_area()) return Held::no_patch;
    }
    auto before = [](const Patch& p, const Patch& q) { return p.pair() < q.pair(); };
    auto same = [](const Patch& p, const Patch& q) { return p.pair() == q.pair(); };
    if (!std::is_sorted(next_.begin(), next_.end(), before))
      std::sort(next_.begin(), next_.end(), before);
    if (std::adjacent_find(next_.begin(), next_.end(), same) != next_.end())
      return Held::pair_twice;
    keep_impulses();
    patches_.swap(next_);
    is_grouped_ = false;
    make_room(patches_.size());
    return Held::all;
  }

  Patch read(const bc_patches& answer, int64_t k, bool is_stale, const bc_pose* poses) const {
    auto a = int32_t(answer.pairs[2 * k]), b = int32_t(answer.pairs[2 * k + 1]);
    double sign = a < b ? 1.0 : -1.0;
    Patch patch{};
    patch.box_a = std::min(a, b);
    patch.box_b = std::max(a, b);
    patch.a = int32_t(body_of(patch.box_a));
    patch.b = int32_t(body_of(patch.box_b));
    patch.age = is_stale ? -1.0 : 0.0;
    if (is_stale) return patch;
    patch.asked_a = placed_at(poses[patch.a], bodies_[size_t(patch.a)].centre);
    patch.asked_b = placed_at(poses[patch.b], bodies_[size_t(patch.b)].centre);
    patch.normal = sign * vector_at(answer.normal + 3 * k);
    patch.point = vector_at(answer.point + 3 * k);
    patch.shape = rectangle_of(patch.normal, answer.covariance + 9 * k, [&] {
      // The lighter body is more often the smaller one, whose face the patch is.
      bool is_b = bodies_[size_t(patch.a)].inverse_mass < bodies_[size_t(patch.b)].inverse_mass;
      return axes_of(is_b ? patch.box_b : patch.box_a, poses[is_b ? patch.b : patch.a]);
    });
    patch.depth = answer.volume[k] / (4.0 * patch.shape.half_1 * patch.shape.half_2);
    patch.friction = answer.friction ? answer.friction[k] : options_.friction;
    patch.stiffness = answer.stiffness ? answer.stiffness[k] : 0.0;
    if (answer.surface) patch.surface = sign * vector_at(answer.surface + 3 * k);
    patch.late = answer.age;
    return patch;
  }

  // The axes of a box, with its body at `body`.
  Mat<double> axes_of(int32_t box, const bc_pose& body) const {
    bool is_body = boxes_.empty();
    return rotation_matrix(
        (is_body ? body : in_common_frame(body, boxes_[size_t(box)].box.pose)).quaternion);
  }

  // Hand on the impulses of the patches before, and keep the patches of stale pairs.
  void keep_impulses() {
    auto old = patches_.begin();
    auto kept = next_.begin();
    for (const Patch& patch : next_) {
      while (old != patches_.end() && old->pair() < patch.pair()) ++old;
      bool is_known = old != patches_.end() && old->pair() == patch.pair();
      bool is_stale = patch.age < 0.0;
      if (is_stale && !is_known) continue;
      Patch next = is_stale ? *old : patch;
      if (is_known) {
        next.press = old->press;
        next.spin = old->spin;
        next.slip = old->slip;
        next.rock = old->rock;
        next.given_arm = old->given_arm;
      }
      *kept++ = next;
    }
    next_.erase(kept, next_.end());
  }

  // A sub-step of an advance. Its window begins the next one.
  SubStep sub_step(const Advance& step, double window) {
    double before = clock_.window, h = step.h;
    clock_.window = window;
    return {h,
            window,
            before > 0.0 ? std::min(h / before, most_again) : 1.0,
            before > 0.0 ? (window - h) / before : 0.0,
            1.0 / step.parts,
            clock_.period,
            overdue_periods * std::max(clock_.period, step.dt)};
  }

  // Call `work` with each island, in as many threads as are worth it. No bit depends on them.
  template <class Work>
  void in_chunks(const Work& work) const {
    const std::vector<Island>& all = islands_.all;
    auto chunks = 1 + patches_.size() / patches_per_chunk;
    long threads = std::min(long(options_.threads), long(std::min(chunks, all.size())));
    size_t islands = threads > 1 ? 1 + all.size() / chunks : all.size();
    if (all.empty()) return;
    detail::in_threads(std::max(threads, 1L), long((all.size() + islands - 1) / islands),
                       [&](long, long chunk) {
                         size_t end = std::min(size_t(chunk + 1) * islands, all.size());
                         for (size_t k = size_t(chunk) * islands; k < end; ++k) work(all[k]);
                       });
  }

  void advance(const Island& island, const Advance& step) {
    std::vector<Moving>& moving = islands_.moving;
    std::vector<Block>& blocks = islands_.blocks;
    for (size_t k = island.body; k < island.body_end; ++k) begin(moving[k], step);
    for (size_t k = island.block; k < island.block_end; ++k)
      blocks[k].press_sum = blocks[k].rub_sum = {};
    for (int number = 1; number <= step.parts; ++number) {
      const SubStep& now = number == 1 ? step.first : step.later;
      for (size_t k = island.body; k < island.body_end; ++k) drive(moving[k], step);
      for (size_t k = island.block; k < island.block_end; ++k) {
        Block& block = blocks[k];
        const Patch& patch = patches_[size_t(block.patch)];
        Moving &a = moving[size_t(block.a)], &b = moving[size_t(block.b)];
        prepare(patch, a, b, now, block);
        warm_start(patch, now.again, block, a, b);
      }
      bool is_last = number == step.parts;
      solve(island, step.rounds * options_.iterations, &Block::pushing);
      if (is_last) end_pushing(island, step);
      for (size_t k = island.body; k < island.body_end; ++k) moving[k].move(step.h);
      solve(island, step.rounds * options_.relaxations, &Block::relaxed);
      if (!is_last && step.motion.wrenches) count_impulses(island);
      for (size_t k = island.block; k < island.block_end; ++k)
        store(blocks[k], now.kept, patches_[size_t(blocks[k].patch)]);
    }
    for (size_t k = island.body; k < island.body_end; ++k) write_end(moving[k], step);
    for (size_t k = island.block; k < island.block_end; ++k) end(blocks[k], step.dt);
  }

  void begin(Moving& moving, const Advance& step) const {
    auto k = size_t(moving.body);
    moving.placed = placed_at(step.poses[k], bodies_[k].centre);
    moving.linear = vector(step.velocities[k].linear);
    moving.angular = vector(step.velocities[k].angular);
    double scale = 1.0 / std::sqrt(squared_norm(step.poses[k].quaternion));
    for (int i = 0; i < 4; ++i) moving.quaternion[i] = scale * step.poses[k].quaternion[i];
    moving.impulse = moving.angular_impulse = {};
    if (!bodies_[k].is_free()) return;
    // A caller who moves by the wrenches comes back with the speed of pushing out.
    const auto& [pushed, relaxed] = before_[k];
    Vec<double> linear_p = moving.linear - pushed.linear, linear_r = moving.linear - relaxed.linear;
    Vec<double> angular_p = moving.angular - pushed.angular;
    Vec<double> angular_r = moving.angular - relaxed.angular;
    if (energy(k, moving.placed, linear_p, angular_p) >=
        energy(k, moving.placed, linear_r, angular_r))
      return;
    Vec<double> slower = relaxed.linear - pushed.linear, calmer = relaxed.angular - pushed.angular;
    moving.linear += slower;
    moving.angular += calmer;
    moving.impulse = (1.0 / bodies_[k].inverse_mass) * slower;
    moving.angular_impulse = moving.placed.axes * (transposed_times(moving.placed.axes, calmer) /
                                                   bodies_[k].inverse_inertia);
  }
  // Twice the kinetic energy of a body at such velocities.
  double energy(size_t k, const Placed& placed, const Vec<double>& linear,
                const Vec<double>& angular) const {
    Vec<double> own = transposed_times(placed.axes, angular);
    return dot(linear, linear) / bodies_[k].inverse_mass +
           dot(own, own / bodies_[k].inverse_inertia);
  }

  // Change velocities by all but contacts.
  void drive(Moving& moving, const Advance& step) const {
    auto k = size_t(moving.body);
    if (!bodies_[k].is_free()) return;
    moving.inverse_inertia = inverse_inertia_of(bodies_[k], moving.placed);
    const Mat<double>& axes = moving.placed.axes;
    moving.angular +=
        axes * gyroscopic_change(bodies_[k], transposed_times(axes, moving.angular), step.h);
    if (!step.outside) return;
    moving.linear += (step.h * bodies_[k].inverse_mass) * vector(step.outside[k].force);
    moving.angular += step.h * (moving.inverse_inertia * vector(step.outside[k].torque));
  }

  // Solve the blocks of an island in turn, so many times. A block whose bodies have not changed since
  // its last turn is left out.
  void solve(const Island& island, int iterations, PressRows Block::* rows) {
    std::vector<Moving>& moving = islands_.moving;
    for (size_t k = island.body; k < island.body_end; ++k) moving[k].changed = 0;
    bool is_solved = false;
    for (int iteration = 1; iteration <= iterations && !is_solved; ++iteration) {
      is_solved = true;
      for (size_t k = island.block; k < island.block_end; ++k) {
        Block& block = islands_.blocks[k];
        Moving &a = moving[size_t(block.a)], &b = moving[size_t(block.b)];
        if (std::max(a.changed, b.changed) < iteration - 1) continue;
        double pressed = solve_press(block, block.*rows, a, b);
        double rubbed = solve_rub(block, a, b);  // friction is bounded by what presses now
        if (std::max(pressed, rubbed) <= least_change) continue;
        is_solved = false;
        if (a.inverse_mass > 0.0) a.changed = iteration;
        if (b.inverse_mass > 0.0) b.changed = iteration;
      }
    }
  }

  void count_impulses(const Island& island) {
    for (size_t k = island.block; k < island.block_end; ++k) {
      const Block& block = islands_.blocks[k];
      count(block, islands_.moving[size_t(block.a)], islands_.moving[size_t(block.b)]);
    }
  }
  // Write what pushing out leads to: the wrenches that do so if they are constant over the advance.
  void end_pushing(const Island& island, const Advance& step) {
    if (step.motion.wrenches) count_impulses(island);
    for (size_t k = island.body; k < island.body_end; ++k) {
      const Moving& moving = islands_.moving[k];
      auto body = size_t(moving.body);
      if (!bodies_[body].is_free()) continue;
      before_[body].pushed = {moving.linear, moving.angular};
      if (step.motion.wrenches)
        write((1.0 / step.dt) * moving.impulse, (1.0 / step.dt) * moving.angular_impulse,
              step.motion.wrenches[body].force, step.motion.wrenches[body].torque);
    }
  }
  void write_end(const Moving& moving, const Advance& step) {
    auto k = size_t(moving.body);
    if (!bodies_[k].is_free()) return;
    before_[k].relaxed = {moving.linear, moving.angular};
    write_pose(moving, step);
    if (step.motion.velocities)
      write(moving.linear, moving.angular, step.motion.velocities[k].linear,
            step.motion.velocities[k].angular);
  }
  void write_pose(const Moving& moving, const Advance& step) const {
    if (!step.motion.poses) return;
    auto k = size_t(moving.body);
    bc_pose& pose = step.motion.poses[k];
    const Vec<double> position = moving.placed.position - moving.placed.axes * bodies_[k].centre;
    std::copy_n(position.v, 3, pose.position);
    double scale = 1.0 / std::sqrt(squared_norm(moving.quaternion));
    for (int i = 0; i < 4; ++i) pose.quaternion[i] = scale * moving.quaternion[i];
  }
  void end(const Block& block, double dt) {
    Patch& patch = patches_[size_t(block.patch)];
    const Moving& a = islands_.moving[size_t(block.a)];
    patch.age += dt;
    loads_[size_t(block.patch)] = {patch.box_a,   patch.box_b,  block.press_sum,
                                   block.rub_sum, block.normal, a.placed.position + block.arm_a,
                                   block.shape};
  }
  static void write(const Vec<double>& v, const Vec<double>& w, double* linear, double* angular) {
    std::copy_n(v.v, 3, linear);
    std::copy_n(w.v, 3, angular);
  }

  // A body that no force moves goes on by its velocity. One that rests keeps its pose to the bit.
  void move_alone(size_t k, const Advance& step) const {
    const bc_velocity velocity = step.velocities[k];
    const bc_motion& motion = step.motion;
    if (motion.velocities) motion.velocities[k] = velocity;
    if (motion.wrenches) motion.wrenches[k] = {};
    if (!motion.poses) return;
    const double* numbers = velocity.linear;
    if (are_within(numbers, 3, 0.0) && are_within(velocity.angular, 3, 0.0)) {
      motion.poses[k] = step.poses[k];
      return;
    }
    Moving moving{};
    moving.body = int32_t(k);
    begin(moving, step);
    for (int number = 0; number < step.parts; ++number) moving.move(step.h);
    write_pose(moving, step);
  }

  std::vector<Body> bodies_;
  Options options_;
  Clock clock_;
  std::vector<Ended> before_;          // of the bodies
  std::vector<Patch> patches_, next_;  // by pair
  std::vector<Load> loads_;            // of the last advance, by pair
  std::vector<bc_body_box> boxes_;     // none: box k is body k
  Own own_;
  // Memory that calls use again.
  Islands islands_;
  size_t room_ = 0;          // for patches
  bool is_grouped_ = false;  // whether islands are those of the patches
  std::vector<bc_size> sizes_;
  std::vector<bc_pose> box_poses_;
  std::vector<BoxPair> keys_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
