// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What every program of this folder does: PROGRAM SCENE SLEEP LIMIT STOP...
//
// SCENE is a file: step [s], sub-steps, friction and gravity [m/s²], then a line for each box: extents
// [m], mass [kg] (0: fixed), position [m], quaternion x y z w. SLEEP is 0 or 1. After each number of
// steps, STOP, it prints the time that the processor took since the last one [s], how many bodies are
// awake, and a line for each box: position, quaternion. It ends once the processor took LIMIT [s].
// rapier_steps.py and mujoco_steps.py do the same.
#ifndef BENCHMARKS_STACK_CALLS_STEPS_HPP
#define BENCHMARKS_STACK_CALLS_STEPS_HPP

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

struct Box {
  double size[3], mass, position[3], quaternion[4];
};

struct Pose {
  double position[3], quaternion[4];
};

struct Scene {
  double step, friction, gravity;
  int substeps;
  bool sleep;
  std::vector<Box> boxes;
};

inline Scene read_scene(const char* name, bool sleep) {
  Scene scene{};
  scene.sleep = sleep;
  std::ifstream file(name);
  file >> scene.step >> scene.substeps >> scene.friction >> scene.gravity;
  for (Box box; file >> box.size[0] >> box.size[1] >> box.size[2] >> box.mass;) {
    for (double& number : box.position) file >> number;
    for (double& number : box.quaternion) file >> number;
    scene.boxes.push_back(box);
  }
  if (scene.boxes.empty()) {
    std::fprintf(stderr, "no scene in %s\n", name);
    std::exit(2);
  }
  return scene;
}

// World has `step()`, `awake()`, which counts bodies, and `pose(k)`. It is made from a Scene.
template <class World>
int run(const char* source, int count, char** arguments) {
  if (count < 5) {
    std::puts(source);
    return 0;
  }
  Scene scene = read_scene(arguments[1], std::atoi(arguments[2]));
  World world(scene);
  const double limit = std::atof(arguments[3]) * CLOCKS_PER_SEC;
  int tick = 0;
  for (int i = 4; i < count; ++i) {
    std::clock_t begin = std::clock();
    for (int stop = std::atoi(arguments[i]); tick < stop; ++tick) {
      if (tick % 64 == 0 && double(std::clock()) > limit) return 0;
      world.step();
    }
    std::printf("%.9g %d\n", double(std::clock() - begin) / CLOCKS_PER_SEC, world.awake());
    for (size_t k = 0; k < scene.boxes.size(); ++k) {
      auto [p, q] = world.pose(k);
      std::printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", p[0], p[1], p[2], q[0], q[1], q[2],
                  q[3]);
    }
    std::fflush(stdout);
  }
  return 0;
}

#endif
