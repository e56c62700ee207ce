// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From poses to contacts: the stages of a pair, and of rows of pairs.
//
// 1. `prepare`: poses and sizes become offsets and a rotation (poses.hpp).
// 2. `separating_axis`: verdict, separation and normal (separating_axis.hpp), again with 32 digits
//    where rounding could decide (near_parallel_edges.hpp).
// 3. `enforce_minimum_depth`: pairs at exact touch get their least depth (minimum_depth.hpp).
// 4. The overlap, by a model: `ExactModel` here, or `MlpModel` (mlp/mlp_model.hpp).
//
// All stages are templates over the lanes T, so a row of a batch has the bits of a single call.
#pragma once

#include "lanes/row_lanes.hpp"
#include "minimum_depth.hpp"
#include "near_parallel_edges.hpp"
#include "overlap/planes.hpp"
#include "rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::Counts;
using detail::Results;
using detail::Rows;

// One pair: frame of the poses. Without contact, point and covariance are NaN, and the volume is
// zero. The normal is NaN where the separation exceeds the margin.
struct Contact {
  bool colliding;          // separation ≤ 8 ulp of the largest coordinate or size
  double separation;       // [m]; negative: depth along the normal; positive: largest SAT gap
  Vec<double> normal;      // unit vector from A to B
  Vec<double> point;       // centroid of A∩B [m]
  double volume;           // of A∩B [m³]; NaN from a model that gives the point alone
  Mat<double> covariance;  // second central moments of A∩B by its volume [m²]; NaN likewise
  int axis;                // the winning axis: 0–2 faces of A, 3–5 of B, 6 + 3 i + j for a_i × b_j
};

// Pairs whose axis has been found.
template <class T>
struct Query {
  Pair<T> pair;
  SeparatingAxis<T> axis;
  Mask<T> touching;  // valid and in contact
};

template <class T>
BC_INLINE void query(const Pose<T>& a, const Pose<T>& b, const Vec<T>& half_a, const Vec<T>& half_b,
                     Query<T>& q) {
  prepare(a, b, half_a, half_b, q.pair);
  q.axis = separating_axis(q.pair);
  Mask<T> doubtful = q.axis.doubtful & q.pair.valid;
  if (any(doubtful)) {
    for (int i = 0; i < width<T>; ++i) {
      if (!lane(doubtful, i)) continue;
      bool swapped = lane(q.pair.swapped, i) != 0;
      const Pose<T>&first = swapped ? b : a, &second = swapped ? a : b;
      Pose<double> one_a{lane(first.position, i), {}}, one_b{lane(second.position, i), {}};
      for (int k = 0; k < 4; ++k) {
        one_a.quaternion[k] = lane(first.quaternion[k], i);
        one_b.quaternion[k] = lane(second.quaternion[k], i);
      }
      SeparatingAxis<double> one{lane(q.axis.separation, i), lane(q.axis.axis, i),
                                 lane(q.axis.face, i), triple_of_lane<T>(q.axis.normal, i), true};
      refine(lane(q.pair, i), one_a, one_b, one);
      set_lane(q.axis.separation, i, one.separation);
      set_lane(q.axis.axis, i, one.axis);
      set_triple_of_lane<T>(q.axis.normal, i, components<double>(one.normal));
    }
  }
  q.touching = (q.axis.separation <= q.pair.touch) & q.pair.valid;
}

template <class T>
BC_INLINE Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i),
          {lane(q.axis.separation, i), lane(q.axis.axis, i), lane(q.axis.face, i),
           triple_of_lane<T>(q.axis.normal, i), lane(q.axis.doubtful, i) != 0},
          lane(q.touching, i) != 0};
}

// The exact overlap of a single pair that `enforce_minimum_depth` has moved, by clipping; the centroid
// in A's frame.
inline Moments<double> clipped_overlap(Pair<double> pair, int face, bool pressed) {
  if (pressed) enforce_on_further_axes(pair);
  return overlap_by_clipping(pair, face);
}

// The way from A to B, where pairs are pressed in to the minimum depth.
template <class T>
struct Pressed {
  Triple<T> offset_a, offset_b;  // in the boxes' frames [m]
  Triple<T> origin_b;            // B's centre, common frame [m]
  Mask<T> moved;                 // and touching
  Mask<T> too_shallow;           // along another axis: `enforce_on_further_axes` has work to do
};
template <class T>
[[gnu::noinline]] void press(const Query<T>& q, Pressed<T>& pressed) {
  Pair<T> pair = q.pair;
  pressed.moved &= enforce_minimum_depth(pair, q.axis);
  pressed.too_shallow = pressed.moved & has_too_little_depth(pair);
  pressed.offset_a = pair.offset_a;
  pressed.offset_b = pair.offset_b;
  T distance = max(depth_floor * pair.size + q.axis.separation, T{});
  pressed.origin_b = pair.origin_b - distance * direction_in_common_frame(pair, q.axis.normal);
}

// The overlap of a pair whose planes have been found, with its centroid in the common frame.
template <bool two_sided, class T, class Found>
BC_INLINE Mask<T> overlap_of(const Query<T>& q, const Pressed<T>& pressed,
                             const planes::PairOfBoxes<T>& boxes, Found& found) {
  const Pair<T>& pair = q.pair;
  T depth = max(-q.axis.separation, depth_floor * pair.size);
  Mask<T> certain = overlap_by_planes<two_sided>(pair, boxes, depth, found);
  found.centroid =
      components<T>(planes::one_of<T>(boxes.p_is_a, pair.origin_a, pressed.origin_b) +
                    planes::one_of<T>(boxes.p_is_a, pair.axes_a, pair.axes_b) *
                        triple(found.centroid));
  return certain;
}

// What is not certain of a single pair: once more about the centroid that was found, because sums
// about a point far from a thin overlap cancel. Or by clipping.
template <class Found>
[[gnu::noinline]] void solve_uncertain(Query<double> q, const Vec<double>& near, Found& found,
                                       Counts& counts) {
  bool moved = (depth_floor * q.pair.size + q.axis.separation > 0.0) & q.touching;
  Pressed<double> pressed{q.pair.offset_a, q.pair.offset_b, q.pair.origin_b, moved, moved};
  if (moved) press(q, pressed);
  planes::PairOfBoxes<double> boxes(q.pair, q.axis);
  planes::find_planes(q.pair, q.axis, pressed.offset_a, pressed.offset_b, boxes);
  Columns<double> to_p = transpose(boxes.p_is_a ? q.pair.axes_a : q.pair.axes_b);
  Triple<double> origin = boxes.p_is_a ? q.pair.origin_a : pressed.origin_b;
  planes::move_origin(boxes, to_p * (triple(near) - origin));
  if (!pressed.too_shallow && overlap_of<true>(q, pressed, boxes, found)) return;
  ++counts.clipped;
  enforce_minimum_depth(q.pair, q.axis);
  Moments<double> clipped = clipped_overlap(q.pair, int(q.axis.face), moved);
  clipped.centroid = components<double>(point_in_common_frame(q.pair, triple(clipped.centroid)));
  set_lane(found, 0, clipped);
}

// The overlaps of the chosen lanes, whose planes have been found.
template <bool two_sided, class T, class Found>
BC_INLINE void solve_overlaps(const Query<T>& q, const Pressed<T>& pressed,
                              const planes::PairOfBoxes<T>& boxes, unsigned chosen, Found& found,
                              Counts& counts) {
  unsigned certain = bits(overlap_of<two_sided>(q, pressed, boxes, found));
  unsigned uncertain = chosen & (bits(pressed.too_shallow) | ~certain);
  for (; uncertain; uncertain &= uncertain - 1) {
    int i = __builtin_ctz(uncertain);
    LaneOf<Found> one;
    solve_uncertain(lane(q, i), lane(found.centroid, i), one, counts);
    copy_lane(found, i, one);
  }
}
// Not inlined, and with boxes of its own: those of the caller stay in registers.
template <class T, class Found>
[[gnu::noinline]] void solve_two_sided(const Query<T>& q, const Pressed<T>& pressed,
                                       const planes::PairOfBoxes<T>& boxes, Found& found,
                                       Counts& counts) {
  solve_overlaps<true>(q, pressed, boxes, bits(q.touching), found, counts);
}

// The overlaps by planes of the pairs that touch. Of W pairs those that have two planes across an axis
// of a box are left, unless they are most, or `all` are wanted. Returns which are left.
template <class T, class Found>
[[gnu::noinline]] unsigned solve_by_planes(const Query<T>& q, bool all, Found& found,
                                           Counts& counts) {
  const Pair<T>& pair = q.pair;
  Mask<T> moved = (depth_floor * pair.size + q.axis.separation > 0.0) & q.touching;
  Pressed<T> pressed{pair.offset_a, pair.offset_b, pair.origin_b, moved, moved};
  if (any(moved)) press(q, pressed);
  planes::PairOfBoxes<T> boxes(pair, q.axis);
  planes::find_planes(pair, q.axis, pressed.offset_a, pressed.offset_b, boxes);
  unsigned touching = bits(q.touching);
  unsigned two_sided = bits(any_of(boxes.p.both | boxes.q.both)) & touching;
  if (all || 2 * __builtin_popcount(two_sided) > __builtin_popcount(touching)) {
    planes::PairOfBoxes<T> own = boxes;
    solve_two_sided(q, pressed, own, found, counts);
    return 0;
  }
  solve_overlaps<false>(q, pressed, boxes, touching & ~two_sided, found, counts);
  return two_sided;
}

// A model has four members for lanes T:
//
//   Found<T>: what it finds of an overlap: `Moments<T>`, or `PointAndVolume<T>`.
//   group<T>: how many queries it takes at once.
//   Rest: the model to which it leaves pairs, or void.
//   leaves_to_exact: whether those are counted as left to another model.
//
// And `solve(queries, found, left, counts)` fills `found` for the pairs that touch, with the centroid
// in the common frame. It sets the bits in `left` of those that it leaves.

// Pairs that have two planes across an axis of a box.
template <template <class> class FoundOf>
struct TwoSidedModelOf {
  template <class T>
  using Found = FoundOf<T>;
  template <class T>
  static constexpr int group = 1;
  using Rest = void;
  static constexpr bool leaves_to_exact = false;

  template <class T>
  BC_INLINE void solve(const Query<T> (&queries)[1], Found<T> (&found)[1], unsigned (&)[1],
                       Counts& counts) const {
    solve_by_planes(queries[0], true, found[0], counts);
  }
};

// Model `exact`: the moments of A∩B by the planes that meet it, or by clipping where these are not
// certain. `FoundOf`: Moments, or PointAndVolume.
template <template <class> class FoundOf>
struct ExactModelOf {
  template <class T>
  using Found = FoundOf<T>;
  template <class T>
  static constexpr int group = 1;
  using Rest = TwoSidedModelOf<FoundOf>;
  static constexpr bool leaves_to_exact = false;

  // Few pairs of W that have two planes across an axis wait for others of their kind.
  template <class T>
  BC_INLINE void solve(const Query<T> (&queries)[1], Found<T> (&found)[1], unsigned (&left)[1],
                       Counts& counts) const {
    left[0] = solve_by_planes(queries[0], false, found[0], counts);
  }
};

using ExactModel = ExactModelOf<Moments>;
using ExactPointModel = ExactModelOf<PointAndVolume>;

// The exact overlap of a single pair.
inline Moments<double> exact_overlap(const Query<double>& q, Counts& counts) {
  Moments<double> found[1];
  unsigned left[1]{};
  const Query<double> queries[1] = {q};
  ExactModel{}.solve(queries, found, left, counts);
  return found[0];
}

// All moments. What a model does not find is NaN.
template <class T>
BC_INLINE const Moments<T>& all_moments(const Moments<T>& found) {
  return found;
}
template <class T>
BC_INLINE Moments<T> all_moments(const PointAndVolume<T>& found) {
  T unknown = splat<T>(not_a_number);
  return {found.volume, found.centroid, {{unknown, unknown, unknown, unknown, unknown, unknown}}};
}

// The numbers of row `row`: places of the poses and sizes of its boxes.
struct RowPlaces {
  const double *pose_a, *pose_b, *size_a, *size_b;

  BC_INLINE RowPlaces(const Rows& rows, long row) {
    long of_a = row, of_b = row;
    if (rows.pairs) of_a = long(rows.pairs[2 * row]), of_b = long(rows.pairs[2 * row + 1]);
    pose_a = rows.poses_a + 7 * of_a;
    pose_b = rows.poses_b + 7 * of_b;
    size_a = rows.sizes_a + rows.size_step_a * of_a;
    size_b = rows.sizes_b + rows.size_step_b * of_b;
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
  T half = splat<T>(0.5);
  query(pose_a, pose_b, half * size_a, half * size_b, q);
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
  T axis = select<T>(q.pair.swapped, swapped_axis(q.axis.axis), q.axis.axis);
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

// A group of blocks: what a model takes at once.
template <class T, class Model>
struct Group {
  static constexpr int blocks = Model::template group<T>, lanes = blocks * width<T>;
  Query<T> queries[blocks];
  long rows[blocks][width<T>];

  // Solve the lanes that touch, and hand those that the model leaves to `rest`.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    typename Model::template Found<T> found[blocks]{};
    unsigned left[blocks]{};
    model.solve(queries, found, left, counts);
    for (int g = 0; g < blocks; ++g) {
      unsigned touching = bits(queries[g].touching);
      write_overlaps<T>(found[g], touching & ~left[g], rows[g], results);
      for (unsigned lanes_left = touching & left[g]; lanes_left; lanes_left &= lanes_left - 1) {
        int i = __builtin_ctz(lanes_left);
        counts.exact += Model::leaves_to_exact;
        rest.take(queries[g], i, rows[g][i], results, counts);
      }
    }
  }
};

// Rows that wait until they fill a group.
template <class T, class Model>
struct Waiting {
  Group<T, Model> group;
  int count = 0;

  // Put lane i of `q` at place `at`.
  BC_INLINE void put(const Query<T>& q, int i, long row, int at) {
    static_assert(sizeof(Query<T>) % sizeof(T) == 0, "all that a query has are lanes");
    constexpr size_t one = sizeof(Number<T>);
    auto* from = reinterpret_cast<const char*>(&q) + one * i;
    auto* to = reinterpret_cast<char*>(&group.queries[at / width<T>]) + one * (at % width<T>);
    for (size_t k = 0; k < sizeof q; k += sizeof(T)) std::memcpy(to + k, from + k, one);
    group.rows[at / width<T>][at % width<T>] = row;
  }
  // Solve what waits. Idle lanes repeat the first one.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    if (!count) return;
    for (int at = count; at < group.lanes; ++at) {
      put(group.queries[0], 0, 0, at);
      set_lane(group.queries[at / width<T>].touching, at % width<T>, 0);
    }
    group.solve(model, results, counts, rest);
    count = 0;
  }
};

// What becomes of the pairs that a model leaves: nothing, where there are none.
template <class T>
struct NoRest {
  BC_INLINE void take(const Query<T>&, int, long, const Results&, Counts&) {}
  BC_INLINE void finish(const Results&, Counts&) {}
};
template <class T, class Model>
struct WaitingRest;
template <class T, class Model>
using Rest =
    std::conditional_t<std::is_void_v<typename Model::Rest>, NoRest<T>, WaitingRest<T, Model>>;

// They wait for the next model. What it clips counts, unless it is another model than was asked for.
template <class T, class Model>
struct WaitingRest {
  using Next = typename Model::Rest;
  Waiting<T, Next> waiting;
  Rest<T, Next> rest;
  Counts uncounted{};

  BC_INLINE void take(const Query<T>& q, int i, long row, const Results& results, Counts& counts) {
    if constexpr (is_scalar<T>) {
      waiting.group.queries[0] = q;
      waiting.group.rows[0][0] = row;
    } else {
      waiting.put(q, i, row, waiting.count);
    }
    if (++waiting.count == waiting.group.lanes) solve(results, counts);
  }
  BC_INLINE void finish(const Results& results, Counts& counts) {
    if (waiting.count) solve(results, counts);
    rest.finish(results, Model::leaves_to_exact ? uncounted : counts);
  }

 private:
  [[gnu::noinline]] void solve(const Results& results, Counts& counts) {
    waiting.solve(Next{}, results, Model::leaves_to_exact ? uncounted : counts, rest);
  }
};

// One row alone.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results, Counts& counts) {
  Group<double, Model> one;
  query_rows(rows, row, row + 1, one.queries[0]);
  one.rows[0][0] = row;
  if (one.queries[0].touching) {
    Rest<double, Model> rest;
    one.solve(model, results, counts, rest);
    rest.finish(results, counts);
  }
  return write_query(one.queries[0], row, row + 1, results, counts);
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `separation` NaN.
//
// A few rows that are left are solved one by one, which is faster than a group with idle lanes. With
// registers of two a pair alone is slower than a block of two with an idle lane.
template <class T, class Model>
[[gnu::noinline]] inline long solve_rows(const Model& model, const Rows& rows, long begin, long end,
                                         const Results& results, Counts& counts) {
  long refused = -1, first = begin;
  auto note = [&](long row) { refused = refused < 0 ? row : refused; };
  if constexpr (!is_scalar<T>) {
    Group<T, Model> group;
    Waiting<T, Model> waiting;
    Rest<T, Model> rest;
    constexpr int blocks = group.blocks, lanes = group.lanes;
    constexpr long few = width<T> <= 2 ? blocks - 1 : lanes <= 8 ? 2 : lanes / 4;
    for (; end - first > few; first += lanes) {
      long last = min(first + lanes, end);
      fetch_rows(results, first, last);
      int touching = 0;
      for (int g = 0; g < blocks; ++g) {
        long start = first + g * width<T>;
        query_rows(rows, min(start, last - 1), last, group.queries[g]);
        if (start >= last)
          group.queries[g].touching = Mask<T>{};
        else
          note(write_query(group.queries[g], start, last, results, counts));
        for (int i = 0; i < width<T>; ++i) group.rows[g][i] = start + i;
        touching += __builtin_popcount(bits(group.queries[g].touching));
      }
      if (touching == lanes || (touching && first == begin && last == end)) {
        group.solve(model, results, counts, rest);
      } else if (touching) {
        for (int g = 0; g < blocks; ++g)
          for (unsigned left = bits(group.queries[g].touching); left; left &= left - 1) {
            int i = __builtin_ctz(left);
            waiting.put(group.queries[g], i, group.rows[g][i], waiting.count);
            if (++waiting.count == lanes) waiting.solve(model, results, counts, rest);
          }
      }
    }
    waiting.solve(model, results, counts, rest);
    rest.finish(results, counts);
  }
  for (; first < end; ++first) note(solve_row(model, rows, first, results, counts));
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
