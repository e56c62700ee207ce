// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of pairs in memory: read side by side, and answered in place.
#pragma once

#include "lanes/row_lanes.hpp"
#include "kernel.hpp"
#include "overlap/moments.hpp"
#include "query.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::Counts;
using detail::Results;
using detail::Rows;

// The numbers of row `row`: places of the poses and sizes of its boxes.
struct RowPlaces {
  const double *pose_a, *pose_b, *size_a, *size_b;

  BC_INLINE RowPlaces(const Rows& rows, long row) {
    long of_a = row, of_b = row;
    if (rows.pairs) of_a = place(rows, 2 * row), of_b = place(rows, 2 * row + 1);
    pose_a = of_a < 0 ? nothing : rows.poses_a + 7 * of_a;
    pose_b = of_b < 0 ? nothing : rows.poses_b + 7 * of_b;
    size_a = of_a < 0 ? nothing : rows.sizes_a + rows.size_step_a * of_a;
    size_b = of_b < 0 ? nothing : rows.sizes_b + rows.size_step_b * of_b;
  }

 private:
  // What is refused as a pose and as a size.
  static constexpr double nothing[7] = {not_a_number, not_a_number, not_a_number, not_a_number,
                                        not_a_number, not_a_number, not_a_number};

  // The row of a box, or −1. Read once: another thread may change pairs that were checked.
  BC_INLINE static long place(const Rows& rows, long number) {
    long found = long(*static_cast<const volatile int64_t*>(rows.pairs + number));
    return found < rows.pose_count ? found : -1;
  }
};

// Find the axes of rows `first` to `last` side by side. Lanes beyond them repeat the last one, and do
// not touch. Not inlined: all models share it.
template <class T>
[[gnu::noinline]] inline void query_rows(const Rows& rows, long first, long last, Query<T>& q) {
  const double *poses_a[width<T>], *poses_b[width<T>], *turns_a[width<T>], *turns_b[width<T>];
  const double *sizes_a[width<T>], *sizes_b[width<T>];
  for (int i = 0; i < width<T>; ++i) {
    RowPlaces at(rows, min(first + i, last - 1));
    poses_a[i] = at.pose_a, poses_b[i] = at.pose_b;
    turns_a[i] = at.pose_a + 3, turns_b[i] = at.pose_b + 3;
    sizes_a[i] = at.size_a, sizes_b[i] = at.size_b;
  }
  Pose<T> pose_a, pose_b;
  Vec<T> size_a, size_b;
  load_rows(poses_a, pose_a.position.v);
  load_rows(turns_a, pose_a.quaternion);
  load_rows(poses_b, pose_b.position.v);
  load_rows(turns_b, pose_b.quaternion);
  load_rows(sizes_a, size_a.v);
  load_rows(sizes_b, size_b.v);
  query(pose_a, pose_b, size_a, size_b, q);
  for (long i = max(0L, last - first); i < width<T>; ++i) set_lane(q.touching, int(i), 0);
}

// Write what a query says of rows `first` to before `last`, and the answers of those that do not
// touch. Returns the first that is refused, or −1.
template <class T>
[[gnu::noinline]] inline long write_query(const Query<T>& q, long first, long last,
                                          const Results& results, Counts& counts) {
  T nothing = splat<T>(not_a_number);
  unsigned touching = bits(q.touching), valid = bits(q.pair.valid), all = ~0U >> (32 - width<T>);
  Mask<T> near = q.touching | ((q.axis.separation <= results.margin) & q.pair.valid);
  Triple<T> none = uniform(nothing);
  Triple<T> from_first = direction_in_common_frame(q.pair, q.axis.normal);
  // Zeros keep no sign on a swap.
  Triple<T> from_a = select(q.pair.swapped, Triple<T>{} - from_first, from_first);
  Vec<T> normal = components<T>(select(near, from_a, none));
  Place<T> axis = select<Place<T>>(q.pair.swapped, swapped_axis(q.axis.axis), q.axis.axis);
  T separation = select<T>(q.pair.valid, q.axis.separation, nothing);
  long count = min(last - first, long(width<T>));
  unsigned here = all >> (width<T> - count);
  if (results.normal) {
    double* places[width<T>];
    for (int i = 0; i < width<T>; ++i) places[i] = results.normal + 3 * (first + i);
    store_rows(places, here, normal.v);
  }
  for (int i = 0; i < count; ++i) {
    long row = first + i;
    bool touches = touching >> i & 1;
    if (results.colliding) results.colliding[row] = touches;
    if (results.separation) results.separation[row] = lane(separation, i);
    if (results.axis) results.axis[row] = int32_t(lane(axis, i));
    counts.contacts += touches;
    if (touches) continue;
    for (int k = 0; results.point && k < 3; ++k) results.point[3 * row + k] = not_a_number;
    if (results.volume) results.volume[row] = 0.0;
    for (int k = 0; results.covariance && k < 9; ++k)
      results.covariance[9 * row + k] = not_a_number;
  }
  unsigned refused = here & ~valid;
  return refused ? first + __builtin_ctz(refused) : -1;
}

// Write the overlaps of the chosen lanes to their rows.
template <class T, class Found>
[[gnu::noinline]] inline void write_overlaps(const Found& found, unsigned chosen,
                                             const long (&rows)[width<T>], const Results& results) {
  const Moments<T>& overlap = all_moments(found);
  double* places[width<T>];
  auto store = [&](double* array, int numbers, int from, const auto& x) {
    for (int i = 0; i < width<T>; ++i) places[i] = array + (numbers * rows[i] + from);
    store_rows(places, chosen, x);
  };
  if (results.point) store(results.point, 3, 0, overlap.centroid.v);
  if (results.volume) {
    T volume[1] = {overlap.volume};
    store(results.volume, 1, 0, volume);
  }
  if (results.covariance) {
    const auto& c = overlap.covariance;
    T first[4] = {c(0, 0), c(0, 1), c(0, 2), c(1, 0)};
    T middle[4] = {c(1, 1), c(1, 2), c(2, 0), c(2, 1)}, last[1] = {c(2, 2)};
    store(results.covariance, 9, 0, first);
    store(results.covariance, 9, 4, middle);
    store(results.covariance, 9, 8, last);
  }
}

// Ask for the memory that rows will be written to, so that it is in the cache when they are solved.
inline void fetch_rows(const Results& results, long first, long last) {
  constexpr long line = 64 / sizeof(double);
  auto fetch = [&](const double* place, long numbers) {
    for (long k = numbers * first; place && k < numbers * last; k += line)
      __builtin_prefetch(place + k, 1);
  };
  fetch(results.normal, 3);
  fetch(results.point, 3);
  fetch(results.covariance, 9);
}

}  // namespace box_contact::BOX_CONTACT_SET
