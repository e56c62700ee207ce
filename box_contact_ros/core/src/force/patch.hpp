// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What is known of a pair of boxes that touch: the patch of an answer, the impulses that it gave last, and
// what it carried.
#pragma once

#include <cstdint>
#include <utility>

#include "../../include/box_contact/force.h"
#include "rectangle.hpp"
#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// The boxes of a pair, the lower first.
using BoxPair = std::pair<int32_t, int32_t>;

// The patch of a pair, where it was asked for, and the impulses that its rows gave in the last window:
// in the last step, and before it if that was short.
struct Patch {
  int32_t box_a, box_b;  // box_a < box_b
  int32_t a, b;          // their bodies
  Placed asked_a, asked_b;
  Vec<double> normal, point;
  Rectangle shape;
  double depth;         // the lesser of volume / area and −separation; below 0: apart [m]
  double friction;      // μ [1]
  double stiffness;     // [N/m], up to what step and answers bear; 0: that
  Vec<double> surface;  // velocity of B's surface relative to A's, beside the bodies' own [m/s]
  double late;          // from the question to the answer [s]
  double age;           // since the answer was taken [s]

  double normal_impulse, torsion_impulse;         // N [N s], m [N m s]
  Vec<double> friction_impulse, rocking_impulse;  // f [N s], τ [N m s]
  Vec<double> impulse_arm;                        // from A's centre of mass to where they acted [m]

  BoxPair pair() const { return {box_a, box_b}; }

  // Whether area and depth are numbers: what no limit of an answer alone makes sure of.
  bool has_area() const { return shape.has_area() && std::fabs(depth) <= place_max; }
};

// What a patch carried in the last advance: the sums of its impulses after relaxation.
struct Load {
  int32_t box_a, box_b;
  Vec<double> normal_impulses, friction_impulses;  // N, τ1, τ2 and f1, f2, m / r [N s], [N m s]
  Vec<double> normal, point;
  Rectangle shape;

  // Mean forces over a time [s]. Pressure is bilinear, so that no corner pulls.
  bc_load over(double time) const {
    bc_load load{};
    load.box_a = box_a;
    load.box_b = box_b;
    double pressing = normal_impulses[0];
    if (!(pressing > 0.0)) return load;
    Vec<double> friction =
        (1.0 / time) * (friction_impulses[0] * shape.axis_1 + friction_impulses[1] * shape.axis_2);
    // A force N·n at x·e1 + y·e2 has the moment N·(y·e1 − x·e2).
    double x = -normal_impulses[2] / pressing, y = normal_impulses[1] / pressing;
    Vec<double> centre = point + (x * shape.axis_1 + y * shape.axis_2);
    load.pressing = pressing / time;
    load.torsion = shape.radius * friction_impulses[2] / time;
    for (int i = 0; i < 3; ++i) load.friction[i] = friction[i], load.centre[i] = centre[i];
    constexpr double sides[4][2] = {{1.0, 1.0}, {1.0, -1.0}, {-1.0, -1.0}, {-1.0, 1.0}};
    for (int k = 0; k < 4; ++k) {
      double along_1 = sides[k][0] * shape.half_1, along_2 = sides[k][1] * shape.half_2;
      Vec<double> corner = point + (along_1 * shape.axis_1 + along_2 * shape.axis_2);
      for (int i = 0; i < 3; ++i) load.corners[k][i] = corner[i];
      load.corner_loads[k] = 0.25 * load.pressing * std::max(0.0, 1.0 + x / along_1) *
                             std::max(0.0, 1.0 + y / along_2);
    }
    return load;
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::force
