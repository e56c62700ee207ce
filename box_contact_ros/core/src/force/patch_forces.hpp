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
#include "rectangle.hpp"
#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A window is at least the one before divided by this, and a step begins with at most so many times the
// impulses of a window [1]. What iterations leave is as large in a step of 1 ns as in one of 5 ms:
// divided by the step it would be any force.
constexpr double window_growth = 2.0;
// Angular frequency of a soft constraint times the window [1]: a quarter turn. A box that rests on a
// whole face is 0.4·g·step² deep.
constexpr double soft_frequency = 1.57;
// The same times half a period and the latency of an answer [1]. With 2 a container at 50 Hz and 5 ms
// tilts by 0.06°; from 4 on late loads vibrate.
constexpr double late_frequency = 2.5;
// Of pushing out [1]: an overlap shrinks by a ninth a step. With 1, impacts are half as deep again.
constexpr double soft_damping_ratio = 5.0;
// The same where answers are late, or a patch has a stiffness of its own.
constexpr double slow_damping_ratio = 2.0;
// Speed at which an overlap is pushed out, at most [m/s].
constexpr double push_out_limit = 1.0;
// An answer that is overdue by so many periods [1] pushes nothing out.
constexpr double overdue_periods = 3.0;
// Steps accepted [s]: at least this long, so that a speed divided by one is a number; and shorter than
// that, as nothing that touches stays within its patch for so long.
constexpr double step_min = 1e-50, step_limit = 1.0;
// A smaller change of a patch's speeds [m/s] does not make its neighbours be solved again. With 1e-6 a
// jittered tower of 20 sways for 8 s.
constexpr double least_change = 1e-8;

// The patch of a pair, where it was asked for, and the impulses that its rows gave in the last window:
// in the last step, and before it if that was short.
struct Patch {
  int32_t a, b;  // places of the bodies, a < b
  Placed asked_a, asked_b;
  Vec<double> normal, point;
  Rectangle shape;
  double depth;         // volume / area [m]
  double friction;      // μ [1]
  double stiffness;     // [N/m]; 0: as stiff as step and answers bear
  Vec<double> surface;  // velocity of B's surface relative to A's, beside the bodies' own [m/s]
  double late;          // from the question to the answer [s]
  double age;           // since the answer was taken [s]

  double press, spin;      // N [N s], m [N m s]
  Vec<double> slip, rock;  // f [N s], τ [N m s]
  Vec<double> given_arm;   // from A's centre of mass to where they acted [m]

  std::pair<int32_t, int32_t> pair() const { return {a, b}; }

  // Whether area and depth are numbers: what no limit of an answer alone makes sure of.
  bool has_area() const { return shape.has_area() && depth >= 0.0 && depth <= place_max; }

  // Whether all of it is within what is accepted.
  bool is_sound() const {
    bool is_asked = asked_a.is_sound() && asked_b.is_sound() && is_unit(normal) &&
                    is_within(point, length_max) && shape.is_sound() && has_area() &&
                    is_amount(friction) && is_amount(stiffness) && is_within(surface, speed_max) &&
                    is_amount(late) && is_amount(age);
    return is_asked && press >= 0.0 && press <= wrench_max && std::fabs(spin) <= wrench_max &&
           is_within(slip, wrench_max) && is_within(rock, wrench_max) &&
           is_within(given_arm, place_max);
  }
};

// A body in a step.
struct Moving {
  Vec<double> linear, angular;
  double inverse_mass;
  Mat<double> inverse_inertia;  // common frame
  int changed;                  // the last iteration that changed its velocities
};

// How pressing and rocking are solved: the impulses change by −mass·(v + bias + softness·impulses).
struct PressRows {
  Vec<double> softness, bias;
  Mat<double> mass;
};

// A patch in a step. Impulses are components: N, τ1, τ2 and f1, f2, m / r.
struct Block {
  int32_t a, b;
  Vec<double> arm_a, arm_b, normal, surface;
  Rectangle shape;
  double friction;
  double closing;         // how much an impulse N alone changes the closing speed [1/kg]
  double least_rub_mass;  // of any row of friction and torsion
  PressRows pushing, relaxed;
  Mat<double> rub_mass;
  Vec<double> press, rub;
};

class PatchForces {
 public:
  struct Options {
    int iterations, relaxations;
    double friction;

    bool is_sound() const { return iterations >= 1 && relaxations >= 0 && is_amount(friction); }
  };
  enum class Held { all, pair_twice, no_patch };

  PatchForces(std::vector<Body> bodies, const Options& options)
      : bodies_(std::move(bodies)), options_(options), relaxed_(bodies_.size()) {}

  const std::vector<Body>& bodies() const { return bodies_; }

  // Change masses, add bodies at the end, or drop bodies there with their patches.
  void set_bodies(std::vector<Body> bodies) {
    bodies_ = std::move(bodies);
    relaxed_.resize(bodies_.size());
    auto count = int32_t(bodies_.size());
    drop([count](const Patch& patch) { return patch.b >= count; });
  }
  void forget(int32_t body) {
    drop([body](const Patch& patch) { return patch.a == body || patch.b == body; });
    relaxed_[size_t(body)] = {};
  }
  void reset() {
    patches_.clear();
    relaxed_.assign(bodies_.size(), {});
    clock_ = {};
  }

  // Take an answer, and the poses of its question. Pairs that are missing are forgotten. Nothing
  // changes for a pair that comes twice, and for a patch whose numbers leave float64's range.
  Held hold(const bc_patches& answer, const bc_pose* poses) {
    next_.clear();
    for (int64_t k = 0; k < answer.count; ++k) {
      auto a = size_t(answer.pairs[2 * k]), b = size_t(answer.pairs[2 * k + 1]);
      bool is_stale = answer.separation[k] != answer.separation[k];
      if (!bodies_[a].is_free() && !bodies_[b].is_free()) continue;
      if (!is_stale && !(answer.volume[k] > 0.0)) continue;
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
    clock_.period = answer.period > 0.0 ? answer.period : std::max(0.0, clock_.since);
    clock_.since = 0.0;
    return Held::all;
  }

  // From poses, velocities and outside wrenches at the start of a step h to the velocities during it.
  // Or to the wrenches of contacts that lead to them.
  void step(double h, const bc_pose* poses, const bc_velocity* velocities, const bc_wrench* outside,
            bc_velocity* after, bc_wrench* wrenches) {
    begin(h, poses, velocities, outside);
    blocks_.resize(patches_.size());
    double before = clock_.window;
    clock_.window = std::max(h, before / window_growth);
    double ratio = before > 0.0 ? std::min(h / before, window_growth) : 1.0;
    for (size_t k = 0; k < patches_.size(); ++k) {
      prepare(patches_[k], h, blocks_[k]);
      warm_start(patches_[k], ratio, blocks_[k]);
      patches_[k].age += h;
    }
    solve(options_.iterations, &Block::pushing);
    for (size_t k = 0; k < bodies_.size(); ++k) {
      if (wrenches) write_wrench(k, h, velocities[k], outside ? outside + k : nullptr, wrenches[k]);
      if (after) write(moving_[k].linear, moving_[k].angular, after[k].linear, after[k].angular);
      relaxed_[k] = {-moving_[k].linear, -moving_[k].angular};
    }
    solve(options_.relaxations, &Block::relaxed);
    for (size_t k = 0; k < bodies_.size(); ++k)
      relaxed_[k] = {relaxed_[k].linear + moving_[k].linear,
                     relaxed_[k].angular + moving_[k].angular};
    double kept = before > 0.0 ? (clock_.window - h) / before : 0.0;
    for (size_t k = 0; k < patches_.size(); ++k) store(blocks_[k], kept, patches_[k]);
    if (clock_.since >= 0.0) clock_.since += h;
  }

  // Visit all of the state: whole numbers, single structs, and rows of structs.
  template <class Self, class Visit>
  static void visit_state(Self& self, Visit visit) {
    visit(&self.options_, 1);
    visit(&self.clock_, 1);
    visit(self.bodies_.data(), self.bodies_.size());
    visit(self.relaxed_.data(), self.relaxed_.size());
    visit(self.patches_.data(), self.patches_.size());
  }
  size_t patch_count() const { return patches_.size(); }
  void make_room(size_t bodies, size_t patches) {
    bodies_.resize(bodies);
    relaxed_.resize(bodies);
    patches_.resize(patches);
  }
  // Whether the state is one that calls may have made.
  bool is_sound() const {
    bool is_time = (clock_.since == -1.0 || is_amount(clock_.since)) && is_amount(clock_.period) &&
                   is_amount(clock_.window) && clock_.window < step_limit;
    auto of_bodies = [this](const Patch& patch) {
      return 0 <= patch.a && patch.a < patch.b && size_t(patch.b) < bodies_.size();
    };
    auto out_of_order = [](const Patch& p, const Patch& q) { return p.pair() >= q.pair(); };
    auto is_sound = [](const auto& each) { return each.is_sound(); };
    auto all = [](const auto& rows, auto holds) {
      return std::all_of(rows.begin(), rows.end(), holds);
    };
    return options_.is_sound() && is_time && all(bodies_, is_sound) && all(relaxed_, is_sound) &&
           all(patches_, of_bodies) && all(patches_, is_sound) &&
           std::adjacent_find(patches_.begin(), patches_.end(), out_of_order) == patches_.end();
  }

 private:
  struct Clock {
    double since = -1.0;  // the last answer [s]; below 0: there was none
    double period = 0.0;  // between answers, as told or between the last two [s]
    double window = 0.0;  // the time in which the patches' impulses were given [s]
  };

  template <class Condition>
  void drop(Condition condition) {
    patches_.erase(std::remove_if(patches_.begin(), patches_.end(), condition), patches_.end());
  }

  Patch read(const bc_patches& answer, int64_t k, bool is_stale, const bc_pose* poses) const {
    auto a = int32_t(answer.pairs[2 * k]), b = int32_t(answer.pairs[2 * k + 1]);
    double sign = a < b ? 1.0 : -1.0;
    Patch patch{};
    patch.a = std::min(a, b);
    patch.b = std::max(a, b);
    patch.age = is_stale ? -1.0 : 0.0;
    if (is_stale) return patch;
    patch.asked_a = placed_at(poses[patch.a], bodies_[size_t(patch.a)].centre);
    patch.asked_b = placed_at(poses[patch.b], bodies_[size_t(patch.b)].centre);
    patch.normal = sign * vector_at(answer.normal + 3 * k);
    patch.point = vector_at(answer.point + 3 * k);
    patch.shape = rectangle_of(patch.normal, answer.covariance + 9 * k);
    patch.depth = answer.volume[k] / (4.0 * patch.shape.half_1 * patch.shape.half_2);
    patch.friction = answer.friction ? answer.friction[k] : options_.friction;
    patch.stiffness = answer.stiffness ? answer.stiffness[k] : 0.0;
    if (answer.surface) patch.surface = sign * vector_at(answer.surface + 3 * k);
    patch.late = answer.age;
    return patch;
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

  // Velocities under the outside wrenches alone.
  void begin(double h, const bc_pose* poses, const bc_velocity* velocities,
             const bc_wrench* outside) {
    places_.resize(bodies_.size());
    moving_.resize(bodies_.size());
    for (size_t k = 0; k < bodies_.size(); ++k) {
      const Body& body = bodies_[k];
      Moving& moving = moving_[k];
      places_[k] = placed_at(poses[k], body.centre);
      moving = {vector(velocities[k].linear), vector(velocities[k].angular), body.inverse_mass,
                {}, 0};
      if (!body.is_free()) continue;
      moving.inverse_inertia = inverse_inertia_of(body, places_[k]);
      moving.angular += places_[k].axes * coasting(k, h, moving.angular) + relaxed_[k].angular;
      moving.linear += relaxed_[k].linear;
      if (!outside) continue;
      moving.linear += (h * body.inverse_mass) * vector(outside[k].force);
      moving.angular += h * (moving.inverse_inertia * vector(outside[k].torque));
    }
  }

  // How a body's angular velocity changes in a step without any torque; in its own frame.
  Vec<double> coasting(size_t k, double h, const Vec<double>& angular) const {
    return gyroscopic_change(bodies_[k], transposed_times(places_[k].axes, angular), h);
  }

  void prepare(const Patch& patch, double h, Block& block) const {
    const Placed &a = places_[size_t(patch.a)], &b = places_[size_t(patch.b)];
    const Moving &body_a = moving_[size_t(patch.a)], &body_b = moving_[size_t(patch.b)];
    const Rectangle& shape = patch.shape;
    // The patch goes with the body that no force moves, or with the mean of two that are free.
    Vec<double> way_a = carried(patch.asked_a, a, patch.point) - patch.point;
    Vec<double> way_b = carried(patch.asked_b, b, patch.point) - patch.point;
    double share = body_a.inverse_mass > 0.0 ? body_b.inverse_mass > 0.0 ? 0.5 : 1.0 : 0.0;
    Vec<double> point = patch.point + (1.0 - share) * way_a + share * way_b;
    block.a = patch.a;
    block.b = patch.b;
    block.arm_a = point - a.position;
    block.arm_b = point - b.position;
    block.normal = patch.normal;
    block.surface = patch.surface;
    block.shape = shape;
    block.friction = patch.friction;

    Vec<double> zero{0.0, 0.0, 0.0};
    Mat<double> rubbed = compliance(body_a, body_b, block, {shape.axis_1, shape.axis_2, zero},
                                    {zero, zero, shape.radius * patch.normal});
    block.rub_mass = inverse(rubbed);
    block.least_rub_mass = 1.0 / std::max(std::max(rubbed[0][0], rubbed[1][1]), rubbed[2][2]);
    Mat<double> pressed = compliance(body_a, body_b, block, {patch.normal, zero, zero},
                                     {zero, shape.axis_1, shape.axis_2});
    block.closing = pressed[0][0];
    double depth = patch.depth + dot(way_a - way_b, patch.normal);
    Vec<double> turned = turn(patch.asked_b, b) - turn(patch.asked_a, a);
    soften(patch, h, depth, turned, pressed, block);
  }

  // Catto's soft step: a spring and a damper, implicit in time. Relaxation is without them, but for a
  // stiffness of the patch's own. Rocking is soft where answers are late: the wedge of the overlap,
  // which levels a body, is late then.
  void soften(const Patch& patch, double h, double depth, const Vec<double>& turned,
              const Mat<double>& pressed, Block& block) const {
    bool is_apart = depth < 0.0;
    block.relaxed = {{0.0, 0.0, 0.0}, {is_apart ? -depth / h : 0.0, 0.0, 0.0}, inverse(pressed)};
    block.pushing = block.relaxed;
    if (is_apart || patch.age > overdue_periods * std::max(clock_.period, h)) return;
    double frequency = soft_frequency / clock_.window;
    double bearable = late_frequency / (patch.late + 0.5 * clock_.period);
    bool is_late = bearable < frequency, is_spring = patch.stiffness > 0.0;
    if (is_late) frequency = bearable;
    if (is_spring) frequency = std::sqrt(patch.stiffness * pressed[0][0]);
    double damping = is_late || is_spring ? slow_damping_ratio : soft_damping_ratio;
    double rate = frequency / (2.0 * damping + h * frequency);
    double softness = rate / (h * frequency * frequency);
    PressRows& rows = block.pushing;
    if (is_late) {
      rows.softness = softness * Vec<double>{0.0, pressed[1][1], pressed[2][2]};
      rows.bias = rate * Vec<double>{0.0, dot(turned, block.shape.axis_1),
                                     dot(turned, block.shape.axis_2)};
      rows.mass = softened(pressed, rows.softness);
      block.relaxed = rows;
    }
    rows.softness[0] = softness * pressed[0][0];
    rows.bias[0] = -std::min(push_out_limit, rate * depth);
    rows.mass = softened(pressed, rows.softness);
    if (is_spring) block.relaxed = rows;
  }
  static Mat<double> softened(Mat<double> pressed, const Vec<double>& softness) {
    for (int i = 0; i < 3; ++i) pressed[i][i] += softness[i];
    return inverse(pressed);
  }

  // The impulses of the last window, about the point of this step.
  void remember(const Patch& patch, const Block& block, Vec<double>& press, Vec<double>& rub) const {
    const Rectangle& shape = block.shape;
    Vec<double> moved = patch.given_arm - block.arm_a;
    Vec<double> rock = patch.rock + cross(moved, patch.press * patch.normal);
    double spin = patch.spin + dot(patch.normal, cross(moved, patch.slip));
    press = {patch.press, clamp(dot(rock, shape.axis_1), patch.press * shape.half_2),
             clamp(dot(rock, shape.axis_2), patch.press * shape.half_1)};
    rub = {dot(patch.slip, shape.axis_1), dot(patch.slip, shape.axis_2),
           shape.radius > 0.0 ? spin / shape.radius : 0.0};
    bound(rub, block.friction * press[0]);
  }

  // Give `ratio` of them again.
  void warm_start(const Patch& patch, double ratio, Block& block) {
    remember(patch, block, block.press, block.rub);
    block.press = ratio * block.press;
    block.rub = ratio * block.rub;
    give_press(block, block.press);
    give_rub(block, block.rub);
  }

  // Keep the impulses of this step, and `kept` of those before.
  void store(Block& block, double kept, Patch& patch) const {
    if (kept > 0.0) {
      Vec<double> press, rub;
      remember(patch, block, press, rub);
      block.press += kept * press;
      block.rub += kept * rub;
    }
    const Rectangle& shape = block.shape;
    patch.press = block.press[0];
    patch.rock = block.press[1] * shape.axis_1 + block.press[2] * shape.axis_2;
    patch.slip = block.rub[0] * shape.axis_1 + block.rub[1] * shape.axis_2;
    patch.spin = shape.radius * block.rub[2];
    patch.given_arm = block.arm_a;
  }

  // Solve the blocks in turn, so many times. A block whose bodies have not changed since its last turn
  // is left out.
  void solve(int iterations, PressRows Block::*rows) {
    for (Moving& moving : moving_) moving.changed = 0;
    bool is_solved = false;
    for (int iteration = 1; iteration <= iterations && !is_solved; ++iteration) {
      is_solved = true;
      for (Block& block : blocks_) {
        Moving &a = moving_[size_t(block.a)], &b = moving_[size_t(block.b)];
        if (std::max(a.changed, b.changed) < iteration - 1) continue;
        double pressed = press(block, block.*rows);  // friction is bounded by what presses now
        double rubbed = rub(block);
        if (std::max(pressed, rubbed) <= least_change) continue;
        is_solved = false;
        if (a.inverse_mass > 0.0) a.changed = iteration;
        if (b.inverse_mass > 0.0) b.changed = iteration;
      }
    }
  }

  // Solve friction and torsion. Returns by how much a speed changed.
  double rub(Block& block) {
    const Rectangle& shape = block.shape;
    Vec<double> slip = speed(block) + block.surface;
    Vec<double> v{dot(slip, shape.axis_1), dot(slip, shape.axis_2),
                  shape.radius * dot(turning(block), block.normal)};
    double limit = block.friction * block.press[0];
    Vec<double> next = block.rub - block.rub_mass * v;
    if (dot(next, next) > limit * limit) {
      // It slides: one factor for all rows turns friction against the motion.
      next = block.rub - block.least_rub_mass * v;
      bound(next, limit);
    }
    Vec<double> change = next - block.rub;
    block.rub = next;
    give_rub(block, change);
    return largest(abs(change)) / block.least_rub_mass;
  }

  // Solve pressing and rocking. Returns by how much the closing speed changed.
  double press(Block& block, const PressRows& rows) {
    Vec<double> before = block.press;
    const Mat<double>& mass = rows.mass;
    auto error = [&] {
      Vec<double> turns = turning(block);
      return Vec<double>{dot(speed(block), block.normal), dot(turns, block.shape.axis_1),
                         dot(turns, block.shape.axis_2)} +
             rows.bias + rows.softness * block.press;
    };
    Vec<double> v = error(), next = block.press - mass * v;
    double limit_1 = next[0] * block.shape.half_2, limit_2 = next[0] * block.shape.half_1;
    if (!(std::fabs(next[1]) <= limit_1 && std::fabs(next[2]) <= limit_2)) {
      // The pressure would be negative at the rim: row by row, within the limits.
      double alone = 1.0 / (block.closing + rows.softness[0]);
      next = {std::max(0.0, block.press[0] - alone * v[0]), block.press[1], block.press[2]};
      give_press(block, next - block.press);
      block.press = next;
      v = error();
      next[1] = clamp(next[1] - mass[1][1] * v[1], next[0] * block.shape.half_2);
      next[2] = clamp(next[2] - mass[2][2] * v[2], next[0] * block.shape.half_1);
    }
    give_press(block, next - block.press);
    block.press = next;
    return std::fabs(next[0] - before[0]) * block.closing;
  }

  static double clamp(double x, double limit) { return std::max(-limit, std::min(limit, x)); }
  static void bound(Vec<double>& rub, double limit) {
    double squared = dot(rub, rub);
    if (squared > limit * limit) rub = (limit / std::sqrt(squared)) * rub;
  }

  // How the velocities along three rows change by impulses along them. A row is a direction at the
  // point and an axis.
  static Mat<double> compliance(const Moving& a, const Moving& b, const Block& block,
                                const Vec<double> (&directions)[3], const Vec<double> (&axes)[3]) {
    Mat<double> m;
    Vec<double> turn_a[3], turn_b[3];
    for (int i = 0; i < 3; ++i) {
      turn_a[i] = cross(block.arm_a, directions[i]) + axes[i];
      turn_b[i] = cross(block.arm_b, directions[i]) + axes[i];
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j)
        m[i][j] = m[j][i] = (a.inverse_mass + b.inverse_mass) * dot(directions[i], directions[j]) +
                            dot(turn_a[i], a.inverse_inertia * turn_a[j]) +
                            dot(turn_b[i], b.inverse_inertia * turn_b[j]);
    return m;
  }

  void give_press(const Block& block, const Vec<double>& x) {
    give(block, x[0] * block.normal, x[1] * block.shape.axis_1 + x[2] * block.shape.axis_2);
  }
  void give_rub(const Block& block, const Vec<double>& x) {
    give(block, x[0] * block.shape.axis_1 + x[1] * block.shape.axis_2,
         (block.shape.radius * x[2]) * block.normal);
  }
  // Give B an impulse at the point and an angular impulse, and A the opposite.
  void give(const Block& block, const Vec<double>& impulse, const Vec<double>& turn) {
    Moving &a = moving_[size_t(block.a)], &b = moving_[size_t(block.b)];
    a.linear = a.linear - a.inverse_mass * impulse;
    a.angular = a.angular - a.inverse_inertia * (cross(block.arm_a, impulse) + turn);
    b.linear = b.linear + b.inverse_mass * impulse;
    b.angular = b.angular + b.inverse_inertia * (cross(block.arm_b, impulse) + turn);
  }

  // Velocities of B relative to A: at the point, and angular.
  Vec<double> speed(const Block& block) const {
    const Moving &a = moving_[size_t(block.a)], &b = moving_[size_t(block.b)];
    return (b.linear + cross(b.angular, block.arm_b)) - (a.linear + cross(a.angular, block.arm_a));
  }
  Vec<double> turning(const Block& block) const {
    return moving_[size_t(block.b)].angular - moving_[size_t(block.a)].angular;
  }

  static void write(const Vec<double>& v, const Vec<double>& w, double* linear, double* angular) {
    std::copy_n(v.v, 3, linear);
    std::copy_n(w.v, 3, angular);
  }
  void write_wrench(size_t k, double h, const bc_velocity& velocity, const bc_wrench* outside,
                    bc_wrench& wrench) const {
    const Body& body = bodies_[k];
    const Mat<double>& axes = places_[k].axes;
    wrench = {};
    if (!body.is_free()) return;
    Vec<double> linear = moving_[k].linear - vector(velocity.linear);
    Vec<double> angular = vector(velocity.angular), turned = moving_[k].angular - angular;
    Vec<double> force = (1.0 / (h * body.inverse_mass)) * linear;
    Vec<double> driven = transposed_times(axes, turned) - coasting(k, h, angular);
    Vec<double> torque = axes * (((1.0 / h) * driven) / body.inverse_inertia);
    if (outside) {
      force = force - vector(outside->force);
      torque = torque - vector(outside->torque);
    }
    write(force, torque, wrench.force, wrench.torque);
  }

  std::vector<Body> bodies_;
  Options options_;
  Clock clock_;
  std::vector<Motion> relaxed_;        // what relaxation adds to the velocities of the last step
  std::vector<Patch> patches_, next_;  // by pair
  std::vector<Placed> places_;
  std::vector<Moving> moving_;
  std::vector<Block> blocks_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
