/* Copyright 2026 The box_contact_ros maintainers
 * SPDX-License-Identifier: Apache-2.0 */

/* Which pairs of many boxes may touch, for `bc_rows.pairs`: those whose bounding boxes overlap.
 *
 *   bc_boxes boxes = {sizeof(bc_boxes), 10000, sizes};
 *   bc_broad_phase* broad_phase;
 *   bc_near near = {sizeof(bc_near)};
 *   bc_broad_phase_create(&boxes, &broad_phase);
 *   bc_broad_phase_find(broad_phase, poses, INT64_MAX, &near);     at each tick
 *   bc_rows rows = {sizeof(bc_rows), near.count, 10000, poses, poses, sizes, sizes, 10000, 10000,
 *                   near.pairs};
 *   bc_broad_phase_destroy(broad_phase);
 *
 * No pair that touches is left out. One thread at a time may use a broad phase. A call searches for
 * the partners of boxes that have moved by a twentieth of their shortest extent, or more. It knows
 * those of the other boxes from earlier calls. What is found depends on the poses alone. Memory is
 * taken for boxes and for pairs that are near, and kept. */
#ifndef BOX_CONTACT_BROAD_PHASE_H
#define BOX_CONTACT_BROAD_PHASE_H

#include "box_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bc_boxes {
  size_t size;   /* sizeof(bc_boxes) */
  int64_t count; /* of boxes, below 2^31 */
  const bc_size* sizes;
  const bool* fixed; /* boxes that never move, and never meet each other; NULL: all move */
  double margin;     /* [m]; pairs apart are near up to this separation */
  /* Without `listed` and `groups`, every pair of which one box moves is asked for. */
  const int64_t* listed; /* (listed_count, 2): pairs (a, b) that are asked for, or NULL */
  int64_t listed_count;
  const int32_t* groups; /* the group of each box, or NULL */
  int32_t group_count;
  const uint8_t* allowed; /* (group_count, group_count), by the groups of the box of lower and of
                             that of higher index: 0: their pairs are not asked for; 1: they are,
                             and box A is the lower; 2: box A is the higher */
  const int32_t* bodies; /* the body of each box, or NULL; boxes of one body are never a pair. Below
                             0: the box is a part of no body */
} bc_boxes;

typedef struct bc_near {
  size_t size;          /* sizeof(bc_near) */
  const int64_t* pairs; /* (count, 2): the listed ones first, then by lower and higher index */
  int64_t count;
  const int64_t* stale; /* (stale_count, 2): listed pairs of which a box has no pose; (box, -1): all
                           other pairs of a box that has none */
  int64_t stale_count;
  int64_t refused; /* a box whose pose is bad, or -1 */
} bc_near;

typedef struct bc_broad_phase bc_broad_phase;

BC_API bc_status bc_broad_phase_create(const bc_boxes* boxes, bc_broad_phase** broad_phase);
BC_API void bc_broad_phase_destroy(bc_broad_phase* broad_phase);

/* Give a box that moves another size [m], from the next call on. */
BC_API bc_status bc_broad_phase_resize(bc_broad_phase* broad_phase, int64_t box,
                                       const bc_size* size);

/* Take over what `former` knows of fixed boxes, before the first call: only the others are read and
 * sorted then. kept (count): the index in `former` of each box that has the same size and pose
 * there, or -1. The margins are the same. */
BC_API bc_status bc_broad_phase_take_fixed(bc_broad_phase* broad_phase,
                                           const bc_broad_phase* former, const int64_t* kept);

/* Find the pairs that may touch with the boxes at `poses`. Seven NaN: the box is not there. Poses
 * of fixed boxes are read once. The search ends with more than `most` pairs. The arrays of *near
 * belong to the broad phase, and are valid until its next call. */
BC_API bc_status bc_broad_phase_find(bc_broad_phase* broad_phase, const bc_pose* poses,
                                     int64_t most, bc_near* near);

/* The same, where only the poses of the `count` boxes in `changed` may be others than in the last call.
 * The others are not read. All are after a resize, and after a call that was refused or ended with more
 * than `most` pairs. */
BC_API bc_status bc_broad_phase_find_changed(bc_broad_phase* broad_phase, const bc_pose* poses,
                                             const int64_t* changed, int64_t count, int64_t most,
                                             bc_near* near);

#ifdef __cplusplus
}
#endif

#endif
