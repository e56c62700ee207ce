// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// One body, from the start of an advance to its end, beside what its contacts do.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "block.hpp"
#include "carriers.hpp"
#include "clock.hpp"
#include "rotation.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// How a body ended the last advance: its velocities before relaxation, and after it. Of a body that no force
// moves: those in the last advance but one, and in the last.
struct Ended {
  Motion pushed, relaxed;
  Fineness fineness;
  SlowTime slow;
};

// What an advance is given of each body.
struct Given {
  const bc_pose* poses;
  const bc_velocity* velocities;
  const bc_wrench* outside;  // none: no wrenches
  const bc_pose* ends = nullptr;  // of bodies that the caller moves by their poses
};

// Where a body is that goes on for a time [s] by its velocity alone.
inline bc_pose pose_after(double time, const Body& body, const bc_pose& pose,
                          const bc_velocity& velocity) {
  if (time == 0.0 || is_still(velocity)) return pose;
  Placed placed = placed_at(pose, body.centre);
  placed.position += time * vector(velocity.linear);
  double turned[4];
  double scale = 1.0 / std::sqrt(squared_norm(pose.quaternion));
  for (int i = 0; i < 4; ++i) turned[i] = scale * pose.quaternion[i];
  Vec<double> angular = vector(velocity.angular);
  rotate_freely<double>(body.inverse_inertia, body.is_free(), time, turned, placed.axes, angular);
  return pose_at(placed, turned, body.centre);
}

class BodyStep {
 public:
  // carriers: velocities of the bodies that no force moves; rows of others say nothing.
  BodyStep(const std::vector<Body>& bodies, const SubSteps& steps, const Given& given,
           const std::vector<bc_velocity>& carriers, const bc_motion& motion,
           bool came_by_wrenches, std::vector<Ended>& ended)
      : bodies_(bodies),
        steps_(steps),
        given_(given),
        carriers_(carriers),
        motion_(motion),
        came_by_wrenches_(came_by_wrenches),
        ended_(ended) {}

  void begin(Moving& moving) const {
    auto k = size_t(moving.body);
    moving.placed = placed_at(given_.poses[k], bodies_[k].centre);
    const bc_velocity& velocity = bodies_[k].is_free() ? given_.velocities[k] : carriers_[k];
    moving.linear = vector(velocity.linear);
    moving.angular = vector(velocity.angular);
    double scale = 1.0 / std::sqrt(squared_norm(given_.poses[k].quaternion));
    for (int i = 0; i < 4; ++i) moving.quaternion[i] = scale * given_.poses[k].quaternion[i];
    moving.impulse = moving.angular_impulse = {};
    moving.fineness = ended_[k].fineness;
    moving.slow = ended_[k].slow;
    if (!bodies_[k].is_free()) return;
    moving.inverse_inertia = inverse_inertia_of(bodies_[k].inverse_inertia, moving.placed.axes);
    // A caller who moves by the wrenches comes back with the speed of pushing out.
    if (!came_by_wrenches_) return;
    const auto& [pushed, relaxed, fineness, slow] = ended_[k];
    Vec<double> slower = relaxed.linear - pushed.linear, calmer = relaxed.angular - pushed.angular;
    moving.linear += slower;
    moving.angular += calmer;
    moving.impulse = (1.0 / bodies_[k].inverse_mass) * slower;
    moving.angular_impulse = moving.placed.axes * (transposed_times(moving.placed.axes, calmer) /
                                                   bodies_[k].inverse_inertia);
  }
  // Advance a body without contacts.
  void fly(Moving& moving) const {
    for (int number = 1; number <= steps_.count; ++number) {
      drive(moving, number, steps_);
      move(bodies_[size_t(moving.body)], steps_.length, moving);
    }
  }
  // Change velocities by all but contacts, for sub-step `number`.
  void drive(Moving& moving, int number, const SubSteps& steps) const {
    auto k = size_t(moving.body);
    double h = steps.length;
    if (!bodies_[k].is_free()) {
      carry(moving, (number - 0.5) / steps.count - 0.5);
      return;
    }
    if (!given_.outside) return;
    moving.linear += (h * bodies_[k].inverse_mass) * vector(given_.outside[k].force);
    moving.angular += h * (moving.inverse_inertia * vector(given_.outside[k].torque));
  }

  // A sum is finite only if all its numbers are.
  bool ends_finite(const Moving& moving) const {
    double rate = 1.0 / steps_.dt, norm2 = squared_norm(moving.quaternion), sum = norm2;
    for (const Vec<double>& v : {moving.placed.position, moving.linear, moving.angular,
                                 rate * moving.impulse, rate * moving.angular_impulse})
      sum += std::fabs(v[0]) + std::fabs(v[1]) + std::fabs(v[2]);
    return std::isfinite(sum) && norm2 > 0.0;
  }
  // The wrenches lead to the speeds of pushing out if they are constant over the advance.
  void write_end(const Moving& moving) const {
    auto k = size_t(moving.body);
    if (!bodies_[k].is_free()) return;
    double rate = 1.0 / steps_.dt;
    ended_[k] = {moving.pushed, {moving.linear, moving.angular}, moving.fineness, moving.slow};
    write_pose(moving);
    if (motion_.wrenches)
      write(rate * moving.impulse, rate * moving.angular_impulse, motion_.wrenches[k].force,
            motion_.wrenches[k].torque);
    if (motion_.velocities)
      write(moving.linear, moving.angular, motion_.velocities[k].linear,
            motion_.velocities[k].angular);
  }
  bc_pose pose_of(const Moving& moving) const {
    return pose_at(moving.placed, moving.quaternion, bodies_[size_t(moving.body)].centre);
  }
  // A body that no force moves goes on by the velocity that is given. With none, it ends where it is
  // given, to the bit.
  void move_alone(size_t k) const {
    const bc_velocity velocity = given_.velocities[k];
    ended_[k] = {ended_[k].relaxed,
                 {vector(carriers_[k].linear), vector(carriers_[k].angular)}, {}, {}};
    if (motion_.velocities) motion_.velocities[k] = velocity;
    if (motion_.wrenches) motion_.wrenches[k] = {};
    if (!motion_.poses) return;
    if (is_still(velocity)) {
      motion_.poses[k] = given_.ends[k];
      return;
    }
    Moving moving{};
    moving.body = int32_t(k);
    begin(moving);
    for (int number = 0; number < steps_.count; ++number) move(bodies_[k], steps_.length, moving);
    write_pose(moving);
  }

 private:
  // A body that no force moves. `part`: of the step, from its middle [1].
  void carry(Moving& moving, double part) const {
    auto k = size_t(moving.body);
    const auto& [before, last, fineness, slow] = ended_[k];
    const bc_velocity& now = carriers_[k];
    moving.linear = carried_at(part, before.linear, last.linear, vector(now.linear));
    moving.angular = carried_at(part, before.angular, last.angular, vector(now.angular));
  }
  void write_pose(const Moving& moving) const {
    if (motion_.poses) motion_.poses[size_t(moving.body)] = pose_of(moving);
  }
  static void write(const Vec<double>& v, const Vec<double>& w, double* linear, double* angular) {
    std::copy_n(v.v, 3, linear);
    std::copy_n(w.v, 3, angular);
  }

  const std::vector<Body>& bodies_;
  const SubSteps& steps_;
  const Given& given_;
  const std::vector<bc_velocity>& carriers_;
  const bc_motion& motion_;
  bool came_by_wrenches_;  // whether those of the last advance moved the bodies
  std::vector<Ended>& ended_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
