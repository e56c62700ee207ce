// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of pairs in memory: read side by side, and answered in place.
#pragma once

#include "kernel.hpp"
#include "lanes/row_lanes.hpp"
#include "overlap/moments.hpp"
#include "query.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::Results;
using detail::Rows;

BC_INLINE bool want_overlap(const Results& results) {
  return results.point || results.volume || results.covariance;
}

// Row `row`: the addresses of the poses and sizes of its boxes.
struct RowAddresses {
  const double *pose_a, *pose_b, *size_a, *size_b;

  RowAddresses() = default;
  BC_INLINE RowAddresses(const Rows& rows, long row) {
    long of_a = row, of_b = row;
    if (rows.pairs) of_a = row_of(rows, 2 * row), of_b = row_of(rows, 2 * row + 1);
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
  BC_INLINE static long row_of(const Rows& rows, long number) {
    long found = long(*static_cast<const volatile int64_t*>(rows.pairs + number));
    return found < rows.pose_count ? found : -1;
  }
};

// Find the axes of rows `first` to `last` side by side. Lanes beyond them repeat the last one, and do
// not touch. Not inlined: all models share it.
template <class T>
[[gnu::noinline]] inline void query_rows(const Rows& rows, long first, long last, Query<T>& q) {
  Pose<T> pose_a, pose_b;
  Vec<T> size_a, size_b;
  auto load = [&](auto a, auto b, auto of_a, auto of_b) __attribute__((always_inline)) {
    load_rows(a, pose_a.position.v);
    load_rows([&](int i) { return a(i) + 3; }, pose_a.quaternion);
    load_rows(b, pose_b.position.v);
    load_rows([&](int i) { return b(i) + 3; }, pose_b.quaternion);
    load_rows(of_a, size_a.v);
    load_rows(of_b, size_b.v);
  };
  if (!rows.pairs && last - first == width<T>) {
    // Addresses that the compiler counts, without a list.
    auto every = [&](const double* numbers, long step) {
      return [=, numbers = numbers + step * first](int i) { return numbers + step * i; };
    };
    load(every(rows.poses_a, 7), every(rows.poses_b, 7), every(rows.sizes_a, rows.size_step_a),
         every(rows.sizes_b, rows.size_step_b));
  } else {
    RowAddresses at[width<T>];
    for (int i = 0; i < width<T>; ++i) at[i] = RowAddresses(rows, min(first + i, last - 1));
    load([&](int i) { return at[i].pose_a; }, [&](int i) { return at[i].pose_b; },
         [&](int i) { return at[i].size_a; }, [&](int i) { return at[i].size_b; });
  }
  query(pose_a, pose_b, size_a, size_b, q);
  for (long i = max(0L, last - first); i < width<T>; ++i) set_lane(q.touching, int(i), 0);
}

// Write what a query says of rows `first` to before `last`, and the answers of those that do not
// touch. Returns the first that is refused, or −1.
template <class T>
[[gnu::noinline]] inline long write_query(const Query<T>& q, long first, long last,
                                          const Results& results) {
  T nothing = splat<T>(not_a_number);
  unsigned touching = bits(q.touching), valid = bits(q.pair.valid), all = ~0U >> (32 - width<T>);
  Mask<T> near = q.touching | ((q.axis.separation <= results.margin) & q.pair.valid);
  Triple<T> none = uniform(nothing);
  Triple<T> from_first = q.pair.axes_a * q.axis.normal;
  // Zeros keep no sign on a swap.
  Triple<T> from_a = select(q.pair.swapped, Triple<T>{} - from_first, from_first);
  Vec<T> normal = components<T>(select(near, from_a, none));
  Index<T> axis = select<Index<T>>(q.pair.swapped, swapped_axis(q.axis.axis), q.axis.axis);
  T separation = select<T>(q.pair.valid, q.axis.separation, nothing);
  long count = min(last - first, long(width<T>));
  unsigned here = all >> (width<T> - count);
  if (results.normal) {
    double* addresses[width<T>];
    for (int i = 0; i < width<T>; ++i) addresses[i] = results.normal + 3 * (first + i);
    store_rows(addresses, here, normal.v);
  }
  auto store = [&](auto* array, auto number_of) __attribute__((always_inline)) {
    if (!array) return;
    if (count == width<T>)  // most blocks: a loop that the compiler writes out
      for (int i = 0; i < width<T>; ++i) array[first + i] = number_of(i);
    else
      for (int i = 0; i < count; ++i) array[first + i] = number_of(i);
  };
  store(results.colliding, [&](int i) { return bool(touching >> i & 1); });
  store(results.separation, [&](int i) { return lane(separation, i); });
  store(results.axis, [&](int i) { return int32_t(lane(axis, i)); });
  for (unsigned apart = here & ~touching; apart; apart &= apart - 1) {
    long row = first + __builtin_ctz(apart);
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
  double* addresses[width<T>];
  auto store = [&](double* array, int numbers, int from, const auto& x) {
    for (int i = 0; i < width<T>; ++i) addresses[i] = array + (numbers * rows[i] + from);
    store_rows(addresses, chosen, x);
  };
  if constexpr (Found::has_normal)
    if (results.normal) store(results.normal, 3, 0, found.normal.v);
  if (results.point) store(results.point, 3, 0, found.centroid.v);
  if (results.volume) {
    T volume[1] = {found.volume};
    store(results.volume, 1, 0, volume);
  }
  if (results.covariance) {
    T unknown = splat<T>(not_a_number);
    Sym<T> c{{unknown, unknown, unknown, unknown, unknown, unknown}};
    if constexpr (std::is_same_v<Found, Moments<T>>) c = found.covariance;
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
  auto fetch = [&](const double* array, long numbers) {
    for (long k = numbers * first; array && k < numbers * last; k += line)
      __builtin_prefetch(array + k, 1);
  };
  fetch(results.normal, 3);
  fetch(results.point, 3);
  fetch(results.covariance, 9);
}

}  // namespace box_contact::BOX_CONTACT_SET
