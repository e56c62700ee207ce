// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* The C interface of libbox_contact: whether two boxes touch, where, and along which direction;
 * how far they are apart, and between which points; where two of their faces meet; or when they come
 * near each other on their ways.
 *
 *   bc_box a = {{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}, {{1.0, 1.0, 1.0}}};
 *   bc_box b = {{{0.0, 0.0, 0.99}, {0.0, 0.0, 0.0, 1.0}}, {{1.0, 1.0, 1.0}}};
 *   bc_contact contact;
 *   if (bc_collide(&a, &b, NULL, &contact) != BC_OK) puts(bc_error_text());
 *
 * Units are SI, frames are right-handed. A pose places a box's centre and axes in a frame common to
 * both boxes. Answers are in the same frame.
 *
 * Functions return BC_OK or what is wrong; `bc_error_text` says it in words. No function throws or
 * keeps anything, and none allocates memory on the way to an answer by one thread. A program needs no
 * compiler flag.
 */
#ifndef BOX_CONTACT_H
#define BOX_CONTACT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define BC_API
#else
#define BC_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Raised by a change that a compiled program cannot follow. `bc_abi` is that of the library. */
#define BC_ABI 6

typedef enum bc_status {
  BC_OK = 0,
  BC_BAD_ARGUMENT = 1, /* a null pointer, a count of no array, an unknown model or patch */
  BC_BAD_SIZE = 2,     /* extents outside 1e-50 to 1e50 m */
  BC_BAD_POSE = 3,     /* numbers that are not finite, or a quaternion without a length */
  BC_BAD_ROWS = 4,     /* some rows of a batch are refused: bad poses, sizes or places */
  BC_NO_MEMORY = 5,
  BC_BAD_ENVIRONMENT = 6, /* BOX_CONTACT_INSTRUCTION_SET names none that this machine has */
  BC_BAD_ABI = 7,         /* the program was compiled for another version of this header */
  BC_TOO_MUCH = 8         /* more than the program allows: see bc_way */
} bc_status;

typedef enum bc_model {
  BC_EXACT = 0, /* the exact moments of the overlap */
  BC_MLP = 1    /* the moments by a multilayer perceptron, with an error */
} bc_model;

/* What is computed of the overlap, beside its centroid. */
typedef enum bc_patch {
  BC_NO_PATCH = 0,
  BC_VOLUME = 1,
  BC_COVARIANCE = 2 /* and the volume */
} bc_patch;

typedef struct bc_size {
  double extent[3]; /* full extents along the box's own axes [m] */
} bc_size;

typedef struct bc_pose {
  double position[3];   /* of the box's centre [m] */
  double quaternion[4]; /* x y z w, of any length */
} bc_pose;

typedef struct bc_box {
  bc_pose pose;
  bc_size size;
} bc_box;

/* What is asked of boxes. Start from `bc_default_query`. */
typedef struct bc_query {
  size_t size; /* sizeof(bc_query) */
  bc_model model;
  bc_patch patch;
  double margin; /* [m]; normals are given up to this separation */
} bc_query;

/* Model `exact`, with volume and covariance, without a margin. */
static inline bc_query bc_default_query(void) {
  bc_query query = {sizeof(bc_query), BC_EXACT, BC_COVARIANCE, 0.0};
  return query;
}

typedef struct bc_contact {
  double separation;       /* [m]; negative: depth along the normal; positive: largest SAT gap */
  double normal[3];        /* unit vector from A to B; NaN where separation exceeds the margin */
  double point[3];         /* centroid of the overlap [m]; NaN without contact. At rest it may be metres from
                              where a load presses: see bc_load.centre */
  double volume;           /* of the overlap [m³]; 0 without contact; NaN where not asked for */
  double covariance[3][3]; /* second central moments by the volume [m²]; NaN likewise, or apart */
  int32_t axis;            /* winning axis: 0–2 faces of A, 3–5 of B, 6 + 3 i + j for a_i × b_j */
  bool colliding;          /* touching counts, to 8 ulp of the largest coordinate or size */
} bc_contact;

/* Rows of pairs. Row i is (poses_a[i], poses_b[i]), or with `pairs` (poses_a[p], poses_b[q]) for
 * p = pairs[2 i], q = pairs[2 i + 1]; `poses_a` and `poses_b` may then be one array. */
typedef struct bc_rows {
  size_t size; /* sizeof(bc_rows) */
  int64_t count;
  int64_t pose_count; /* of either array; without `pairs` it equals `count` */
  const bc_pose* poses_a;
  const bc_pose* poses_b;
  const bc_size* sizes_a; /* one for each pose, or one for all */
  const bc_size* sizes_b;
  int64_t size_count_a; /* pose_count or 1 */
  int64_t size_count_b;
  const int64_t* pairs; /* (count, 2) or NULL */
} bc_rows;

/* Arrays of a row for each pair, or NULL for what is not wanted. What is not wanted is not computed:
 * the second moments without `covariance`, the volume without both. */
typedef struct bc_results {
  size_t size; /* sizeof(bc_results) */
  bool* colliding;
  double* separation;
  double* normal; /* (count, 3) */
  double* point;  /* (count, 3) */
  double* volume;
  double* covariance; /* (count, 3, 3) */
  int32_t* axis;
} bc_results;

BC_API int bc_abi(void);
BC_API const char* bc_version(void);

/* The instruction set of this process: "baseline", "avx2" or "avx512"; NULL where the environment
 * variable BOX_CONTACT_INSTRUCTION_SET asks for one that there is not. */
BC_API const char* bc_instruction_set(void);

/* Why the last call of this thread did not return BC_OK. Valid until the thread's next one. */
BC_API const char* bc_error_text(void);

/* Solve one pair. `query` NULL: bc_default_query(). On failure *contact is as it was. */
BC_API bc_status bc_collide(const bc_box* a, const bc_box* b, const bc_query* query,
                            bc_contact* contact);

/* Solve many pairs, by 1 to 1,024 threads: bit for bit the answers of single calls, for any number of
 * threads. The arrays of `results` say what is computed, not `query->patch`. Each refused row gets
 * `colliding` false and `separation` NaN, and the rest of it has no meaning; all other rows are
 * solved, and *refused is the first refused row, or −1. `refused` may be NULL. */
BC_API bc_status bc_collide_rows(const bc_rows* rows, const bc_query* query,
                                 const bc_results* results, int threads, int64_t* refused);

/* How far two boxes are apart, and between which points. Where the nearest points of a box fill a
 * set, the point is its centroid. Both points tend to the contact point as the boxes come together.
 *
 * `normal` is the gradient of the distance by B's position, and −normal by A's. By a turn of B about
 * its centre the gradient is (point_b − centre of B) × normal; by a turn of A about its centre it is
 * −(point_a − centre of A) × normal. */
typedef struct bc_nearest {
  size_t size;       /* sizeof(bc_nearest) */
  double distance;   /* [m]; 0 in contact; never below the separation */
  double normal[3];  /* unit vector from point_a to point_b; in contact that of the contact */
  double point_a[3]; /* on box A [m]; in contact the contact point */
  double point_b[3]; /* on box B [m]; likewise */
  bool colliding;    /* as of bc_collide */
} bc_nearest;

/* Arrays of a row for each pair, or NULL for what is not wanted. */
typedef struct bc_nearest_results {
  size_t size; /* sizeof(bc_nearest_results) */
  bool* colliding;
  double* distance;
  double* normal;  /* (count, 3) */
  double* point_a; /* (count, 3) */
  double* point_b; /* (count, 3) */
} bc_nearest_results;

/* Find the distance of one pair. The contact of boxes that touch is that of model `exact`. On
 * failure *nearest is as it was. */
BC_API bc_status bc_distance(const bc_box* a, const bc_box* b, bc_nearest* nearest);

/* Find the distances of many pairs, as bc_collide_rows finds their contacts. Each refused row gets
 * `colliding` false and `distance` NaN. */
BC_API bc_status bc_distance_rows(const bc_rows* rows, const bc_nearest_results* results,
                                  int threads, int64_t* refused);

/* A box goes from one pose to another while s goes from 0 to 1. Its centre of turning goes on a line,
 * and its axes turn the shortest way, at constant rate. */
typedef struct bc_sweep {
  bc_pose start, end; /* at s = 0 and at s = 1 */
  bc_size size;
  double centre[3]; /* of turning, in the box's own frame [m]. Zeros: the box's centre. For a box of a
                       body: the origin of the body's frame */
} bc_sweep;

/* How near two boxes come, and when. */
typedef struct bc_approach {
  size_t size;          /* sizeof(bc_approach) */
  double time;          /* s from 0 to 1; NaN: never, and all other numbers are NaN */
  double closing_speed; /* minus the rate of the distance by s at that time [m] */
  bc_nearest nearest;   /* at that time */
} bc_approach;

/* Find the first time at which two boxes are as near as the clearance [m]. Before it the distance is
 * above the clearance, by proof; at it, it is at most clearance + tolerance. Boxes that are so near at
 * the start have time 0.
 *
 * The least tolerance [m] is 1.42e-14 · S. S is the largest distance of a centre from the origin or from
 * the other box's, plus twice the half diagonals and centres of turning of both. A smaller one is refused
 * with the number that is accepted. Turns by 180 degrees are refused: they have two ways. On failure
 * *approach is as it was. */
BC_API bc_status bc_time_of_impact(const bc_sweep* a, const bc_sweep* b, double clearance,
                                   double tolerance, bc_approach* approach);

/* Find the least distance on the way, to the tolerance [m], and when. Boxes that touch on the way have
 * the first time, as bc_time_of_impact without a clearance: the distance is then at most the tolerance. */
BC_API bc_status bc_least_distance(const bc_sweep* a, const bc_sweep* b, double tolerance,
                                   bc_approach* approach);

/* Rows of pairs of boxes on their ways. */
typedef struct bc_sweep_rows {
  size_t size;           /* sizeof(bc_sweep_rows) */
  bc_rows starts;        /* poses at s = 0, sizes, and pairs */
  const bc_pose* ends_a; /* poses at s = 1, as many as at s = 0 */
  const bc_pose* ends_b;
  const double* centres_a; /* of turning, (pose_count, 3), or NULL: the boxes' centres */
  const double* centres_b;
  const double* clearances; /* of each pair [m], or NULL: that of the call */
} bc_sweep_rows;

/* Arrays of a row for each pair, or NULL for what is not wanted. */
typedef struct bc_approach_results {
  size_t size; /* sizeof(bc_approach_results) */
  double* time;
  double* closing_speed;
  bc_nearest_results nearest;
} bc_approach_results;

/* The same of many pairs, by 1 to 1,024 threads: bit for bit the answers of single calls. Each refused
 * row gets time −1, and the rest of it has no meaning; *refused is the first of them, or −1. */
BC_API bc_status bc_time_of_impact_rows(const bc_sweep_rows* rows, double clearance,
                                        double tolerance, const bc_approach_results* results,
                                        int threads, int64_t* refused);
BC_API bc_status bc_least_distance_rows(const bc_sweep_rows* rows, double tolerance,
                                        const bc_approach_results* results, int threads,
                                        int64_t* refused);

/* Most corners of the patch of two faces. */
#define BC_CORNERS_MAX 9

/* The patch of two faces: where they are within a tolerance of each other. A convex polygon midway between
 * both, in the common frame. */
typedef struct bc_polygon {
  size_t size;   /* sizeof(bc_polygon) */
  int32_t count; /* of corners: 3 to 9; 0: the faces are apart, or edges meet */
  double corners[BC_CORNERS_MAX][3]; /* counter-clockwise about the normal [m]; then the first one again;
                                        NaN where there are none */
  double area;                       /* across the normal [m²] */
  double centre[3];                  /* centroid [m]; NaN where there are no corners */
} bc_polygon;

/* Find the patch of two boxes that meet along a unit vector `normal` (3) from A to B, as that of their contact.
 *
 * Of each box it is the face most parallel to the normal. Both are projected along the normal and
 * intersected; what is left is cut where the gap of their planes exceeds `tolerance` [m]. Neither a depth nor
 * a tilt of microns changes it, while the overlap is a wedge. Where edges meet, at more than 0.1 rad from both
 * faces, there is none. On failure *patch is as it was. */
BC_API bc_status bc_face_patch(const bc_box* a, const bc_box* b, const double* normal,
                               double tolerance, bc_polygon* patch);

#ifdef __cplusplus
}
#endif

#endif
