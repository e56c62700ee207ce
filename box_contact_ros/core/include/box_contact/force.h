// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* From contacts to forces, by sequential impulses. For C and C++.
 *
 * At every physics step the forces find which boxes touch, and return where the bodies go, or the
 * wrenches that move them. Or a simulator gives them answers, with the poses for which these were asked.
 *
 *   bc_body bodies[2] = {{20000.0, {2.1e4, 2.6e5, 2.6e5}, {0, 0, 0}}, {0}};   a load, a fixed box
 *   bc_body_box boxes[2] = {{0, load}, {1, floor}};                           in the bodies' frames
 *   bc_patch_forces* forces;
 *   bc_patch_forces_create(bodies, 2, NULL, &forces);
 *   bc_patch_forces_set_boxes(forces, boxes, 2, 1);
 *   bc_motion motion = {sizeof(bc_motion), poses, velocities, NULL, NULL};
 *   bc_patch_forces_advance(forces, 0.001, poses, velocities, weights, &motion);
 *
 * A body is known by its place, 0 to count − 1, and so is a box. Unless bc_patch_forces_set_boxes says
 * otherwise, box k is body k, and the body's frame is that of the box. Velocities are linear, then
 * angular. They and wrenches are in the common frame, at and about the centre of mass.
 * docs/explanation/force.md has the equations. One thread at a time may use an object.
 * `bc_patch_forces_hold` allocates no memory once as many pairs have been held, and
 * `bc_patch_forces_advance` by one thread none at all, unless it finds pairs. The bits are the same on
 * all instruction sets, and for any number of threads.
 */
#ifndef BOX_CONTACT_FORCE_H
#define BOX_CONTACT_FORCE_H

#include "box_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bc_body {
  double mass;       /* 1e-50 to 1e50 kg; 0: no force moves it, but it may move: see advance */
  double inertia[3]; /* about the body's own axes, through the centre of mass: 1e-50 to 1e50 kg m²,
                        or 0 without a mass; none exceeds the sum of the two others */
  double centre[3];  /* of mass, in the body's own frame, up to 1e50 m */
} bc_body;

typedef struct bc_body_box {
  int64_t body;
  bc_box box; /* its pose is in the body's frame */
} bc_body_box;

typedef struct bc_velocity {
  double linear[3];  /* of the centre of mass, up to 1e50 m/s */
  double angular[3]; /* up to 1e50 rad/s */
} bc_velocity;

typedef struct bc_wrench {
  double force[3];  /* up to 1e100 N */
  double torque[3]; /* about the centre of mass, up to 1e100 N m */
} bc_wrench;

/* An answer: rows of pairs, as bc_collide_rows gives them. Rows without volume are passed over. A row
 * whose separation is NaN is stale: the patch that is held for its pair stays. With `separation` NULL,
 * contacts are one's own: model `exact` solves the pairs at the start of each advance. Then friction
 * and surface are read alone. */
typedef struct bc_patches {
  size_t size; /* sizeof(bc_patches) */
  int64_t count;
  const int64_t* pairs;     /* (count, 2): boxes A and B, of two bodies */
  const double* separation; /* [m]; NULL: contacts of one's own */
  const double* normal;     /* (count, 3), from A to B, of length 1 ± 1e-6 */
  const double* point;      /* (count, 3) [m] */
  const double* volume;     /* [m³] */
  const double* covariance; /* (count, 3, 3) [m²]; eigenvalues ≥ −1e-9 of the trace */
  const double* friction;   /* Coulomb's μ [1]; NULL: the lesser of both boxes; it, age and period are 0
                               to 1e50 */
  const double* surface;    /* (count, 3): velocity of B's surface relative to A's, beside that of the
                               bodies, as of a belt [m/s]; NULL: none */
  double age;               /* since the answer was asked for [s] */
  double period;            /* from one question to the next [s]; 0: the least of the last
                               intervals between answers */
} bc_patches;

typedef struct bc_force_options {
  size_t size;     /* sizeof(bc_force_options) */
  int substeps;    /* equal parts of the longest step lately, more if 5 ms are exceeded; 1 to
                      1,000 */
  int threads;     /* 1 to 1,024, and no more than cores; boxes that touch are moved by one */
  double friction; /* Coulomb's μ of boxes without their own [1] */
  double most_depth; /* how deep what rests may be at most [m], where a load is large for the lighter
                        body: with contacts of one's own, its island makes up to 64 times as many
                        sub-steps. bc_load tells where that is not enough */
  int rest; /* 0: nothing is laid down. Else bodies that patches join are, once all were slower than
               0.1 mm/s, by their energy, for half a second, and friction holds them */
} bc_force_options;

#define BC_DEFAULT_FORCE_OPTIONS {sizeof(bc_force_options), 4, 1, 0.5, 1e-3, 1}

/* What an advance leads to: arrays of a row for each body; NULL: not wanted. The poses and velocities
 * may be those that are given. */
typedef struct bc_motion {
  size_t size; /* sizeof(bc_motion) */
  bc_pose* poses;
  bc_velocity* velocities; /* after relaxation */
  bc_wrench* wrenches;     /* of contacts, the mean over the step, with what pushes overlaps out; alone:
                              the caller moves the bodies by them */
  unsigned char* awake;    /* 0: the body was laid down, or has no mass and does not move: its pose is
                              the one that is given, its velocity 0 */
} bc_motion;

/* What the contact of two boxes carried: the mean over the last advance, after relaxation. All forces
 * are those on box B; A gets the opposite. All is zero where nothing presses. With
 * bc_patch_forces_set_boxes, the patches of two bodies share as rubber pads do. All bodies of mass 0 are
 * one support. */
typedef struct bc_load {
  int64_t box_a, box_b;
  double pressing;        /* along the normal, from A to B [N] */
  double friction[3];     /* [N] */
  double torsion;         /* of friction, along the normal [N m] */
  double centre[3];       /* of pressure [m] */
  double corners[4][3];   /* of the patch's rectangle: ++, +-, --, -+ along its axes 1 and 2 [m]. With
                             bc_patch_forces_set_boxes it is around the patch of the faces that are
                             within 0.1 mm; else it has the moments of the overlap, which at rest is a
                             wedge, and may reach beyond the rim */
  double corner_loads[4]; /* the part of `pressing` at each corner; never below 0 [N] */
  int is_too_deep;        /* whether the patch is deeper than `most_depth`, or, with
                             bc_patch_forces_set_boxes, than a tenth of the thinner box */
} bc_load;

typedef struct bc_patch_forces bc_patch_forces;

/* Make the forces of `count` bodies. `options` NULL: BC_DEFAULT_FORCE_OPTIONS. On failure *forces is
 * NULL. */
BC_API bc_status bc_patch_forces_create(const bc_body* bodies, int64_t count,
                                        const bc_force_options* options, bc_patch_forces** forces);
BC_API bc_status bc_patch_forces_copy(const bc_patch_forces* forces, bc_patch_forces** copy);
BC_API void bc_patch_forces_destroy(bc_patch_forces* forces);
BC_API int64_t bc_patch_forces_bodies(const bc_patch_forces* forces); /* how many there are */

/* Change masses, add bodies at the end, or drop bodies there with their patches. A body that has boxes
 * is not dropped: set the others' boxes first. */
BC_API bc_status bc_patch_forces_set_bodies(bc_patch_forces* forces, const bc_body* bodies,
                                            int64_t count);
/* Say which boxes the bodies have: pairs are then of boxes, and poses of bodies. Patches of boxes that
 * stay with their body stay; pairs of contacts of one's own are forgotten. 0 boxes: box k is body k.
 * With `find_pairs`, each advance finds the pairs of boxes that touch, and solves them by model `exact`:
 * nothing is to be held, and bc_patch_forces_hold is refused. Boxes of one body are never a pair.
 * As sizes are known, boxes that only pass each other by a rim have no patch: those of parallel faces that
 * overlap across the normal by no more than 0.1 mm and what the boxes below have sunk, or a tenth of the thinner
 * box. */
BC_API bc_status bc_patch_forces_set_boxes(bc_patch_forces* forces, const bc_body_box* boxes,
                                           int64_t count, int find_pairs);

/* Set the surface of a box: its velocity (3) beside that of its body, as of a belt, in the common frame [m/s],
 * and its friction, Coulomb's μ; NULL: as before. Both last until they are set again, also under answers that are
 * late. `surface` of an answer is added. A pair has the lesser friction of its boxes, unless an answer or held
 * pairs have one. A box without its own, or with NaN, has that of the options. */
BC_API bc_status bc_patch_forces_set_surface(bc_patch_forces* forces, int64_t box,
                                             const double* velocity, const double* friction);

/* Forget the patches of bodies, which were put elsewhere, or all patches. */
BC_API bc_status bc_patch_forces_forget(bc_patch_forces* forces, const int64_t* bodies,
                                        int64_t count);
BC_API void bc_patch_forces_reset(bc_patch_forces* forces);

/* Take an answer, asked for at `poses` (one for each body; not read for contacts of one's own, which
 * need set_boxes). Pairs that are left out are forgotten. Contacts of boxes that are of one body by now
 * are passed over.
 * BC_BAD_ARGUMENT, and nothing changes, for numbers beyond the limits above, a contact without a patch
 * and a pair that comes twice. */
BC_API bc_status bc_patch_forces_hold(bc_patch_forces* forces, const bc_patches* answer,
                                      const bc_pose* poses);

/* Write the poses at which to take the outside wrenches of the next advance, of `dt` seconds, that depend on
 * poses, as those of ropes and springs: with n sub-steps, `poses` later by (n − 1)/2n · dt. At the poses
 * themselves, springs gain energy. `ahead` is another array than `poses`. */
BC_API bc_status bc_patch_forces_ahead(const bc_patch_forces* forces, double dt, const bc_pose* poses,
                                       const bc_velocity* velocities, bc_pose* ahead);

/* Advance by `dt` seconds: 1e-50 or more, and less than 1. Steps may differ in length. `outside` are
 * the wrenches beside those of contacts, gravity among them, constant over the step; NULL: none.
 * A body of mass 0 goes on by its velocity. One without any goes from where it ended to the pose that is
 * given, which is that of the step's end: so a carrier may be moved by its poses alone. Forget what is
 * put elsewhere.
 * Without poses and velocities in `motion`, the wrenches are taken to move the bodies until the next
 * advance, which then removes the speed of pushing out.
 * With both, bodies at rest are laid down: poses as they were given, velocities 0. They wake by a pose,
 * velocity or wrench that is not equal to the bit, a pair or an answer that is no longer as it was, a
 * body of mass 0 that moves, and what comes to touch them.
 * BC_BAD_ARGUMENT, and nothing changes, for numbers beyond the limits above, and where those of a body
 * would leave the range of float64: the text names it. */
BC_API bc_status bc_patch_forces_advance(bc_patch_forces* forces, double dt, const bc_pose* poses,
                                         const bc_velocity* velocities, const bc_wrench* outside,
                                         const bc_motion* motion);

/* The same, where of the bodies at rest only the `count` in `changed` may have another pose, velocity or
 * outside wrench than at the end of the last advance that was not refused: the others are not compared.
 * Where `motion` has the very arrays of poses and velocities that are given, and no wrenches, rows at
 * rest are not written either: they then take next to no time. */
BC_API bc_status bc_patch_forces_advance_changed(bc_patch_forces* forces, double dt,
                                                 const bc_pose* poses,
                                                 const bc_velocity* velocities,
                                                 const bc_wrench* outside, const int64_t* changed,
                                                 int64_t count, const bc_motion* motion);

/* Write what each pair carried in the last advance, by the lower and the higher box, and return how many
 * there are: none if bodies or boxes were changed, or patches forgotten, since. Nothing is written if
 * `capacity` is less. It allocates no memory once as many were written. */
BC_API int64_t bc_patch_forces_loads(const bc_patch_forces* forces, bc_load* loads, int64_t capacity);

#ifdef __cplusplus
}
#endif

#endif
