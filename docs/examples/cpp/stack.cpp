// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Three boxes fall on each other and come to rest. The program finds near pairs and moves the boxes,
// as your simulator does. They stay level, so it leaves out angles. It prints:
//
//   box 0: 0.18 mm deep, 0.000 mm/s, net force 88290 N
//   box 1: 0.17 mm deep, 0.000 mm/s, net force 39240 N
//   box 2: 0.10 mm deep, 0.000 mm/s, net force 9810 N
#include <cmath>
#include <cstdio>
#include <vector>

#include "box_contact/force.hpp"

using namespace box_contact;

const double step = 0.001, gravity = 9.81;                               // [s], [m/s²]
const std::vector<double> masses{9000, 4000, 1000};                      // [kg]
const std::vector<Size> sizes{{6, 2.4, 2.6}, {4, 2.4, 2.6}, {2, 2, 2}};  // [m]
const Size ground_size{20, 20, 1};
const Pose ground{{0, 0, -0.5}, {0, 0, 0, 1}};
const int fixed = -1;  // the ground's number; bodies count from 0

Body solid_box(double mass, const Size& size) {
  const auto [x, y, z] = size.extent;
  return {mass,
          {mass * (y * y + z * z) / 12, mass * (z * z + x * x) / 12, mass * (x * x + y * y) / 12}};
}

double radius(const Size& size) {
  return 0.5 * std::hypot(size.extent[0], size.extent[1], size.extent[2]);
}

double distance(const Pose& a, const Pose& b) {
  return std::hypot(a.position[0] - b.position[0], a.position[1] - b.position[1],
                    a.position[2] - b.position[2]);
}

int main() {
  const int count = int(masses.size());
  std::vector<Body> bodies;
  for (int i = 0; i < count; ++i) bodies.push_back(solid_box(masses[i], sizes[i]));
  SceneLaw law(bodies, {1 / step, 0, step});  // answers at every step, used at once

  std::vector<Pose> poses{
      {{0, 0, 1.4}, {0, 0, 0, 1}}, {{0, 0, 4.1}, {0, 0, 0, 1}}, {{0, 0, 6.5}, {0, 0, 0, 1}}};
  std::vector<Velocity> velocities(count);
  std::vector<Wrench> wrenches(count);
  std::vector<Touch> touches;

  for (int tick = 0; tick < 3000; ++tick) {
    touches.clear();
    for (int a = 0; a < count; ++a) {
      for (int b = fixed; b < a; ++b) {  // the upper box is box A
        const Pose& under = b == fixed ? ground : poses[b];
        const Size& size_under = b == fixed ? ground_size : sizes[b];
        if (distance(poses[a], under) > radius(sizes[a]) + radius(size_under)) continue;
        const std::int64_t pair = (count + 1) * a + b + 1;  // the same number at every step
        touches.push_back({pair, a, b, collide({poses[a], sizes[a]}, {under, size_under})});
      }
    }
    law.hold(touches, poses);
    law.wrenches(poses, velocities, wrenches);
    for (int i = 0; i < count; ++i) {
      velocities[i].linear[2] += (wrenches[i].force[2] / masses[i] - gravity) * step;
      poses[i].position[2] += velocities[i].linear[2] * step;
    }
  }

  double top = 0;  // of what is below [m]
  for (int i = 0; i < count; ++i) {
    const double bottom = poses[i].position[2] - sizes[i].extent[2] / 2;
    std::printf("box %d: %.2f mm deep, %.3f mm/s, net force %.0f N\n", i, 1e3 * (top - bottom),
                std::fabs(1e3 * velocities[i].linear[2]), wrenches[i].force[2]);
    top = poses[i].position[2] + sizes[i].extent[2] / 2;
  }
}
