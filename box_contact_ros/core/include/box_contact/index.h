/* Copyright 2026 The box_contact_ros maintainers
 * SPDX-License-Identifier: Apache-2.0 */

/* Many boxes: an index of those that never move, and which of the others come near them and each other,
 * at a time or on a path.
 *
 *   bc_index* yard;                              what stands
 *   bc_index_create(sizes, poses, 5000, &yard);
 *   bc_way way = bc_default_way();               a load passes it
 *   way.around = yard, way.times = 100, way.count = 1, way.sizes = &load, way.poses = poses_of_load;
 *   bc_path* path;
 *   bc_path_create(&way, &path);
 *   for (bool done = false; !done;) bc_path_advance(path, 1000, &done);
 *   bc_path_found found = {sizeof(bc_path_found)};
 *   bc_path_read(path, &found);                  found.impacts[0].approach.time
 *   bc_path_destroy(path);
 *   bc_index_destroy(yard);
 *
 * A box is a number: its place in the arrays. Seven NaN instead of a pose: the box is not there. What is
 * made from an index, or from a filter, needs it as long as it lives. An index and a filter do not
 * change, and any threads may use them. One thread at a time may use movers, or a path. */
#ifndef BOX_CONTACT_INDEX_H
#define BOX_CONTACT_INDEX_H

#include "box_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

/* --- Which pairs are asked for ------------------------------------------------------------------- */

typedef struct bc_filter_rows {
  size_t size;   /* sizeof(bc_filter_rows) */
  int64_t count; /* of boxes, below 2^31 */
  const int64_t* listed; /* (listed_count, 2): pairs (a, b) that are asked for, or NULL */
  int64_t listed_count;
  /* The group of each box, and (group_count, group_count) by the groups of two boxes: 0: their pairs are
   * not asked for; 1: the first is box A; 2: the other is; 3: that of lower `order`. NULL: one group, of
   * 3 where nothing is listed, else of 0. */
  const int32_t* groups;
  int32_t group_count;
  const uint8_t* allowed;
  const int32_t* bodies; /* of each box, or NULL; boxes of one body are never a pair. Below 0: of none */
  const int32_t* order;  /* of each box, or NULL: their numbers */
} bc_filter_rows;

typedef struct bc_filter bc_filter;

BC_API bc_status bc_filter_create(const bc_filter_rows* rows, bc_filter** filter);
BC_API void bc_filter_destroy(bc_filter* filter);

/* Say which box of each of `count` pairs is A: 1: the first, 2: the other, 0: the pair is not asked for. 4 is
 * added for listed pairs. Numbers from `rows->count` on are guests. They meet all boxes, and are A; of two guests it is
 * the one of lower number. */
BC_API bc_status bc_filter_sides(const bc_filter* filter, const int64_t* pairs, int64_t count,
                                 uint8_t* sides);

/* --- What never moves ---------------------------------------------------------------------------- */

typedef struct bc_index bc_index;

BC_API bc_status bc_index_create(const bc_size* sizes, const bc_pose* poses, int64_t count,
                                 bc_index** index);
BC_API void bc_index_destroy(bc_index* index);

/* The same of boxes some of which `former` has. kept (count): the number there of each box that has the
 * same size and pose, or −1. Only the others are sorted. */
BC_API bc_status bc_index_change(const bc_index* former, const int64_t* kept, const bc_size* sizes,
                                 const bc_pose* poses, int64_t count, bc_index** index);

/* Find the pairs (box, box of the index) whose bounding boxes are within `margin` [m]. No pair within that
 * distance is left out. *found counts all, up to `capacity` + 1; `pairs` has room for `capacity`. */
BC_API bc_status bc_index_near(const bc_index* index, const bc_size* sizes, const bc_pose* poses,
                               int64_t count, double margin, int64_t* pairs, int64_t capacity,
                               int64_t* found);

/* --- What moves, from tick to tick ---------------------------------------------------------------- */

typedef struct bc_near {
  size_t size;          /* sizeof(bc_near) */
  const int64_t* pairs; /* (count, 2): the listed ones first, then by lower and higher number */
  int64_t count;
  const int64_t* stale; /* (stale_count, 2): listed pairs of which a box has no pose; (box, −1): all
                           other pairs of a box that has none */
  int64_t stale_count;
  int64_t refused; /* a box whose pose is bad, or −1 */
} bc_near;

typedef struct bc_movers bc_movers;

/* Boxes of which those that `index` has stand; without an index all move. `filter` NULL: all pairs. Boxes
 * that are apart by `margin` [m] are near. */
BC_API bc_status bc_movers_create(const bc_size* sizes, int64_t count, double margin,
                                  const bc_filter* filter, const bc_index* index,
                                  bc_movers** movers);
BC_API void bc_movers_destroy(bc_movers* movers);

/* Find the pairs that may touch, for `bc_rows.pairs`: those whose bounding boxes are near. Poses of boxes that
 * stand are not read. The search ends with more than `most` pairs. A call searches for the partners of boxes
 * that have moved by a twentieth of their shortest extent, or more, and knows those of the others. The
 * arrays of *near belong to the movers, and are valid until the next call. */
BC_API bc_status bc_movers_find(bc_movers* movers, const bc_pose* poses, int64_t most,
                                bc_near* near);

/* --- What moves on a path -------------------------------------------------------------------------- */

typedef struct bc_way {
  size_t size;          /* sizeof(bc_way) */
  int64_t times;        /* of the path, 2 or more; it goes from 0 to times − 1 */
  int64_t count;        /* of the boxes that move */
  const bc_size* sizes; /* (count) */
  const bc_pose* poses; /* (times, count); centres of turning go on lines, axes turn the shortest way */
  const double* centres;      /* (count, 3) of turning, in the boxes' frames [m]; NULL: the boxes' own */
  const int64_t* numbers;     /* (count) by which the filter knows them; NULL: as guests */
  const bc_index* around;     /* what stands, or NULL */
  const bc_index* beside;     /* what stands, too, or NULL */
  const bc_filter* filter;    /* NULL: all pairs */
  double clearance;           /* the distance from which on a pair counts [m] */
  double tolerance;           /* of distances [m] */
  int64_t most_pairs;         /* that come within the clearance; more are refused */
  int64_t most_looks;         /* boxes on segments that are near each other; more are refused */
} bc_way;

/* Nothing moves; a tolerance of 1e-6 m, without bounds. */
static inline bc_way bc_default_way(void) {
  bc_way way = {sizeof(bc_way), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0, 1e-6, INT64_MAX, INT64_MAX};
  return way;
}

typedef struct bc_meeting {
  int64_t a, b;         /* boxes by number */
  bc_approach approach; /* when, by the path's time */
} bc_meeting;

typedef struct bc_path_found {
  size_t size;               /* sizeof(bc_path_found) */
  const bc_meeting* impacts; /* the first of each pair within the clearance, in the order of time */
  int64_t impact_count;
  const int64_t* held; /* (held_count, 2) pairs within the clearance at the first pose. Until one is apart
                          by it, at a pose or after a turn by 0.02 rad on the way there, it is an impact to
                          get into each other, or deeper than at first, by 0.1 mm. Deeper than a box is
                          thick, this is not judged */
  int64_t held_count;
  const bc_meeting* least; /* how near a pair comes that is not held, or NULL; where boxes touch, the first
                              of these times */
} bc_path_found;

typedef struct bc_path bc_path;

BC_API bc_status bc_path_create(const bc_way* way, bc_path** path);
BC_API void bc_path_destroy(bc_path* path);

/* Go on by about `work` looks, of some microseconds each. BC_TOO_MUCH: more pairs or looks than the way
 * allows; they are counted before they are looked at. */
BC_API bc_status bc_path_advance(bc_path* path, int64_t work, bool* is_done);

/* Read what a path that is done has found. Its arrays belong to the path. */
BC_API bc_status bc_path_read(const bc_path* path, bc_path_found* found);

#ifdef __cplusplus
}
#endif

#endif
