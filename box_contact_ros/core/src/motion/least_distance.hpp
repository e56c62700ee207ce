// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The least distance of two moving boxes, and when.
//
// 1. Down: from a time at which the distance falls to a local minimum, by rates.
// 2. Proof: planes are followed while the gap is above the least distance known, less the tolerance.
//    Where none goes further, the next distance is taken. It is a lower one, or gives better planes.
#pragma once

#include "time_of_impact.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

class LeastDistance {
 public:
  LeastDistance(Follower& follower, double tolerance)
      : follower_(follower), motion_(follower.motion()), tolerance_(tolerance) {}

  // Find the least distance, to the tolerance. Where boxes touch, or may, it is what the time of impact
  // without a clearance has.
  Near find() {
    best_.nearest.distance = infinity;
    look(1.0);
    Instant now = motion_.at(0.0);
    do {
      Near here = look(now);
      if (follower_.rate(here) < 0.0 && here.nearest.distance <= least()) descend(here);
      if (least() <= tolerance_) {
        Near first;
        return find_time_of_impact(follower_, 0.0, tolerance_, first) ? first : best_;
      }
      follower_.forget_all_but(24);
      double target = least() - tolerance_ + motion_.rounding;
      now = follower_.advance(now, here.nearest.distance, target, 0.2 * tolerance_);
    } while (now.s < 1.0);
    return best_;
  }

 private:
  double least() const { return best_.nearest.distance; }

  Near look(double s) { return look(motion_.at(s)); }
  Near look(const Instant& now) {
    Near near = follower_.see(now);
    if (!near.nearest.colliding) follower_.take_up(near, now);
    if (near.nearest.distance < least()) best_ = near;
    return near;
  }

  // Go down from a time at which the distance falls: first on to where it rises again, then between both.
  // No distance of a convex valley is below the point where the tangents meet: a valley that has nothing
  // lower to offer is left. The proof looks at all of them again.
  void descend(Near low) {
    double step = min(0.25, low.nearest.distance / -follower_.rate(low));
    auto rises = [&](const Near& near) {
      return near.nearest.distance > low.nearest.distance || follower_.rate(near) >= 0.0;
    };
    Near high = look(min(1.0, low.s + step));
    while (!rises(high)) {
      if (high.s == 1.0 || high.nearest.colliding) return;
      low = high, step *= 2.0;
      high = look(min(1.0, low.s + step));
    }
    for (int round = 0; round < 40 && least() > tolerance_; ++round) {
      double width = high.s - low.s, fall = follower_.rate(low), rise = follower_.rate(high);
      double enough = least() - 0.25 * tolerance_, x = 0.5 * width;
      if (!(fall < 0.0 && width > 1e-12) || low.nearest.distance + fall * width > enough) return;
      if (rise > 0.0) {
        double change = high.nearest.distance - low.nearest.distance;
        double meet = (change - rise * width) / (fall - rise);  // of the tangents
        if (meet >= 0.0 && meet <= width && low.nearest.distance + fall * meet > enough) return;
        double z = (fall + rise) - 3.0 * change / width;
        double y = std::sqrt(max(z * z - fall * rise, 0.0));
        double cubic = width * (1.0 - (rise + y - z) / (rise - fall + 2.0 * y));  // its minimum
        if (round % 5 < 4) x = min(max(round % 2 ? meet : cubic, 0.01 * width), 0.99 * width);
      }
      Near middle = look(low.s + x);
      (rises(middle) ? high : low) = middle;
    }
  }

  Follower& follower_;
  const Motion& motion_;
  double tolerance_;
  Near best_{};  // of all that were looked at
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
