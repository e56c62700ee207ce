// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Following: from a time on, until which later time are two boxes farther apart than a target?
//
// Each distance gives planes, by the features that are nearest then. Planes are followed in turn until
// none goes further: while the gap along one of them is above the target, so is the distance.
#pragma once

#include <array>

#include "../kernel.hpp"
#include "planes.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

// Nearest points at a time.
struct Near {
  double s;
  bc_nearest nearest;

  Vector normal() const { return {nearest.normal[0], nearest.normal[1], nearest.normal[2]}; }
};

// Two boxes on their ways, and what is known of them.
class Follower {
 public:
  Follower(const Motion& motion, const detail::Kernel& kernel) : motion_(motion), kernel_(kernel) {}

  const Motion& motion() const { return motion_; }

  Near see(const Instant& now) const {
    Near near;
    near.s = now.s;
    near.nearest.size = sizeof(bc_nearest);
    Pose<double> a = motion_.pose(0, now), b = motion_.pose(1, now);
    kernel_.nearest_pair({a.position.v, b.position.v, motion_.sizes[0].v, motion_.sizes[1].v},
                         near.nearest);
    return near;
  }
  // The velocity of B's nearest point beside A's [m].
  Vector velocity(const Near& near) const {
    return motion_.velocity(1, near.nearest.point_b, near.s) -
           motion_.velocity(0, near.nearest.point_a, near.s);
  }
  // The rate of the distance [m].
  double rate(const Near& near) const { return dot(near.normal(), velocity(near)); }

  // Take up the planes of boxes apart. None of them needs to be the right one.
  void take_up(const Near& near, const Instant& now) {
    constexpr double flat = 1e-7;
    Vector n = near.normal(), edge[2];
    int count[2] = {}, which[2] = {};
    for (int k = 0; k < 3; ++k) {
      Both cosines = abs(dot(both(n, n), now.axes[k]));
      for (int box = 0; box < 2; ++box)
        if (cosines[box] < flat) ++count[box], which[box] = k, edge[box] = now.axis(box, k);
    }
    auto add = [&](Follows follows, const Vector& rate) {
      keep(Plane::turning(motion_, now, follows, n, rate));
    };
    if (count[0] == 2) add(Follows::face_of_a, vector_of(motion_.rate, 0));
    if (count[1] == 2) add(Follows::face_of_b, vector_of(motion_.rate, 1));
    bool are_edges = count[0] == 1 && count[1] == 1;
    if (Vector sides = are_edges ? cross(edge[0], edge[1]) : Vector{};
        are_edges && length(sides) > 1e-6) {
      keep(Plane::across(which[0], which[1], dot(n, sides) > 0.0 ? 1.0 : -1.0));
    } else if (count[0] < 2 && count[1] < 2) {
      Vector speed = velocity(near);
      Vector turning = (1.0 / near.nearest.distance) * (speed - dot(n, speed) * n);
      if (int box = count[0] ? 0 : 1; count[box]) {  // and it stays across the edge that there is
        const Vector& e = edge[box];
        turning = turning - (dot(n, cross(vector_of(motion_.rate, box), e)) + dot(turning, e)) * e;
      }
      add(Follows::points, cross(n, turning));
    }
    add(Follows::nothing, {});
  }
  // Forget all planes but the last ones.
  void forget_all_but(int count) { first_ = max(first_, last_ - count); }

  // Go on from `now`, where the distance is `distance`, to a later time until which it stays above the
  // target; 1: to the end. `slack`: a gap above the target that is not worth another step. The greatest
  // speed takes it at least so far, half of the way because a distance has an error.
  Instant advance(const Instant& now, double distance, double target, double slack) const {
    double least = now.s + 0.5 * (distance - target) / motion_.fastest;
    Instant at = now;
    int count = last_ - first_;
    for (int still = 0, k = count - 1; still < count && at.s < 1.0;
         ++still, k = (k + count - 1) % count)
      if (follow(plane(first_ + k), target, slack, at)) still = 0;
    return at.s < least ? motion_.at(min(least, 1.0)) : at;
  }

 private:
  // Go on with a plane while the gap along it is above the target: some steps, which converge where the
  // gap closes. Then others may be better. Returns whether it went on.
  bool follow(const Plane& plane, double target, double slack, Instant& now) const {
    double begin = now.s;
    for (int step = 0; step < 40 && now.s < 1.0; ++step) {
      double d = bound_of(motion_, now, plane, target, slack).last_time(slack);
      double next = d >= 1.0 - now.s ? 1.0 : now.s + d;
      if (!(next > now.s)) break;
      now = motion_.at(next);
    }
    return now.s > begin;
  }

  static constexpr int capacity = 64;
  void keep(const Plane& plane) {
    planes_[unsigned(last_++) % capacity] = plane;
    first_ = max(first_, last_ - capacity);
  }
  const Plane& plane(int k) const { return planes_[unsigned(k) % capacity]; }

  const Motion& motion_;
  const detail::Kernel& kernel_;
  std::array<Plane, capacity> planes_;
  int first_ = 0, last_ = 0;
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
