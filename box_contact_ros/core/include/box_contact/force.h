// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

/* From contacts to forces: a law that holds the patches between questions. For C and C++.
 *
 * A simulator asks for contacts at some rate, and its answers come late. It gives each answer to the
 * law, with the poses for which it was asked. At every physics step the law then says which wrench
 * acts on each body, from the patches that it holds and from where the bodies are by now.
 *
 *   bc_body load = {20000.0, {2.1e4, 2.6e5, 2.6e5}, {0, 0, 0}, false};
 *   bc_loop loop = BC_DEFAULT_LOOP;             200 Hz, 1 ms steps, friction 0.5, gravity 9.81 m/s²
 *   bc_law* law;
 *   bc_law_create(&load, 1, &loop, &law);
 *   bc_touch touch = {7, 0, -1};                pair 7: body 0 is box A, and box B is fixed
 *   bc_collide(&load_box, &stack_box, NULL, &touch.contact);
 *   bc_law_hold(law, &touch, 1, &pose);
 *   bc_law_wrenches(law, &pose, &velocity, &wrench);                       at every physics step
 *
 * The pose of a body is that of its box, as the solver takes it. Velocities and wrenches are in the
 * common frame, at and about the centre of mass. docs/explanation/force.md has the equations. One
 * thread at a time may use a law. `bc_law_hold` and `bc_law_wrenches` allocate no memory once as
 * many pairs have been held.
 */
#ifndef BOX_CONTACT_FORCE_H
#define BOX_CONTACT_FORCE_H

#include "box_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bc_body {
  double mass;       /* [kg]; 0: no force moves it, but it may move by itself */
  double inertia[3]; /* about the box's own axes, through the centre of mass [kg m²] */
  double centre[3];  /* of mass, in the box's own frame [m] */
  bool compound;     /* of several boxes: normals are not checked against its centre of mass */
} bc_body;

typedef struct bc_loop {
  size_t size; /* sizeof(bc_loop) */
  double rate;     /* of questions [1/s] */
  double latency;  /* from a question to the use of its answer [s] */
  double step;     /* physics step [s] */
  double friction; /* Coulomb's μ [1] */
  double gravity;  /* [m/s²] */
} bc_loop;

#define BC_DEFAULT_LOOP {sizeof(bc_loop), 200.0, 0.0, 0.001, 0.5, 9.81}

/* The contact of a pair of bodies, which friction knows again by the number of the pair. */
typedef struct bc_touch {
  int64_t pair;
  int32_t a, b; /* places of the boxes' bodies; −1: a box that is fixed in the common frame */
  bc_contact contact;
  bool stale; /* a box had no recent pose: the patch that is held stays, `contact` is not read */
} bc_touch;

typedef struct bc_velocity {
  double linear[3];  /* of the centre of mass [m/s] */
  double angular[3]; /* [rad/s] */
} bc_velocity;

typedef struct bc_wrench {
  double force[3];  /* [N] */
  double torque[3]; /* about the centre of mass [N m] */
} bc_wrench;

typedef struct bc_law bc_law;

/* Make a law for `count` bodies. `loop` NULL: BC_DEFAULT_LOOP. On failure *law is NULL. */
BC_API bc_status bc_law_create(const bc_body* bodies, int64_t count, const bc_loop* loop,
                               bc_law** law);
/* The same bodies, with the patches that are held and what their friction remembers. */
BC_API bc_status bc_law_copy(const bc_law* law, bc_law** copy);
BC_API void bc_law_destroy(bc_law* law);

/* Forget all patches: bodies were put elsewhere. */
BC_API void bc_law_reset(bc_law* law);

/* Ω [1/s]: no body oscillates faster on its patches. One alone rests at the depth gravity / Ω². */
BC_API double bc_law_frequency(const bc_law* law);

/* Hold these contacts, asked for at `poses` (one for each body), in any order. Pairs that are left
 * out, or apart, are forgotten. BC_BAD_ARGUMENT, and nothing changes, for a contact without volume
 * and covariance, for a pair that comes twice, and for a normal that cannot be meant. */
BC_API bc_status bc_law_hold(bc_law* law, const bc_touch* touches, int64_t count,
                             const bc_pose* poses);

/* The wrench on each body at `poses` and `velocities`. Friction follows the way from one call to the
 * next, so call it once a physics step. */
BC_API bc_status bc_law_wrenches(bc_law* law, const bc_pose* poses, const bc_velocity* velocities,
                                 bc_wrench* wrenches);

#ifdef __cplusplus
}
#endif

#endif
