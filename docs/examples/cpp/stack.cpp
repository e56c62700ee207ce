// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Three boxes fall on each other and come to rest. It prints:
//
//   box 1: 0.00 mm deep, 0.000 mm/s, net force 88290 N
//   box 2: 0.00 mm deep, 0.000 mm/s, net force 39240 N
//   box 3: 0.00 mm deep, 0.000 mm/s, net force 9810 N
#include <cmath>
#include <cstdio>
#include <vector>

#include "box_contact/force.hpp"

using namespace box_contact;

const double step = 0.001, gravity = 9.81;              // [s], [m/s²]
const std::vector<double> masses{0, 9000, 4000, 1000};  // [kg]
const Size ground_size{20, 20, 1};
const Pose ground{{0, 0, -0.5}, {0, 0, 0, 1}};

int main() {
  // Body 0 is the ground, which no force moves.
  std::vector<Body> bodies{{0, {0, 0, 0}}};
  std::vector<Size> sizes{ground_size, {6, 2.4, 2.6}, {4, 2.4, 2.6}, {2, 2, 2}};  // [m]
  std::vector<Pose> poses{ground, {{0, 0, 1.4}, {0, 0, 0, 1}}, {{0, 0, 4.1}, {0, 0, 0, 1}},
                          {{0, 0, 6.5}, {0, 0, 0, 1}}};
  const std::size_t count = poses.size();
  std::vector<Wrench> weights(count), wrenches(count);
  for (std::size_t i = 1; i < count; ++i) {
    bodies.push_back(Body::of_box(sizes[i], masses[i]));
    weights[i].force[2] = -gravity * masses[i];
  }
  std::vector<Velocity> velocities(count);

  PatchForces forces(bodies);
  std::vector<BodyBox> boxes;
  for (std::size_t i = 0; i < count; ++i)
    boxes.push_back({std::int64_t(i), {{{0, 0, 0}, {0, 0, 0, 1}}, sizes[i]}});
  forces.set_boxes(boxes, true);  // the forces find the pairs at each step
  for (int tick = 0; tick < 3000; ++tick) forces.advance(step, poses, velocities, weights);
  forces.wrenches(step, poses, velocities, weights, wrenches);

  double top = 0;  // of what is below [m]
  for (std::size_t i = 1; i < count; ++i) {
    const double bottom = poses[i].position[2] - sizes[i].extent[2] / 2;
    std::printf("box %zu: %.2f mm deep, %.3f mm/s, net force %.0f N\n", i, 1e3 * (top - bottom),
                std::fabs(1e3 * velocities[i].linear[2]), wrenches[i].force[2]);
    top = poses[i].position[2] + sizes[i].extent[2] / 2;
  }
}
