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

  Near see(double s) const {
    Near near;
    near.s = s;
    near.nearest.size = sizeof(bc_nearest);
    Pose<double> a = motion_.a.pose_at(s), b = motion_.b.pose_at(s);
    kernel_.nearest_pair({a.position.v, b.position.v, motion_.a.size.v, motion_.b.size.v},
                         near.nearest);
    return near;
  }
  // The rate of the distance [m].
  double rate(const Near& near) const {
    return dot(near.normal(), speed_of(motion_.b, near.nearest.point_b, near.s) -
                                  speed_of(motion_.a, near.nearest.point_a, near.s));
  }

  // Take up the planes of boxes apart. None of them needs to be the right one.
  void take_up(const Near& near, const Instant& now) {
    constexpr double flat = 1e-7;
    Vector n = near.normal(), edge[2];
    int count[2] = {}, which[2] = {};
    for (int of = 0; of < 2; ++of)
      for (int k = 0; k < 3; ++k)
        if (const Vector& e = (of ? now.b : now.a).axes[k]; std::fabs(dot(n, e)) < flat)
          ++count[of], which[of] = k, edge[of] = e;
    auto add = [&](Turns turns, const Vector& rate) {
      keep(Plane::turning(motion_, now, turns, n, rate));
    };
    if (count[0] == 2) add(Turns::with_a, motion_.a.rate);
    if (count[1] == 2) add(Turns::with_b, motion_.b.rate);
    bool are_edges = count[0] == 1 && count[1] == 1;
    if (Vector sides = are_edges ? cross(edge[0], edge[1]) : Vector{};
        are_edges && norm(sides) > 1e-6) {
      keep(Plane::across(motion_, which[0], which[1], dot(n, sides) > 0.0 ? 1.0 : -1.0));
    } else if (count[0] < 2 && count[1] < 2) {
      Vector speed = speed_of(motion_.b, near.nearest.point_b, near.s) -
                     speed_of(motion_.a, near.nearest.point_a, near.s);
      Vector turning = (1.0 / near.nearest.distance) * (speed - dot(n, speed) * n);
      if (int of = count[0] ? 0 : 1; count[of]) {  // and it stays across the edge that there is
        const Vector& e = edge[of];
        turning = turning - (dot(n, cross((of ? motion_.b : motion_.a).rate, e)) +
                             dot(turning, e)) * e;
      }
      add(Turns::with_points, cross(n, turning));
    }
    add(Turns::never, {});
  }
  // Forget all planes but the last ones.
  void forget_all_but(int count) { first_ = max(first_, last_ - count); }

  // Go on from `now`, where the distance is `distance`, to a later time until which it stays above the
  // target; 1: to the end. `slack`: a gap above the target that is not worth another step. The greatest
  // speed takes it at least so far, half of the way because a distance has an error.
  Instant advance(const Instant& now, double distance, double target, double slack) {
    double least = now.s + 0.5 * (distance - target) / motion_.fastest;
    Instant at = now;
    int count = last_ - first_;
    for (int still = 0, k = count - 1; still < count && at.s < 1.0;
         ++still, k = (k + count - 1) % count)
      if (follow(plane(first_ + k), target, slack, at)) still = 0;
    return at.s < least ? motion_.at(min(least, 1.0)) : at;
  }

 private:
  static Vector speed_of(const Moving& box, const double* point, double s) {
    Vector at{point[0], point[1], point[2]};
    return box.way + cross(box.rate, at - (box.from + s * box.way));
  }

  // Go on with a plane while the gap along it is above the target: some steps, which converge where the
  // gap closes. Then others may be better. Returns whether it went on.
  bool follow(const Plane& plane, double target, double slack, Instant& now) const {
    double begin = now.s;
    for (int step = 0; step < 40 && now.s < 1.0; ++step) {
      Bound bound = bound_of(motion_, now, plane, target);
      if (!(bound.value > 0.0 && bound.at(0.0) > slack)) break;
      double d = bound.last_time(slack), next = d >= 1.0 - now.s ? 1.0 : now.s + d;
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
