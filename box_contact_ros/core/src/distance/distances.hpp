// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Distances of pairs and of rows: apart by the nearest points, in contact by model `exact`.
#pragma once

#include "../overlap/exact.hpp"
#include "../pair.hpp"
#include "../queue.hpp"
#include "nearest_points.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::NearestResults;

namespace apart {

// What is told of pairs, in the common frame, of the caller's A and B.
template <class T>
struct Nearest {
  T distance;                       // [m]
  Vec<T> normal, point_a, point_b;  // unit vector from A to B; points on the boxes [m]

  BC_INLINE Nearest(const Pair<T>& pair, const NearestPoints<T>& found) : distance(found.distance) {
    Triple<T> first = pair.origin_a + pair.axes_a * found.on_a;
    Triple<T> second = pair.origin_b + pair.axes_b * found.on_b;
    T length = sqrt(dot(found.way, found.way));
    Triple<T> direction = each([&](auto x, auto by) { return x / by; }, found.way, uniform(length));
    Triple<T> from_first = pair.axes_a * direction;
    // Zeros keep no sign on a swap.
    normal = components<T>(select(pair.swapped, Triple<T>{} - from_first, from_first));
    point_a = components<T>(select(pair.swapped, second, first));
    point_b = components<T>(select(pair.swapped, first, second));
  }
};

BC_INLINE void copy(const double* three, double* to) {
  for (int k = 0; k < 3; ++k) to[k] = three[k];
}

}  // namespace apart

// Solve a pair alone. Returns false, and leaves `nearest`, if its poses or sizes are refused.
// `collide`: that of model `exact`.
template <class Collide>
BC_INLINE bool solve_nearest(const detail::PairNumbers& pair, const Collide& collide,
                             bc_nearest& nearest) {
  Query<double> q;
  query(pose_at(pair.pose_a), pose_at(pair.pose_b), size_at(pair.size_a), size_at(pair.size_b), q);
  if (!q.pair.valid) return false;
  nearest.colliding = q.touching;
  if (q.touching) {
    bc_contact contact;
    collide(pair, contact);
    nearest.distance = 0.0;
    apart::copy(contact.normal, nearest.normal);
    apart::copy(contact.point, nearest.point_a);
    apart::copy(contact.point, nearest.point_b);
    return true;
  }
  apart::Nearest<double> found(q.pair, nearest_points(q.axis, 1, q.pair));
  nearest.distance = found.distance;
  apart::copy(found.normal.v, nearest.normal);
  apart::copy(found.point_a.v, nearest.point_a);
  apart::copy(found.point_b.v, nearest.point_b);
  return true;
}

// Rows that touch, until there are enough of them for model `exact`.
template <class T>
class TouchingRows {
 public:
  BC_INLINE TouchingRows(const Rows& rows, long end, const NearestResults& results)
      : rows_(rows), results_(results) {
    rows_.pairs = pairs_;
    if (!rows.pairs) rows_.pose_count = end;
  }
  BC_INLINE void add(const Rows& rows, long row) {
    numbers_[count_] = row;
    for (int side = 0; side < 2; ++side)
      pairs_[2 * count_ + side] = rows.pairs ? rows.pairs[2 * row + side] : row;
    if (++count_ == most) solve();
  }
  BC_INLINE void finish() {
    if (count_) solve();
  }

 private:
  static constexpr int most = 64;

  [[gnu::noinline]] void solve() {
    double normals[3 * most], points[3 * most];
    Results found{nullptr, nullptr, normals, points, nullptr, nullptr, nullptr, 0.0};
    solve_rows<T>(ExactModel(), rows_, 0, count_, found);
    for (int n = 0; n < count_; ++n) {
      auto copy = [&](const double* from, double* to) {
        if (to) apart::copy(from + 3 * n, to + 3 * numbers_[n]);
      };
      copy(normals, results_.normal);
      copy(points, results_.point_a);
      copy(points, results_.point_b);
    }
    count_ = 0;
  }

  Rows rows_;
  const NearestResults& results_;
  int64_t pairs_[2 * most];
  long numbers_[most];
  int count_ = 0;
};

// Solve rows `first` to before `last` side by side, but for what touches. Returns the first that is
// refused, or −1.
template <class T, class Touching>
[[gnu::noinline]] inline long solve_nearest_block(const Rows& rows, long first, long last,
                                                  const NearestResults& results,
                                                  Touching& touching) {
  Query<T> q;
  query_rows(rows, first, last, q);
  long count = last - first;
  unsigned here = ~0U >> (32 - count), valid = bits(q.pair.valid) & here;
  unsigned in_contact = bits(q.touching), apart = valid & ~in_contact;
  apart::Nearest<T> found(q.pair, nearest_points(q.axis, apart, q.pair));
  auto store = [&](double* array, const Vec<T>& x) {
    double* places[width<T>];
    for (int i = 0; i < width<T>; ++i) places[i] = array + 3 * (first + i);
    if (array) store_rows(places, apart, x.v);
  };
  store(results.normal, found.normal);
  store(results.point_a, found.point_a);
  store(results.point_b, found.point_b);
  for (int i = 0; i < count; ++i) {
    bool touches = in_contact >> i & 1;
    if (results.colliding) results.colliding[first + i] = touches;
    if (results.distance)
      results.distance[first + i] = touches            ? 0.0
                                    : (valid >> i & 1) ? lane(found.distance, i)
                                                       : not_a_number;
    if (touches) touching.add(rows, first + i);
  }
  unsigned refused = here & ~valid;
  return refused ? first + __builtin_ctz(refused) : -1;
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `distance` NaN.
template <class T>
[[gnu::noinline]] inline long solve_nearest_rows(const Rows& rows, long begin, long end,
                                                 const NearestResults& results) {
  TouchingRows<T> touching(rows, end, results);
  long refused = -1;
  for (long first = begin, last; first < end; first = last) {
    // A few rows that are left are faster one by one.
    bool one_by_one = width<T> > 2 && end - first <= 2;
    last = min(first + (one_by_one ? 1L : long(width<T>)), end);
    long found = one_by_one ? solve_nearest_block<double>(rows, first, last, results, touching)
                            : solve_nearest_block<T>(rows, first, last, results, touching);
    refused = refused < 0 ? found : refused;
  }
  touching.finish();
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
