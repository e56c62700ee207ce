// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The loop of force_test.c by the C++ interface.
#include "box_contact/force.hpp"

#include <cstdio>

using namespace box_contact;

int main() {
  const Size size{12.192, 2.438, 2.591};
  const Body body{20000.0, {21000.0, 260000.0, 255000.0}};
  Loop loop;
  loop.latency = 0.002;
  HeldPatch law(body, loop);
  const Pose stack{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
  Pose load{{0.3, 0.1, 2.601}, {0.001, 0.002, 0.003, 1.0}}, asked = load;
  Velocity velocity{};
  Wrench wrench{};
  Contact contact{};
  for (int step = 0; step < 2000; ++step) {
    if (step % 5 == 0) {
      contact = collide({load, size}, {stack, size});
      asked = load;
    }
    if (step % 5 == 2) law.hold(contact, asked, 7);
    wrench = law.wrench(load, velocity);
    for (int k = 0; k < 3; ++k) {
      double push = k == 0 && step > 1000 ? 40000.0 : 0.0, gravity = k == 2 ? 9.81 : 0.0;
      velocity.linear[k] += ((wrench.force[k] + push) / 20000.0 - gravity) * 0.001;
      load.position[k] += velocity.linear[k] * 0.001;
    }
  }
  for (double x : load.position) std::printf("%a ", x);
  for (double x : wrench.force) std::printf("%a ", x);
  for (double x : wrench.torque) std::printf("%a ", x);

  int failures = 0;
  HeldPatch copy = law;
  law.reset();
  failures += law.wrench(load, velocity).force[2] != 0.0;
  failures += !(copy.wrench(load, velocity).force[2] > 1e5);
  try {
    copy.hold(collide({stack, size}, {load, size}), load);
    ++failures;
  } catch (const std::invalid_argument&) {
  }
  copy.hold(collide({stack, size}, {load, size}), load, 7, HeldPatch::Load::b);
  const Body bodies[2] = {body, body};
  SceneLaw scene(bodies);
  try {
    scene.wrenches({&load, 1}, {&velocity, 1}, {&wrench, 1});
    ++failures;
  } catch (const std::invalid_argument&) {
  }
  std::printf("%d failures\n", failures);
  return failures;
}
