// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* The C interface as a C program uses it: contacts, rows, refusals. The exit status is 1 if a check
 * failed.
 *
 * usage: library_test WEIGHTS
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "box_contact/box_contact.h"

static int failures = 0;

static void check(bool holds, const char* what) {
  if (holds) return;
  ++failures;
  printf("FAILED %s: %s\n", what, bc_error_text());
}

static const bc_size cube = {{2.0, 2.0, 2.0}};
static const bc_pose origin = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};

static bc_pose above(double height) {
  bc_pose pose = origin;
  pose.position[2] = height;
  return pose;
}

static void check_contacts(void) {
  bc_solver* solver;
  check(bc_solver_create(&cube, &cube, NULL, &solver) == BC_OK, "create");
  bc_pose b = above(1.5);
  bc_contact contact;
  check(bc_solve(solver, &origin, &b, NULL, NULL, BC_COVARIANCE, &contact) == BC_OK, "solve");
  check(contact.colliding && contact.separation == -0.5 && contact.axis == 2, "depth, axis");
  check(contact.normal[2] == 1.0 && fabs(contact.point[2] - 0.75) < 1e-6, "normal, point");
  check(fabs(contact.volume - 2.0) < 1e-6 && fabs(contact.covariance[0][0] - 1.0 / 3.0) < 1e-6,
        "volume, covariance");
  bc_size small = {{1.0, 1.0, 1.0}};
  check(bc_solve(solver, &origin, &b, &small, &small, BC_VOLUME, &contact) == BC_OK, "other sizes");
  check(!contact.colliding && contact.separation == 0.5 && contact.volume == 0.0, "apart");
  check(isnan(contact.normal[2]) && contact.axis == 2, "apart: an axis, no normal");
  bc_solver_destroy(solver);
  bc_solver_destroy(NULL);

  bc_options options = BC_DEFAULT_OPTIONS;
  options.margin = 1.0;
  check(bc_solver_create(&cube, &cube, &options, &solver) == BC_OK, "create with a margin");
  b = above(3.0);
  check(bc_solve(solver, &origin, &b, NULL, NULL, BC_NO_PATCH, &contact) == BC_OK, "within it");
  check(!contact.colliding && contact.normal[2] == 1.0 && isnan(contact.point[2]), "a normal");
  b = above(3.5);
  bc_solve(solver, &origin, &b, NULL, NULL, BC_NO_PATCH, &contact);
  check(isnan(contact.normal[2]), "beyond it no normal");
  bc_solver_destroy(solver);
}

static void check_rows(void) {
  bc_solver* solver;
  bc_solver_create(&cube, &cube, NULL, &solver);
  bc_pose poses[3] = {origin, above(1.5), above(3.0)};
  int64_t pairs[6] = {0, 1, 1, 2, 2, 0}, refused = 7;
  bc_rows rows = {sizeof rows, 3, poses, poses, NULL, NULL, pairs, 3};
  bool colliding[3];
  double separation[3], volume[3];
  int32_t axis[3];
  bc_results results = {sizeof results, colliding, separation, NULL, NULL, volume, NULL, axis};
  check(bc_solve_rows(solver, &rows, &results, 2, &refused) == BC_OK && refused == -1, "rows");
  check(separation[0] == -0.5 && separation[1] == -0.5 && separation[2] == 1.0, "by place");
  check(colliding[1] && !colliding[2] && volume[2] == 0.0, "fields");
  /* Of equal axes the first box's: of the pair that is apart that is B. */
  check(axis[0] == 2 && axis[1] == 2 && axis[2] == 5, "axes");
  poses[2].quaternion[3] = 0.0;
  check(bc_solve_rows(solver, &rows, &results, 1, &refused) == BC_BAD_ROWS && refused == 1,
        "a bad pose");
  check(strstr(bc_error_text(), "row 1: pose_b quaternion (0, 0, 0, 0) has no length"),
        "its words");
  check(separation[0] == -0.5 && isnan(separation[1]) && !colliding[1], "the others are solved");
  poses[2].quaternion[3] = NAN;
  bc_solve_rows(solver, &rows, &results, 1, &refused);
  check(strstr(bc_error_text(), "nan) is not finite") != NULL, "not finite");
  pairs[3] = 3;
  check(bc_solve_rows(solver, &rows, &results, 1, &refused) == BC_BAD_ROWS && refused == 1,
        "a place without a pose");
  check(strstr(bc_error_text(), "but there are 3 poses") != NULL, "its words");
  rows.size = 0;
  check(bc_solve_rows(solver, &rows, &results, 1, NULL) == BC_BAD_ABI, "another struct");
  check(bc_solve_rows(solver, NULL, &results, 1, NULL) == BC_BAD_ARGUMENT, "no rows");
  bc_solver_destroy(solver);
}

static void check_refusals(const char* weights) {
  bc_solver* solver = (bc_solver*)&cube;
  bc_size flat = {{1.0, 0.0, 1.0}};
  check(bc_solver_create(&cube, &flat, NULL, &solver) == BC_BAD_SIZE && !solver, "a flat box");
  check(strstr(bc_error_text(), "size_b (1, 0, 1) is not within"), "its words");
  check(bc_solver_create(NULL, &cube, NULL, &solver) == BC_BAD_ARGUMENT, "no size");
  bc_options options = BC_DEFAULT_OPTIONS;
  check(options.model == BC_MLP && options.weights == NULL, "the default: mlp, as shipped");
  options.weights = "/no/such/file";
  check(bc_solver_create(&cube, &cube, &options, &solver) == BC_BAD_WEIGHTS, "no file");
  options.weights = weights;
  check(bc_solver_create(&cube, &cube, &options, &solver) == BC_OK, "weights");
  bc_pose b = above(1.9), nowhere = above(NAN);
  bc_contact contact = {0};
  check(bc_solve(solver, &nowhere, &b, NULL, NULL, BC_VOLUME, &contact) == BC_BAD_POSE, "NaN");
  check(!contact.colliding && contact.axis == 0, "the contact is as it was");
  check(bc_solve(solver, &origin, &b, NULL, NULL, BC_VOLUME, &contact) == BC_OK, "mlp");
  check(fabs(contact.point[2] - 0.95) < 1e-6 && bc_solver_counts(solver).exact == 0, "its point");
  check(bc_solve(NULL, &origin, &b, NULL, NULL, BC_VOLUME, &contact) == BC_BAD_ARGUMENT, "nobody");
  bc_solver_destroy(solver);
}

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  check(bc_abi() == BC_ABI, "ABI");
  check_contacts();
  check_rows();
  check_refusals(argv[1]);
  printf("%s, %s: %d failures\n", bc_version(), bc_instruction_set(), failures);
  return failures != 0;
}
