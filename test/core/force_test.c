// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* A load that is dropped on a stack and pushed aside, by the C interface of forces. Prints where it
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

/* Its inertia keeps the load from turning. */
static const bc_body bodies[2] = {{20000.0, {1e12, 1e12, 1e12}, {0.0, 0.0, 0.0}},
                                  {.mass = 0.0}};
static const bc_size size = {{12.192, 2.438, 2.591}};
static const int64_t pair[2] = {0, 1};

static bc_patches answer_of(const bc_contact* contact) {
  return (bc_patches){.size = sizeof(bc_patches),
                      .count = 1,
                      .pairs = pair,
                      .separation = &contact->separation,
                      .normal = contact->normal,
                      .point = contact->point,
                      .volume = &contact->volume,
                      .covariance = contact->covariance[0],
                      .age = 0.002};
}

static void drop(void) {
  bc_patch_forces *forces, *copy;
  check(bc_patch_forces_create(bodies, 2, NULL, &forces) == BC_OK, "create");
  bc_pose poses[2] = {{{0.3, 0.1, 2.601}, {0.001, 0.002, 0.003, 1.0}},
                      {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}};
  bc_pose asked[2];
  bc_velocity velocities[2];
  bc_wrench outside[2], wrenches[2];
  memset(velocities, 0, sizeof velocities);
  memset(outside, 0, sizeof outside);
  outside[0].force[2] = -9.81 * 20000.0;
  bc_contact contact;
  for (int step = 0; step < 2000; ++step) {
    if (step % 5 == 0) {
      bc_box load = {poses[0], size}, stack = {poses[1], size};
      check(bc_collide(&load, &stack, NULL, &contact) == BC_OK, "collide");
      memcpy(asked, poses, sizeof asked);
    }
    if (step % 5 == 2) {
      bc_patches answer = answer_of(&contact);
      check(bc_patch_forces_hold(forces, &answer, asked) == BC_OK, "hold");
    }
    outside[0].force[0] = step > 1000 ? 40000.0 : 0.0;
    bc_motion motion = {sizeof motion, poses, velocities, wrenches, NULL};
    check(bc_patch_forces_advance(forces, 0.001, poses, velocities, outside, &motion) == BC_OK,
          "advance");
  }
  for (int k = 0; k < 3; ++k) printf("%a ", poses[0].position[k]);
  for (int k = 0; k < 3; ++k) printf("%a ", wrenches[0].force[k]);
  for (int k = 0; k < 3; ++k) printf("%a ", wrenches[0].torque[k]);

  check(bc_patch_forces_copy(forces, &copy) == BC_OK, "copy");
  check(bc_patch_forces_bodies(copy) == 2, "its bodies");
  bc_patch_forces_reset(forces);
  bc_motion pushed = {.size = sizeof pushed, .wrenches = wrenches};
  bc_patch_forces_advance(forces, 0.001, poses, velocities, outside, &pushed);
  check(fabs(wrenches[0].force[2]) < 1.0, "reset");
  bc_patch_forces_advance(copy, 0.001, poses, velocities, outside, &pushed);
  check(wrenches[0].force[2] > 1e5, "the copy");
  bc_load load;
  check(bc_patch_forces_loads(copy, &load, 1) == 1 && load.box_a == 0 && load.box_b == 1, "loads");
  check(fabs(load.pressing - load.friction[2] - wrenches[0].force[2]) < 10.0, "carried");
  check(bc_patch_forces_forget(copy, &pair[1], 1) == BC_OK, "forget");
  check(bc_patch_forces_loads(copy, &load, 1) == 0, "no loads");
  bc_patch_forces_advance(copy, 0.001, poses, velocities, outside, &pushed);
  check(fabs(wrenches[0].force[2]) < 1e3, "forgotten");
  bc_patch_forces_destroy(copy);
}

/* A box that is laid down, unless the options say otherwise. What is forgotten has no loads. */
static void check_rest(void) {
  for (int rest = 0; rest < 2; ++rest) {
    bc_force_options options = BC_DEFAULT_FORCE_OPTIONS;
    options.rest = rest;
    const bc_body both[2] = {{5, {1, 1, 1}, {0}}, {0, {0}, {0}}};
    bc_body_box boxes[2] = {{0, {{{0, 0, 0}, {0, 0, 0, 1}}, {{1, 1, 1}}}},
                            {1, {{{0, 0, 0}, {0, 0, 0, 1}}, {{9, 9, 1}}}}};
    const int64_t places[2] = {0, 1};
    bc_patches asked = {.size = sizeof asked, .count = 1, .pairs = places};
    bc_pose poses[2] = {{{0, 0, 1}, {0, 0, 0, 1}}, {{0, 0, 0}, {0, 0, 0, 1}}};
    bc_velocity velocities[2] = {{{0}, {0}}, {{0}, {0}}};
    bc_wrench outside[2] = {{{0, 0, -49.05}, {0}}, {{0}, {0}}};
    unsigned char awake[2] = {7, 7};
    bc_patch_forces* forces;
    check(bc_patch_forces_create(both, 2, &options, &forces) == BC_OK, "create");
    check(bc_patch_forces_set_boxes(forces, boxes, 2, 0) == BC_OK, "boxes");
    check(bc_patch_forces_hold(forces, &asked, NULL) == BC_OK, "hold");
    bc_motion motion = {sizeof motion, poses, velocities, NULL, awake};
    for (int step = 0; step < 400; ++step)
      check(!bc_patch_forces_advance(forces, 1 / 240.0, poses, velocities, outside, &motion),
            "advance");
    check(awake[0] == !rest && awake[1] == 0, "awake");
    check(bc_patch_forces_advance_changed(forces, 1 / 240.0, poses, velocities, outside, places, -1,
                                          &motion) == BC_BAD_ARGUMENT,
          "a count below 0");
    bc_load load;
    check(bc_patch_forces_loads(forces, &load, 1) == 1, "loads");
    check(fabs(load.pressing - 49.05) < 1e-3, "pressing");
    check(bc_patch_forces_forget(forces, places, 1) == BC_OK, "forget");
    check(bc_patch_forces_loads(forces, &load, 1) == 0, "no loads");
    const double belt[3] = {1, 0, 0};
    double rough = 0.9, bad = -1.0;
    check(bc_patch_forces_set_surface(forces, 2, belt, NULL) == BC_BAD_ARGUMENT, "no box");
    check(bc_patch_forces_set_surface(forces, 0, NULL, &bad) == BC_BAD_ARGUMENT, "no friction");
    check(bc_patch_forces_set_surface(forces, 0, belt, NULL) == BC_OK, "a belt");
    check(bc_patch_forces_set_surface(forces, 0, NULL, &rough) == BC_OK, "its friction");
    check(bc_patch_forces_set_boxes(forces, boxes, 2, 1) == BC_OK, "find pairs");
    check(bc_patch_forces_hold(forces, &asked, NULL) == BC_BAD_ARGUMENT, "pairs are found");
    check(!bc_patch_forces_advance(forces, 1 / 240.0, poses, velocities, outside, &motion) &&
              bc_patch_forces_loads(forces, &load, 1) == 1 && velocities[0].linear[0] < -1e-3,
          "found, on a belt");
    bc_patch_forces_destroy(forces);
  }
}

/* What no body has, by the words of its refusal. */
static void check_bodies(void) {
  static const struct {
    bc_body body;
    const char* words;
  } table[] = {{{1e-300, {1, 1, 1}, {0}}, "mass of body 0 must be 0, or within 1e-50 to 1e50 kg"},
               {{INFINITY, {1, 1, 1}, {0}}, "not inf"},
               {{-1, {1, 1, 1}, {0}}, "not -1"},
               {{1, {1, 1, 100}, {0}}, "inertia of body 0 (1, 1, 100) has a moment"},
               {{1, {1, 0, 1}, {0}}, "not (1, 0, 1)"},
               {{0, {NAN, 0, 0}, {0}}, "not (nan, 0, 0)"},
               {{1, {1, 1, 1}, {0, 2e50, 0}}, "centre[0] has 2e+50"}};
  bc_patch_forces* forces;
  for (size_t k = 0; k < sizeof table / sizeof *table; ++k) {
    check(bc_patch_forces_create(&table[k].body, 1, NULL, &forces) == BC_BAD_ARGUMENT && !forces,
          "no body");
    check(strstr(bc_error_text(), table[k].words) != NULL, table[k].words);
  }
}

/* An answer and a step that change nothing, by the words of their refusals. */
static void check_answers(bc_patch_forces* forces, const bc_pose* poses) {
  bc_contact good, contact;
  memset(&good, 0, sizeof good);
  good.separation = -1.0, good.normal[2] = 1.0, good.volume = 1.0;
  for (int k = 0; k < 3; ++k) good.covariance[k][k] = 0.1;
  bc_patches answer = answer_of(&contact);
  contact = good;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_OK, "a contact");
  contact.normal[2] = 2.0;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_BAD_ARGUMENT, "a normal of 2");
  check(strstr(bc_error_text(), "normal[0] (0, 0, 2) has the length 2, not 1") != NULL,
        "its words");
  contact = good, contact.covariance[1][1] = -0.1;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_BAD_ARGUMENT, "no covariance");
  check(strstr(bc_error_text(), "covariance[0] (0.1, 0, 0; 0, -0.1, 0") != NULL, "its words");
  contact = good, answer.age = 1e60;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_BAD_ARGUMENT, "an age");
  bc_velocity velocities[2];
  memset(velocities, 0, sizeof velocities);
  bc_motion motion = {.size = sizeof motion, .velocities = velocities};
  check(bc_patch_forces_advance(forces, 1.0, poses, velocities, NULL, &motion) == BC_BAD_ARGUMENT,
        "a second");
  check(strstr(bc_error_text(), "below 1 s, not 1") != NULL, "its words");
  velocities[1].angular[2] = 1e60;
  check(bc_patch_forces_advance(forces, 0.1, poses, velocities, NULL, &motion) == BC_BAD_ARGUMENT,
        "too fast");
  check(strstr(bc_error_text(), "velocities[1] has 1e+60") != NULL, "its words");
}

static void check_ahead(void) {
  bc_patch_forces* forces;
  check(bc_patch_forces_create(bodies, 1, NULL, &forces) == BC_OK, "create");
  const bc_pose pose = {{1.0, 2.0, 3.0}, {0.0, 0.0, 0.0, 1.0}};
  bc_pose ahead;
  bc_velocity velocity = {{0.0, 8.0, 0.0}, {0.0, 0.0, 0.0}};
  check(bc_patch_forces_ahead(forces, 0.001, &pose, &velocity, &ahead) == BC_OK &&
            fabs(ahead.position[1] - 2.003) < 1e-15,
        "ahead by 3/8 of a step of four sub-steps");
  check(bc_patch_forces_ahead(forces, 1.0, &pose, &velocity, &ahead) == BC_BAD_ARGUMENT, "1 s");
  velocity.angular[2] = NAN;
  check(bc_patch_forces_ahead(forces, 0.001, &pose, &velocity, &ahead) == BC_BAD_ARGUMENT, "NaN");
  bc_patch_forces_destroy(forces);
}

static void check_refusals(void) {
  bc_patch_forces* forces = (bc_patch_forces*)&bodies;
  bc_force_options options = BC_DEFAULT_FORCE_OPTIONS;
  bc_pose poses[2] = {{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}, {{0.0, 0.0, 9.0}, {0, 0, 0, 1.0}}};
  bc_contact contact;
  memset(&contact, 0, sizeof contact);
  bc_patches answer = answer_of(&contact);
  check(bc_patch_forces_create(NULL, 1, NULL, &forces) == BC_BAD_ARGUMENT && !forces, "no bodies");
  options.friction = NAN;
  check(bc_patch_forces_create(bodies, 2, &options, &forces) == BC_BAD_ARGUMENT, "no friction");
  check(strstr(bc_error_text(), "friction must be within 0 and 1e50, not nan") != NULL,
        "its words");
  options.size = 0;
  check(bc_patch_forces_create(bodies, 2, &options, &forces) == BC_BAD_ABI, "another struct");
  check(bc_patch_forces_create(bodies, 2, NULL, &forces) == BC_OK, "the usual options");
  check(bc_patch_forces_hold(forces, &answer, NULL) == BC_BAD_ARGUMENT, "no poses");
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_OK, "a contact apart");
  check_answers(forces, poses);
  answer.normal = NULL;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_BAD_ARGUMENT, "no normals");
  answer.size = sizeof answer + 1;
  check(bc_patch_forces_hold(forces, &answer, poses) == BC_BAD_ABI, "another answer");
  check(bc_patch_forces_advance(NULL, 0.001, poses, NULL, NULL, NULL) == BC_BAD_ARGUMENT,
        "no forces");
  bc_patch_forces_destroy(forces);
  bc_patch_forces_destroy(NULL);
  bc_patch_forces_reset(NULL);
}

int main(void) {
  drop();
  check_rest();
  check_bodies();
  check_ahead();
  check_refusals();
  printf("%d failures\n", failures);
  return failures != 0;
}
