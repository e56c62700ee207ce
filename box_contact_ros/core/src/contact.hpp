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

#include "minimum_depth.hpp"
#include "near_parallel_edges.hpp"
#include "overlap/clipping.hpp"
#include "overlap/face_sums.hpp"
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
BC_INLINE Query<T> query(const Pose<T>& a, const Pose<T>& b, const Vec<T>& half_a,
                         const Vec<T>& half_b) {
  Query<T> q;
  q.pair = prepare(a, b, half_a, half_b);
  q.axis = separating_axis(q.pair);
  Mask<T> doubtful = q.axis.doubtful & q.pair.valid;
  if (any(doubtful)) {
    for (int i = 0; i < width<T>; ++i) {
      if (!lane(doubtful, i)) continue;
      Pose<double> one_a{lane(a.position, i), {}}, one_b{lane(b.position, i), {}};
      for (int k = 0; k < 4; ++k) {
        one_a.quaternion[k] = lane(a.quaternion[k], i);
        one_b.quaternion[k] = lane(b.quaternion[k], i);
      }
      SeparatingAxis<double> one{lane(q.axis.separation, i), lane(q.axis.axis, i),
                                 lane(q.axis.face, i), lane(q.axis.normal, i), true};
      refine(lane(q.pair, i), one_a, one_b, one);
      set_lane(q.axis.separation, i, one.separation);
      set_lane(q.axis.axis, i, one.axis);
      set_lane(q.axis.normal, i, one.normal);
    }
  }
  q.touching = (q.axis.separation <= q.pair.touch) & q.pair.valid;
  return q;
}

template <class T>
BC_INLINE Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i),
          {lane(q.axis.separation, i), lane(q.axis.axis, i), lane(q.axis.face, i),
           lane(q.axis.normal, i), lane(q.axis.doubtful, i) != 0},
          lane(q.touching, i) != 0};
}

// The same pair with the box that comes first in the order of the data as A.
template <class T>
BC_INLINE Pair<T> first_as_a(const Pair<T>& pair) {
  Mask<T> a_first = pair.a_first;
  Pair<T> ordered = pair;
  ordered.half_a = select(a_first, pair.half_a, pair.half_b);
  ordered.half_b = select(a_first, pair.half_b, pair.half_a);
  ordered.offset_a = select(a_first, pair.offset_a, -pair.offset_b);
  ordered.offset_b = select(a_first, pair.offset_b, -pair.offset_a);
  ordered.rotation = select(a_first, pair.rotation, transpose(pair.rotation));
  ordered.axes_a = select(a_first, pair.axes_a, pair.axes_b);
  ordered.axes_b = select(a_first, pair.axes_b, pair.axes_a);
  return ordered;
}

// The exact overlap of a single pair that `enforce_minimum_depth` has moved.
inline Moments<double> clipped_overlap(Pair<double> pair, int face, bool pressed) {
  if (pressed) enforce_on_further_axes(pair);
  return overlap_by_clipping(pair, face);
}

// A model has two members for lanes T:
//
//   Found<T>: what it finds of an overlap. `Moments<T>`, or `Vec<T>` for the centroid alone.
//   group<T>: how many queries it takes at once.
//
// And `solve(queries, found, counts)` fills `found` for the pairs that touch, points in A's frame.

// Model `exact`: the moments of A∩B by face sums, or by clipping where these are not certain.
// `FoundOf`: Moments, or PointAndVolume.
template <template <class> class FoundOf>
struct ExactModelOf {
  template <class T>
  using Found = FoundOf<T>;
  template <class T>
  static constexpr int group = 1;

  template <class T>
  BC_INLINE void solve(const Query<T> (&queries)[1], Found<T> (&found)[1], Counts& counts) const {
    found[0] = solve(queries[0], counts);
  }

  template <class T>
  BC_INLINE Found<T> solve(const Query<T>& q, Counts& counts) const {
    Pair<T> pair = q.pair;
    Mask<T> pressed = enforce_minimum_depth(pair, q.axis) & q.touching;
    Mask<T> fallback = pressed;
    if (any(pressed)) fallback &= has_too_little_depth(pair);
    T depth = max(-q.axis.separation, depth_floor * pair.size);
    CertifiedOverlap<Found<T>, T> overlap = overlap_by_face_sums<Found<T>>(first_as_a(pair), depth);
    Found<T> found = overlap.moments;
    found.centroid =
        select(pair.a_first, found.centroid, pair.offset_a + pair.rotation * found.centroid);
    fallback |= (overlap.certain == 0) & q.touching;
    if (any(fallback)) {
      for (int i = 0; i < width<T>; ++i) {
        if (!lane(fallback, i)) continue;
        ++counts.clipped;
        set_lane(found, i,
                 clipped_overlap(lane(pair, i), int(lane(q.axis.face, i)), lane(pressed, i) != 0));
      }
    }
    return found;
  }
};

using ExactModel = ExactModelOf<Moments>;
using ExactPointModel = ExactModelOf<PointAndVolume>;

// The exact overlap of a single pair, not inlined: fallbacks and stages share one copy.
[[gnu::noinline]] inline Moments<double> exact_overlap(const Query<double>& q, Counts& counts) {
  return ExactModel{}.solve(q, counts);
}

// The one place that decides what a contact says of moments that its model does not give: NaN.
template <class T>
BC_INLINE Moments<T> moments(const Moments<T>& found) {
  return found;
}
template <class T>
BC_INLINE Moments<T> moments(const PointAndVolume<T>& found) {
  T unknown = splat<T>(not_a_number);
  return {found.volume, found.centroid, {{unknown, unknown, unknown, unknown, unknown, unknown}}};
}
template <class T>
BC_INLINE Moments<T> moments(const Vec<T>& centroid) {
  T unknown = splat<T>(not_a_number);
  return {unknown, centroid, {{unknown, unknown, unknown, unknown, unknown, unknown}}};
}

// The answers for pairs, in the frame of the poses.
template <class T>
struct Answer {
  Vec<T> normal;
  Moments<T> overlap;
};

template <class T, class Found>
BC_INLINE Answer<T> answer(const Query<T>& q, const Found& found, double margin) {
  T nothing = splat<T>(not_a_number);
  Vec<T> none{nothing, nothing, nothing};
  Moments<T> overlap = moments(found);
  Mask<T> near = q.touching | ((q.axis.separation <= margin) & q.pair.valid);
  return {select(near, direction_in_common_frame(q.pair, q.axis.normal), none),
          {select<T>(q.touching, overlap.volume, T{}),
           select(q.touching, point_in_common_frame(q.pair, overlap.centroid), none),
           select(q.touching, overlap.covariance,
                  Sym<T>{{nothing, nothing, nothing, nothing, nothing, nothing}})}};
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

// Rows `first` to `last` side by side. Lanes beyond them repeat the last one.
template <class T>
BC_INLINE Query<T> query_rows(const Rows& rows, long first, long last) {
  Pose<T> pose_a, pose_b;
  Vec<T> half_a, half_b;
  if constexpr (is_scalar<T>) {
    RowPlaces at(rows, first);
    for (int k = 0; k < 3; ++k) {
      pose_a.position[k] = at.pose_a[k], pose_b.position[k] = at.pose_b[k];
      half_a[k] = 0.5 * at.size_a[k], half_b[k] = 0.5 * at.size_b[k];
    }
    for (int k = 0; k < 4; ++k) {
      pose_a.quaternion[k] = at.pose_a[3 + k];
      pose_b.quaternion[k] = at.pose_b[3 + k];
    }
  } else {
    alignas(sizeof(T)) double a[7][width<T>], b[7][width<T>], sizes[6][width<T>];
    for (int i = 0; i < width<T>; ++i) {
      RowPlaces at(rows, min(first + i, last - 1));
      for (int k = 0; k < 7; ++k) a[k][i] = at.pose_a[k], b[k][i] = at.pose_b[k];
      for (int k = 0; k < 3; ++k) sizes[k][i] = at.size_a[k], sizes[3 + k][i] = at.size_b[k];
    }
    auto lanes_of = [](const double (&numbers)[width<T>]) {
      T x;
      std::memcpy(&x, numbers, sizeof(T));
      return x;
    };
    for (int k = 0; k < 3; ++k) {
      pose_a.position[k] = lanes_of(a[k]), pose_b.position[k] = lanes_of(b[k]);
      half_a[k] = 0.5 * lanes_of(sizes[k]), half_b[k] = 0.5 * lanes_of(sizes[3 + k]);
    }
    for (int k = 0; k < 4; ++k) {
      pose_a.quaternion[k] = lanes_of(a[3 + k]);
      pose_b.quaternion[k] = lanes_of(b[3 + k]);
    }
  }
  return query(pose_a, pose_b, half_a, half_b);
}

// Write `count` solved rows from `first` on. Returns the first that is refused, or −1.
template <class T, class Found>
BC_INLINE long write_rows(const Query<T>& q, const Found& found, long first, long count,
                          const Results& results, Counts& counts) {
  Answer<T> rows = answer(q, found, results.margin);
  Mat<T> covariance = matrix(rows.overlap.covariance);
  long refused = -1;
  for (int i = 0; i < count && i < width<T>; ++i) {
    long row = first + i;
    counts.contacts += lane(q.touching, i) != 0;
    if (results.colliding) results.colliding[row] = lane(q.touching, i) != 0;
    if (results.separation) results.separation[row] = lane(q.axis.separation, i);
    if (results.axis) results.axis[row] = int32_t(lane(q.axis.axis, i));
    for (int k = 0; results.normal && k < 3; ++k)
      results.normal[3 * row + k] = lane(rows.normal[k], i);
    for (int k = 0; results.point && k < 3; ++k)
      results.point[3 * row + k] = lane(rows.overlap.centroid[k], i);
    if (results.volume) results.volume[row] = lane(rows.overlap.volume, i);
    if (results.covariance)
      for (int k = 0; k < 9; ++k)
        results.covariance[9 * row + k] = lane(covariance[k / 3][k % 3], i);
    if (!lane(q.pair.valid, i)) {
      if (results.separation) results.separation[row] = not_a_number;
      if (refused < 0) refused = row;
    }
  }
  return refused;
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

// Solve rows `first` to `last`, at most one group of blocks. Returns the first row whose poses or
// sizes are refused, or −1.
template <class T, class Model>
BC_INLINE long solve_group(const Model& model, const Rows& rows, long first, long last,
                           const Results& results, Counts& counts) {
  constexpr int group = Model::template group<T>;
  Query<T> queries[group];
  typename Model::template Found<T> found[group]{};
  bool touching = false;
  for (int g = 0; g < group; ++g) {
    long start = first + g * width<T>;
    queries[g] = query_rows<T>(rows, min(start, last - 1), last);
    // Lanes that repeat the last row are not counted.
    for (long i = max(0L, last - start); i < width<T>; ++i)
      set_lane(queries[g].touching, int(i), 0);
    touching |= any(queries[g].touching);
  }
  if constexpr (!is_scalar<T>) fetch_rows(results, first, min(first + group * width<T>, last));
  if (touching) model.solve(queries, found, counts);
  long refused = -1;
  for (int g = 0; g < group; ++g) {
    long start = first + g * width<T>;
    long row = write_rows(queries[g], found[g], start, last - start, results, counts);
    if (refused < 0) refused = row;
  }
  return refused;
}

// One row alone, not inlined into the rows: the registers of the two would mix.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results, Counts& counts) {
  return solve_group<double>(model, rows, row, row + 1, results, counts);
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `separation` NaN.
//
// A few rows that are left are solved one by one, which is faster than a group with idle lanes. With
// registers of two a pair alone is slower than a block of two, of which one lane is idle.
template <class T, class Model>
[[gnu::noinline]] inline long solve_rows(const Model& model, const Rows& rows, long begin, long end,
                                         const Results& results, Counts& counts) {
  constexpr int group = Model::template group<T>;
  constexpr long few = is_scalar<T> ? 0 : width<T> <= 2 ? group - 1 : group;
  long refused = -1, first = begin;
  auto note = [&](long row) { refused = refused < 0 ? row : refused; };
  for (; end - first > few; first += group * width<T>)
    note(solve_group<T>(model, rows, first, end, results, counts));
  for (; first < end; ++first) note(solve_row(model, rows, first, results, counts));
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
