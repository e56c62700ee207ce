// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* The C interface as a C program uses it: contacts, rows, distances, motion,
 * refusals. The exit status is 1 if a check
 * failed. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "box_contact/box_contact.h"
#include "box_contact/index.h"

static int failures = 0;

static void check(bool holds, const char* what) {
  if (holds) return;
  ++failures;
  printf("FAILED %s: %s\n", what, bc_error_text());
}

static bc_box cube_at(double height) {
  bc_box box = {{{0.0, 0.0, height}, {0.0, 0.0, 0.0, 1.0}}, {{2.0, 2.0, 2.0}}};
  return box;
}

static void check_contacts(void) {
  bc_box a = cube_at(0.0), b = cube_at(1.5);
  bc_contact contact;
  check(bc_collide(&a, &b, NULL, &contact) == BC_OK, "collide");
  check(contact.colliding && contact.separation == -0.5 && contact.axis == 2, "depth, axis");
  check(contact.normal[2] == 1.0 && fabs(contact.point[2] - 0.75) < 1e-9, "normal, point");
  check(fabs(contact.volume - 2.0) < 1e-9 && fabs(contact.covariance[0][0] - 1.0 / 3.0) < 1e-9,
        "volume, covariance");
  bc_query query = bc_default_query();
  check(query.model == BC_EXACT && query.patch == BC_COVARIANCE, "the default query");
  query.patch = BC_VOLUME;
  check(bc_collide(&a, &b, &query, &contact) == BC_OK, "volume alone");
  check(contact.volume > 1.9 && isnan(contact.covariance[0][0]), "no covariance");
  query.model = BC_MLP;
  check(bc_collide(&a, &b, &query, &contact) == BC_OK, "mlp");
  check(fabs(contact.point[2] - 0.75) < 1e-2, "its point");

  b = cube_at(3.0);
  query = bc_default_query();
  check(bc_collide(&a, &b, &query, &contact) == BC_OK && !contact.colliding, "apart");
  check(contact.separation == 1.0 && contact.volume == 0.0, "a gap");
  check(isnan(contact.normal[2]) && contact.axis == 2, "apart: an axis, no normal");
  query.margin = 1.0;
  bc_collide(&a, &b, &query, &contact);
  check(contact.normal[2] == 1.0 && isnan(contact.point[2]), "within the margin a normal");
  b = cube_at(3.5);
  bc_collide(&a, &b, &query, &contact);
  check(isnan(contact.normal[2]), "beyond it no normal");
}

static void check_rows(void) {
  bc_size size = cube_at(0.0).size;
  bc_pose poses[3] = {cube_at(0.0).pose, cube_at(1.5).pose, cube_at(3.0).pose};
  int64_t pairs[6] = {0, 1, 1, 2, 2, 0}, refused = 7;
  bc_rows rows = {sizeof rows, 3, 3, poses, poses, &size, &size, 1, 1, pairs};
  bool colliding[3];
  double separation[3], volume[3];
  int32_t axis[3];
  bc_results results = {sizeof results, colliding, separation, NULL, NULL, volume, NULL, axis};
  check(bc_collide_rows(&rows, NULL, &results, 2, &refused) == BC_OK && refused == -1, "rows");
  check(separation[0] == -0.5 && separation[1] == -0.5 && separation[2] == 1.0, "by place");
  check(colliding[1] && !colliding[2] && volume[2] == 0.0, "fields");
  /* Of equal axes the first box's: of the pair that is apart that is B. */
  check(axis[0] == 2 && axis[1] == 2 && axis[2] == 5, "axes");
  poses[2].quaternion[3] = 0.0;
  check(bc_collide_rows(&rows, NULL, &results, 1, &refused) == BC_BAD_ROWS && refused == 1,
        "a bad pose");
  check(strstr(bc_error_text(), "row 1: pose_b quaternion (0, 0, 0, 0) has no length"),
        "its words");
  check(separation[0] == -0.5 && isnan(separation[1]) && !colliding[1], "the others are solved");
  poses[2].quaternion[3] = NAN;
  bc_collide_rows(&rows, NULL, &results, 1, &refused);
  check(strstr(bc_error_text(), "nan) is not finite") != NULL, "not finite");
  pairs[3] = 3;
  check(bc_collide_rows(&rows, NULL, &results, 1, &refused) == BC_BAD_ROWS && refused == 1,
        "a place without a pose");
  check(strstr(bc_error_text(), "but there are 3 poses") != NULL, "its words");
  check(bc_collide_rows(&rows, NULL, &results, 1025, NULL) == BC_BAD_ARGUMENT, "1,025 threads");
  check(strstr(bc_error_text(), "threads must be within 1 and 1024, not 1025") != NULL,
        "its words");
  rows.size_count_b = 2;
  check(bc_collide_rows(&rows, NULL, &results, 1, NULL) == BC_BAD_ARGUMENT, "two sizes");
  rows.size = 0;
  check(bc_collide_rows(&rows, NULL, &results, 1, NULL) == BC_BAD_ABI, "another struct");
  check(bc_collide_rows(NULL, NULL, &results, 1, NULL) == BC_BAD_ARGUMENT, "no rows");
}

static void check_distances(void) {
  bc_box a = cube_at(0.0), b = cube_at(4.0);
  b.pose.position[0] = 5.0;
  bc_nearest nearest = {.size = sizeof nearest};
  check(bc_distance(&a, &b, &nearest) == BC_OK && !nearest.colliding, "distance");
  check(fabs(nearest.distance - sqrt(13.0)) < 1e-15, "edge to edge");
  check(nearest.point_a[0] == 1.0 && nearest.point_a[1] == 0.0 && nearest.point_a[2] == 1.0 &&
            nearest.point_b[0] == 4.0 && nearest.point_b[1] == 0.0 && nearest.point_b[2] == 3.0,
        "the middles of the edges");
  check(fabs(nearest.normal[0] - 3.0 / sqrt(13.0)) < 1e-15, "the way between them");
  b = cube_at(1.5);
  check(bc_distance(&a, &b, &nearest) == BC_OK && nearest.colliding, "in contact");
  check(nearest.distance == 0.0 && nearest.normal[2] == 1.0, "no distance");
  check(fabs(nearest.point_a[2] - 0.75) < 1e-9 && nearest.point_a[2] == nearest.point_b[2],
        "the contact point twice");
  b.size.extent[0] = 0.0;
  check(bc_distance(&a, &b, &nearest) == BC_BAD_SIZE && nearest.colliding, "a flat box");
  b.size.extent[0] = 2.0;
  nearest.size = 8;
  check(bc_distance(&a, &b, &nearest) == BC_BAD_ABI, "another struct");

  bc_pose poses[3] = {cube_at(0.0).pose, cube_at(1.5).pose, cube_at(4.0).pose};
  int64_t pairs[6] = {0, 1, 1, 2, 2, 0}, refused = 7;
  bc_rows rows = {sizeof rows, 3, 3, poses, poses, &a.size, &a.size, 1, 1, pairs};
  bool colliding[3];
  double distance[3], point_a[9];
  bc_nearest_results results = {sizeof results, colliding, distance, NULL, point_a, NULL};
  check(bc_distance_rows(&rows, &results, 2, &refused) == BC_OK && refused == -1, "rows");
  check(distance[0] == 0.0 && distance[1] == 0.5 && distance[2] == 2.0, "by place");
  check(colliding[0] && !colliding[1] && point_a[5] == 2.5 && point_a[8] == 3.0, "fields");
  poses[0].quaternion[3] = 0.0;
  check(bc_distance_rows(&rows, &results, 1, &refused) == BC_BAD_ROWS && refused == 0,
        "a bad pose");
  check(strstr(bc_error_text(), "row 0: pose_a quaternion (0, 0, 0, 0) has no length"),
        "its words");
  check(isnan(distance[0]) && !colliding[0] && distance[1] == 0.5, "the others are solved");
  check(bc_distance_rows(&rows, NULL, 1, NULL) == BC_BAD_ARGUMENT, "no results");
  check(bc_distance_rows(&rows, &results, 0, NULL) == BC_BAD_ARGUMENT, "no threads");
  rows.count = INT64_C(1) << 57;
  check(bc_distance_rows(&rows, &results, 1, NULL) == BC_BAD_ARGUMENT, "more rows than memory");
}

static bc_sweep falling(double from, double to) {
  bc_sweep sweep = {{{0.0, 0.0, from}, {0.0, 0.0, 0.0, 1.0}},
                    {{0.0, 0.0, to}, {0.0, 0.0, 0.0, 1.0}},
                    {{2.0, 2.0, 2.0}},
                    {0.0, 0.0, 0.0}};
  return sweep;
}

static void check_motion(void) {
  bc_sweep a = falling(0.0, 0.0), b = falling(6.0, 1.0);
  bc_approach hit = {.size = sizeof hit}, low = hit;
  check(bc_time_of_impact(&a, &b, 0.0, 1e-9, &hit) == BC_OK, "time of impact");
  check(hit.time <= 0.8 && hit.time > 0.8 - 1e-9 && hit.nearest.distance <= 1e-9, "when");
  check(hit.closing_speed == 5.0 && hit.nearest.normal[2] == 1.0, "how fast, and where");
  check(bc_least_distance(&a, &b, 1e-9, &low) == BC_OK && low.time == hit.time, "they touch");
  b = falling(6.0, 3.0);
  check(bc_time_of_impact(&a, &b, 0.5, 1e-9, &hit) == BC_OK && isnan(hit.time), "never");
  check(isnan(hit.nearest.distance) && !hit.nearest.colliding, "nothing of it");
  check(bc_least_distance(&a, &b, 1e-9, &low) == BC_OK && low.time == 1.0, "at the end");
  check(low.nearest.distance == 1.0, "the least distance");
  check(bc_time_of_impact(&a, &b, -1.0, 1e-9, &hit) == BC_BAD_ARGUMENT, "a clearance");
  check(bc_least_distance(&a, &b, 1e-16, &low) == BC_BAD_ARGUMENT, "a fine tolerance");
  check(strstr(bc_error_text(), "tolerance 1e-16 is below") != NULL, "its words");
  b.end.quaternion[0] = 1.0, b.end.quaternion[3] = 0.0;
  check(bc_time_of_impact(&a, &b, 0.0, 1e-9, &hit) == BC_BAD_POSE, "half a circle");
  check(strstr(bc_error_text(), "from start_b to end_b by 180 degrees has two ways") != NULL,
        "its words");
  b.size.extent[0] = -1.0;
  check(bc_least_distance(&a, &b, 1e-9, &low) == BC_BAD_SIZE && low.time == 1.0, "a bad size");
  low.size = 8;
  check(bc_least_distance(&a, &a, 1e-9, &low) == BC_BAD_ABI, "another struct");

  bc_pose starts[3] = {a.start, falling(6.0, 0.0).start, falling(9.0, 0.0).start};
  bc_pose ends[3] = {a.start, falling(0.0, 1.0).end, falling(0.0, 4.0).end};
  int64_t pairs[4] = {0, 1, 1, 2}, refused = 7;
  bc_sweep_rows rows = {sizeof rows,
                        {sizeof(bc_rows), 2, 3, starts, starts, &a.size, &a.size, 1, 1, pairs},
                        ends, ends, NULL, NULL, NULL};
  double time[2], distance[2];
  bc_approach_results results = {
      sizeof results, time, NULL, {sizeof(bc_nearest_results), NULL, distance, NULL, NULL, NULL}};
  check(bc_time_of_impact_rows(&rows, 0.0, 1e-9, &results, 2, &refused) == BC_OK, "rows");
  check(refused == -1 && time[0] > 0.8 - 1e-9 && isnan(time[1]), "by place");
  double clearances[2] = {0.5, 1.0};
  rows.clearances = clearances;
  check(bc_time_of_impact_rows(&rows, 0.0, 1e-9, &results, 1, &refused) == BC_OK, "clearances");
  check(fabs(time[0] - 0.7) < 1e-9 && time[1] == 0.0, "each its own");
  clearances[1] = -1.0;
  check(bc_time_of_impact_rows(&rows, 0.0, 1e-9, &results, 1, NULL) == BC_BAD_ARGUMENT, "below 0");
  check(strstr(bc_error_text(), "clearances[1] must be within 0 and 1e50 m, not -1") != NULL,
        "its words");
  rows.clearances = NULL;
  check(bc_least_distance_rows(&rows, 1e-9, &results, 1, NULL) == BC_OK, "without `refused`");
  check(time[1] == 0.0 || time[1] == 1.0, "when");
  check(distance[1] == 1.0, "the least distances");
  ends[1].quaternion[3] = NAN;
  check(bc_time_of_impact_rows(&rows, 0.0, 1e-9, &results, 1, &refused) == BC_BAD_ROWS, "a bad pose");
  check(refused == 0 && time[0] == -1.0 && time[1] == -1.0, "no time is that of never");
  check(strstr(bc_error_text(), "row 0: end_b quaternion (0, 0, 0, nan) is not finite") != NULL,
        "its words");
  results.nearest.size = 0;
  check(bc_time_of_impact_rows(&rows, 0.0, 1e-9, &results, 1, NULL) == BC_BAD_ABI, "another struct");
}

/* Cubes of which one is half a metre aside; faces apart; and what is refused. */
static void check_face_patches(void) {
  bc_box a = cube_at(0.0), b = cube_at(1.99);
  b.pose.position[0] = 0.5;
  double up[3] = {0.0, 0.0, 1.0}, long_one[3] = {0.0, 0.0, 2.0};
  bc_polygon patch = {.size = sizeof patch};
  check(bc_face_patch(&a, &b, up, 1e-4, &patch) == BC_OK && patch.count == 4, "a patch");
  check(patch.area == 3.0 && patch.centre[0] == 0.25 && patch.centre[1] == 0.0, "area, centre");
  check(fabs(patch.centre[2] - 0.995) < 1e-15, "midway between both faces");
  for (int k = 0; k < BC_CORNERS_MAX; ++k)
    check((patch.corners[k][0] == -0.5 || patch.corners[k][0] == 1.0) &&
              fabs(patch.corners[k][1]) == 1.0,
          "a corner");
  check(patch.corners[8][0] == patch.corners[0][0], "the first corner again");
  b = cube_at(2.001);
  check(bc_face_patch(&a, &b, up, 1e-4, &patch) == BC_OK && patch.count == 0, "apart");
  check(patch.area == 0.0 && isnan(patch.centre[0]) && isnan(patch.corners[0][2]), "no patch");
  check(bc_face_patch(&a, &b, up, 1e-2, &patch) == BC_OK && patch.area == 4.0, "by a tolerance");
  check(bc_face_patch(&a, &b, long_one, 0.0, &patch) == BC_BAD_ARGUMENT, "a long normal");
  check(strstr(bc_error_text(), "normal (0, 0, 2) must be of length 1") != NULL, "its words");
  check(bc_face_patch(&a, &b, up, NAN, &patch) == BC_BAD_ARGUMENT, "no tolerance");
  check(bc_face_patch(&a, &b, NULL, 0.0, &patch) == BC_BAD_ARGUMENT, "no normal");
  check(patch.area == 4.0, "the patch is as it was");
  b.pose.quaternion[3] = 0.0;
  check(bc_face_patch(&a, &b, up, 0.0, &patch) == BC_BAD_POSE, "a bad pose");
  check(strstr(bc_error_text(), "pose_b quaternion") != NULL, "its words");
  a.size.extent[1] = INFINITY;
  check(bc_face_patch(&a, &a, up, 0.0, &patch) == BC_BAD_SIZE, "a bad size");
  patch.size = 8;
  check(bc_face_patch(&a, &b, up, 0.0, &patch) == BC_BAD_ABI, "another struct");
}

static void check_refusals(void) {
  bc_box a = cube_at(0.0), flat = cube_at(1.0), nowhere = cube_at(NAN);
  bc_contact contact = {0};
  flat.size.extent[1] = 0.0;
  check(bc_collide(&a, &flat, NULL, &contact) == BC_BAD_SIZE, "a flat box");
  check(strstr(bc_error_text(), "size_b (2, 0, 2) is not within"), "its words");
  check(bc_collide(&nowhere, &a, NULL, &contact) == BC_BAD_POSE, "NaN");
  check(!contact.colliding && contact.axis == 0, "the contact is as it was");
  check(bc_collide(NULL, &a, NULL, &contact) == BC_BAD_ARGUMENT, "no box");
  bc_query query = bc_default_query();
  query.margin = -1.0;
  check(bc_collide(&a, &a, &query, &contact) == BC_BAD_ARGUMENT, "a margin below zero");
  query.size = 0;
  check(bc_collide(&a, &a, &query, &contact) == BC_BAD_ABI, "another query");
}

enum { floors = 100 };

/* A tower of cubes, from the ground up. */
static void build_tower(bc_size* sizes, bc_pose* poses) {
  for (int k = 0; k < floors; ++k) {
    bc_box box = cube_at(1.9 * k);
    sizes[k] = box.size;
    poses[k] = box.pose;
  }
}

/* Each cube is near the next one, and bc_collide_rows takes the pairs. */
static void check_movers(void) {
  static bc_size sizes[floors];
  static bc_pose poses[floors];
  static bool colliding[floors];
  build_tower(sizes, poses);
  bc_movers* movers;
  bc_near near = {sizeof near, NULL, 0, NULL, 0, 0};
  check(bc_movers_create(sizes, floors, 0.0, NULL, NULL, &movers) == BC_OK, "create movers");
  check(bc_movers_find(movers, poses, INT64_MAX, &near) == BC_OK, "find");
  check(near.count == floors - 1 && near.refused == -1 && near.stale_count == 0, "neighbours");
  for (int64_t k = 0; k < near.count; ++k)
    check(near.pairs[2 * k] == k && near.pairs[2 * k + 1] == k + 1, "a neighbour");
  bc_rows rows = {sizeof rows, near.count, floors, poses, poses, sizes, sizes, floors, floors,
                  near.pairs};
  bc_results results = {sizeof results, colliding, NULL, NULL, NULL, NULL, NULL, NULL};
  check(bc_collide_rows(&rows, NULL, &results, 1, NULL) == BC_OK, "solve what is near");
  for (int64_t k = 0; k < near.count; ++k) check(colliding[k], "a contact");

  poses[7].quaternion[3] = 0.0;
  check(bc_movers_find(movers, poses, INT64_MAX, &near) == BC_BAD_POSE, "a bad pose");
  check(near.refused == 7 && strstr(bc_error_text(), "pose of box 7"), "which box");
  near.size = 1;
  check(bc_movers_find(movers, poses, INT64_MAX, &near) == BC_BAD_ABI, "another header");
  check(bc_movers_find(movers, NULL, 1, NULL) == BC_BAD_ARGUMENT, "no room for an answer");
  bc_movers_destroy(movers);
  sizes[3].extent[0] = 0.0;
  check(bc_movers_create(sizes, floors, 0.0, NULL, NULL, &movers) == BC_BAD_SIZE, "a bad size");
  check(!movers && strstr(bc_error_text(), "sizes[3]"), "whose size");
  bc_movers_destroy(NULL);
}

/* Boxes of one body are no pair; a listed pair has its own sides, and guests meet all. */
static void check_filter(void) {
  static bc_size sizes[floors];
  static bc_pose poses[floors];
  static int32_t bodies[floors];
  build_tower(sizes, poses);
  bc_filter_rows rows = {sizeof rows, floors, NULL, 0, NULL, 0, NULL, bodies, NULL};
  bc_filter* filter;
  bc_movers* movers;
  bc_near near = {sizeof near, NULL, 0, NULL, 0, 0};
  check(bc_filter_create(&rows, &filter) == BC_OK, "a tower that is one body");
  check(bc_movers_create(sizes, floors, 0.0, filter, NULL, &movers) == BC_OK, "movers of it");
  check(bc_movers_find(movers, poses, INT64_MAX, &near) == BC_OK && near.count == 0, "no pair");
  bc_movers_destroy(movers);
  bc_filter_destroy(filter);

  int64_t listed[] = {8, 7}, asked[] = {7, 8, 8, 7, 5, 6, floors, 6, 6, floors + 1};
  uint8_t sides[5], expected[] = {6, 5, 0, 1, 2};
  rows.bodies = NULL, rows.listed = listed, rows.listed_count = 1;
  check(bc_filter_create(&rows, &filter) == BC_OK, "a listed pair alone");
  check(bc_filter_sides(filter, asked, 5, sides) == BC_OK, "sides");
  check(memcmp(sides, expected, sizeof sides) == 0, "listed, unasked, guests");
  check(bc_movers_create(sizes, floors - 1, 0.0, filter, NULL, &movers) == BC_BAD_ARGUMENT,
        "a filter of other boxes");
  bc_filter_destroy(filter);
  listed[1] = floors;
  check(bc_filter_create(&rows, &filter) == BC_BAD_ROWS && !filter, "a box that is not there");
}

/* A standing tower whose lowest cube goes: a cube beside it is near the two that it was near before. */
static void check_index(void) {
  static bc_size sizes[floors];
  static bc_pose poses[floors];
  int64_t kept[floors], pairs[8], found = 0;
  build_tower(sizes, poses);
  for (int k = 0; k < floors; ++k) kept[k] = k + 1;
  bc_box cube = cube_at(1.9 * 50.5);
  bc_index *index, *later;
  check(bc_index_create(sizes, poses, floors, &index) == BC_OK, "an index");
  check(bc_index_near(index, &cube.size, &cube.pose, 1, 0.0, pairs, 4, &found) == BC_OK, "near");
  check(found == 2 && pairs[1] + pairs[3] == 101, "two cubes");
  check(bc_index_near(index, &cube.size, &cube.pose, 1, 50.0, pairs, 4, &found) == BC_OK, "far");
  check(found == 5, "one more than there is room for");
  check(bc_index_change(index, kept, sizes + 1, poses + 1, floors - 1, &later) == BC_OK, "later");
  check(bc_index_near(later, &cube.size, &cube.pose, 1, 0.0, pairs, 4, &found) == BC_OK, "again");
  check(found == 2 && pairs[1] + pairs[3] == 99, "the same cubes by other numbers");
  bc_index_destroy(later);
  kept[0] = floors;
  check(bc_index_change(index, kept, sizes, poses, floors, &later) == BC_BAD_ROWS, "no such box");
  check(bc_index_change(NULL, kept, sizes, poses, floors, &later) == BC_BAD_ARGUMENT, "no former");
  poses[9].position[0] = INFINITY;
  check(bc_index_create(sizes, poses, floors, &later) == BC_BAD_POSE && !later, "a bad pose");
  check(strstr(bc_error_text(), "poses[9]") != NULL, "whose pose");
  bc_index_destroy(index);
}

/* A cube goes over a tower, comes down on it, and beside it: closed forms. */
static void check_path(void) {
  static bc_size sizes[floors];
  static bc_pose poses[floors];
  build_tower(sizes, poses);
  double top = 1.9 * (floors - 1);
  bc_box start = cube_at(top + 5.0);
  bc_pose places[] = {start.pose, start.pose};
  bc_index* tower;
  bc_path* path;
  bc_index_create(sizes, poses, floors, &tower);
  bc_way way = bc_default_way();
  way.times = 2, way.count = 1, way.sizes = &start.size, way.poses = places, way.around = tower;
  bc_path_found found = {sizeof found, NULL, 0, NULL, 0, NULL};
  bool is_done = false;
  places[1].position[2] = top + 3.0;
  check(bc_path_create(&way, &path) == BC_OK, "a path down");
  if (!path) return; /* the environment names no instruction set */
  int steps = 0;
  while (!is_done && bc_path_advance(path, 1, &is_done) == BC_OK) ++steps;
  check(bc_path_read(path, &found) == BC_OK && is_done && steps > 2, "what it found");
  check(found.impact_count == 0 && found.held_count == 0, "no impact");
  check(found.least && found.least->b == floors - 1 && found.least->a == floors, "the nearest");
  check(fabs(found.least->approach.nearest.distance - 1.0) < 2e-6, "how near");
  bc_path_destroy(path);

  places[1].position[2] = top + 1.0; /* it touches at three quarters */
  check(bc_path_create(&way, &path) == BC_OK, "a path farther down");
  check(bc_path_advance(path, INT64_MAX, &is_done) == BC_OK && is_done, "at once");
  check(bc_path_read(path, &found) == BC_OK && found.impact_count == 1, "an impact");
  check(fabs(found.impacts[0].approach.time - 0.75) < 1e-6, "when");
  check(fabs(found.impacts[0].approach.closing_speed - 4.0) < 1e-6, "how fast");
  bc_path_destroy(path);

  way.clearance = 40.0, way.most_pairs = 10;
  check(bc_path_create(&way, &path) == BC_OK, "a path of many pairs");
  check(bc_path_advance(path, INT64_MAX, &is_done) == BC_TOO_MUCH, "too many");
  check(strstr(bc_error_text(), "more than 10 pairs") != NULL, "how many");
  bc_path_destroy(path);
  way.clearance = 4.0, way.most_pairs = INT64_MAX, way.most_looks = 1;
  check(bc_path_create(&way, &path) == BC_OK, "a path of many looks");
  check(bc_path_advance(path, INT64_MAX, &is_done) == BC_TOO_MUCH, "too many looks");
  bc_path_destroy(path);

  places[1].quaternion[0] = 1.0, places[1].quaternion[3] = 0.0;
  check(bc_path_create(&way, &path) == BC_BAD_POSE && !path, "half a turn");
  way.times = 1;
  check(bc_path_create(&way, &path) == BC_BAD_ARGUMENT, "one pose");
  bc_index_destroy(tower);
}

int main(void) {
  check(bc_abi() == BC_ABI, "ABI");
  check_contacts();
  check_rows();
  check_distances();
  check_motion();
  check_face_patches();
  check_movers();
  check_filter();
  check_index();
  check_path();
  check_refusals();
  printf("%s, %s: %d failures\n", bc_version(), bc_instruction_set(), failures);
  return failures != 0;
}
