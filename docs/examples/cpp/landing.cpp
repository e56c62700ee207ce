// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A container lands askew on another, half a metre over its edge, and comes to rest. It prints:
//
//   2 s: 0.000 mm/s
//   4 s: 0.000 mm/s
//   6 s: 0.000 mm/s
//   at 6.10 -1.13 m: 49 kN
//   at 6.10 1.22 m: 53 kN
//   at -5.62 1.22 m: 49 kN
//   at -5.62 -1.13 m: 45 kN
#include <cmath>
#include <cstdio>
#include <vector>

#include "box_contact/force.hpp"

using namespace box_contact;

const double step = 0.001, gravity = 9.81, mass = 20000;  // [s], [m/s²], [kg]
const Size container{12.192, 2.438, 2.591};                // [m]

int main() {
  const std::vector<Body> bodies{Body::of_box(container, mass), Body::of_box(container, 0)};
  const Pose here{{0, 0, 0}, {0, 0, 0, 1}};
  std::vector<Pose> poses{{{0.5, 0.1, container.extent[2] + 0.15}, {0.005, 0.01, 0, 1}}, here};
  std::vector<Velocity> velocities(2);
  velocities[0].linear[2] = -0.3;
  std::vector<Wrench> weights(2);
  weights[0].force[2] = -gravity * mass;

  PatchForces forces(bodies);
  const std::vector<BodyBox> boxes{{0, {here, container}}, {1, {here, container}}};
  forces.set_boxes(boxes, true);  // the forces find the pairs at each step
  double speed = 0;
  for (int tick = 1; tick <= 6000; ++tick) {
    forces.advance(step, poses, velocities, weights);
    speed = std::hypot(velocities[0].linear[0], velocities[0].linear[1], velocities[0].linear[2]);
    if (tick % 2000 == 0) std::printf("%d s: %.3f mm/s\n", tick / 1000, 1e3 * speed);
  }
  // Corners of the patch, in turn around it: ++ +- -- -+ along its axes 1 and 2.
  for (const Load& load : forces.loads())
    for (int corner = 0; corner < 4; ++corner)
      std::printf("at %.2f %.2f m: %.0f kN\n", load.corners[corner][0], load.corners[corner][1],
                  1e-3 * load.corner_loads[corner]);
}
