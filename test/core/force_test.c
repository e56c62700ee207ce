// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* A load that is dropped on a stack and pushed aside, by the C interface of the law. Prints where it
 * ends as hexadecimal floats: test_library.py has the same loop in Python. */
#include "box_contact/force.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;

static void check(bool holds, const char* what) {
  if (holds) return;
  ++failures;
  printf("FAILED %s: %s\n", what, bc_error_text());
}

static const bc_body body = {20000.0, {21000.0, 260000.0, 255000.0}, {0.0, 0.0, 0.0}, false};
static const bc_box stack = {{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}, {{12.192, 2.438, 2.591}}};

static void drop(void) {
  bc_loop loop = BC_DEFAULT_LOOP;
  loop.latency = 0.002;
  bc_law* law;
  check(bc_law_create(&body, 1, &loop, &law) == BC_OK, "create");
  bc_pose load = {{0.3, 0.1, 2.601}, {0.001, 0.002, 0.003, 1.0}}, asked = load;
  bc_velocity velocity = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  bc_wrench wrench;
  bc_touch touch = {.pair = 7, .a = 0, .b = -1}, late = touch;
  for (int step = 0; step < 2000; ++step) {
    if (step % 5 == 0) {
      bc_box box = {load, stack.size};
      bc_collide(&box, &stack, NULL, &late.contact);
      asked = load;
    }
    if (step % 5 == 2) {
      touch = late;
      check(bc_law_hold(law, &touch, 1, &asked) == BC_OK, "hold");
    }
    check(bc_law_wrenches(law, &load, &velocity, &wrench) == BC_OK, "wrench");
    for (int k = 0; k < 3; ++k) {
      double push = k == 0 && step > 1000 ? 40000.0 : 0.0, gravity = k == 2 ? 9.81 : 0.0;
      velocity.linear[k] += ((wrench.force[k] + push) / 20000.0 - gravity) * 0.001;
      load.position[k] += velocity.linear[k] * 0.001;
    }
  }
  for (int k = 0; k < 3; ++k) printf("%a ", load.position[k]);
  for (int k = 0; k < 3; ++k) printf("%a ", wrench.force[k]);
  for (int k = 0; k < 3; ++k) printf("%a ", wrench.torque[k]);
  bc_law* copy;
  check(bc_law_copy(law, &copy) == BC_OK, "copy");
  bc_law_reset(law);
  bc_law_wrenches(law, &load, &velocity, &wrench);
  check(wrench.force[2] == 0.0, "reset");
  bc_law_wrenches(copy, &load, &velocity, &wrench);
  check(wrench.force[2] > 1e5, "the copy");
  bc_law_destroy(copy);
  bc_law_destroy(law);
}

static void check_refusals(void) {
  bc_law* law = (bc_law*)&body;
  bc_loop loop = BC_DEFAULT_LOOP;
  bc_touch touches[2] = {{.pair = 1, .a = 0, .b = -1}, {.pair = 1, .a = 0, .b = -1}};
  check(bc_law_create(NULL, 1, NULL, &law) == BC_BAD_ARGUMENT && !law, "no bodies");
  loop.rate = NAN;
  check(bc_law_create(&body, 1, &loop, &law) == BC_BAD_ARGUMENT, "no rate");
  check(strstr(bc_error_text(), "rate must be positive, not nan") != NULL, "its words");
  loop.size = 0;
  check(bc_law_create(&body, 1, &loop, &law) == BC_BAD_ABI, "another struct");
  check(bc_law_create(&body, 1, NULL, &law) == BC_OK, "the usual loop");
  check(bc_law_frequency(law) == 450.0, "its frequency");
  check(bc_law_hold(law, touches, 1, NULL) == BC_BAD_ARGUMENT, "no poses");
  check(bc_law_hold(law, touches, 2, &stack.pose) == BC_BAD_ARGUMENT, "a pair that comes twice");
  touches[1].a = 1;
  check(bc_law_hold(law, touches + 1, 1, &stack.pose) == BC_BAD_ARGUMENT, "no such body");
  touches[1].a = -1;
  check(bc_law_hold(law, touches + 1, 1, &stack.pose) == BC_BAD_ARGUMENT, "two fixed boxes");
  check(bc_law_wrenches(NULL, &stack.pose, NULL, NULL) == BC_BAD_ARGUMENT, "no law");
  bc_law_destroy(law);
  bc_law_destroy(NULL);
  bc_law_reset(NULL);
}

int main(void) {
  drop();
  check_refusals();
  printf("%d failures\n", failures);
  return failures != 0;
}
