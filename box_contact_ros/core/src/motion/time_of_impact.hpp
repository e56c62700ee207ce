// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Time of impact: the first time at which two moving boxes are as near as a clearance.
#pragma once

#include "follow.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

// Find the nearest points at the first time; false: the boxes never come so near. Before that time the
// distance is above the clearance, by proof. At it, it is at most clearance + tolerance.
//
// Each round takes a distance, and follows planes to the clearance and its rounding. A round goes on
// by half of the spare distance at the greatest speed, or further, so the rounds end.
inline bool find_time_of_impact(Follower& follower, double clearance, double tolerance,
                                Near& found) {
  const Motion& motion = follower.motion();
  double target = clearance + motion.rounding, enough = clearance + tolerance - motion.rounding;
  double slack = 0.5 * tolerance - motion.rounding;
  Instant now = motion.at(0.0);
  do {
    found = follower.see(now);
    if (found.nearest.colliding || found.nearest.distance <= enough) return true;
    follower.forget_all_but(4);
    follower.take_up(found, now);
    now = follower.advance(now, found.nearest.distance, target, slack);
  } while (now.s < 1.0);
  return false;
}

}  // namespace box_contact::BOX_CONTACT_SET::motion
