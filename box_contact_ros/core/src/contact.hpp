// From poses to contacts: the stages of a pair, and of rows of pairs.
//
// 1. `prepare`: poses and sizes become offsets and a rotation (poses.hpp).
// 2. `separating_axis`: verdict, separation and normal (separating_axis.hpp), again with 32 digits
//    where rounding could decide (near_parallel_edges.hpp).
// 3. `enforce_minimum_depth`: pairs at exact touch get their least depth (minimum_depth.hpp).
// 4. The overlap, by a model: `ExactModel` here, or `MlpModel` (mlp.hpp).
//
// All stages are templates over the lanes T, so a row of a batch has the bits of a single call.
#pragma once

#include <algorithm>

#include "minimum_depth.hpp"
#include "near_parallel_edges.hpp"
#include "overlap/clipping.hpp"
#include "overlap/face_sums.hpp"

namespace box_contact {

// One pair: frame of the poses. Without contact, normal, point and covariance are NaN, and the
// volume is zero.
struct Contact {
  bool colliding;          // separation ≤ 8 ulp of the largest coordinate or size
  double separation;       // [m]; negative: depth along the normal; positive: largest SAT gap
  Vec<double> normal;      // unit vector from A to B
  Vec<double> point;       // centroid of A∩B [m]
  double volume;           // of A∩B [m³]; NaN from a model that gives the point alone
  Mat<double> covariance;  // second central moments of A∩B by its volume [m²]; NaN likewise
};

// How many contacts took another way than most.
struct Counts {
  long clipped = 0;  // by model `exact`: clipped, because the certificate did not hold
  long exact = 0;    // by model `mlp`: answered by `exact`: outside the trained range, or a box

  Counts& operator+=(const Counts& other) {
    clipped += other.clipped;
    exact += other.exact;
    return *this;
  }
};

// Pairs whose axis has been found.
template <class T>
struct Query {
  Pair<T> pair;
  SeparatingAxis<T> axis;
  Mask<T> touching;  // valid and in contact
};

template <class T>
[[gnu::always_inline]] inline Query<T> query(const Pose<T>& a, const Pose<T>& b,
                                             const Vec<T>& half_a, const Vec<T>& half_b) {
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
[[gnu::always_inline]] inline Query<double> lane(const Query<T>& q, int i) {
  return {lane(q.pair, i),
          {lane(q.axis.separation, i), lane(q.axis.axis, i), lane(q.axis.face, i),
           lane(q.axis.normal, i), lane(q.axis.doubtful, i) != 0},
          lane(q.touching, i) != 0};
}

// The same pair with the box that comes first in the order of the data as A.
template <class T>
[[gnu::always_inline]] inline Pair<T> first_as_a(const Pair<T>& pair) {
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
struct ExactModel {
  template <class T>
  using Found = Moments<T>;
  template <class T>
  static constexpr int group = 1;

  template <class T>
  [[gnu::always_inline]] void solve(const Query<T> (&queries)[1], Moments<T> (&found)[1],
                                    Counts& counts) const {
    found[0] = solve(queries[0], counts);
  }

  template <class T>
  [[gnu::always_inline]] Moments<T> solve(const Query<T>& q, Counts& counts) const {
    Pair<T> pair = q.pair;
    Mask<T> pressed = enforce_minimum_depth(pair, q.axis) & q.touching;
    Mask<T> fallback = pressed;
    if (any(pressed)) fallback &= has_too_little_depth(pair);
    T depth = max(-q.axis.separation, depth_floor * pair.size);
    CertifiedOverlap<T> overlap = overlap_by_face_sums(first_as_a(pair), depth);
    Moments<T> found = overlap.moments;
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

// The exact overlap of a single pair, not inlined: fallbacks and stages share one copy.
[[gnu::noinline]] inline Moments<double> exact_overlap(const Query<double>& q, Counts& counts) {
  return ExactModel{}.solve(q, counts);
}

// The one place that decides what a contact says of moments that its model does not give: NaN.
template <class T>
[[gnu::always_inline]] inline Moments<T> moments(const Moments<T>& found) {
  return found;
}
template <class T>
[[gnu::always_inline]] inline Moments<T> moments(const Vec<T>& centroid) {
  T unknown = splat<T>(std::numeric_limits<double>::quiet_NaN());
  return {unknown, centroid, {{unknown, unknown, unknown, unknown, unknown, unknown}}};
}

// The answers for pairs, in the frame of the poses.
template <class T>
struct Answer {
  Vec<T> normal;
  Moments<T> overlap;
};

template <class T, class Found>
[[gnu::always_inline]] inline Answer<T> answer(const Query<T>& q, const Found& found) {
  T nothing = splat<T>(std::numeric_limits<double>::quiet_NaN());
  Vec<T> none{nothing, nothing, nothing};
  Moments<T> overlap = moments(found);
  return {select(q.touching, direction_in_common_frame(q.pair, q.axis.normal), none),
          {select<T>(q.touching, overlap.volume, T{}),
           select(q.touching, point_in_common_frame(q.pair, overlap.centroid), none),
           select(q.touching, overlap.covariance,
                  Sym<T>{{nothing, nothing, nothing, nothing, nothing, nothing}})}};
}

// Rows of pairs in memory. A step of 0 gives all rows the same sizes, one of 3 each row its own.
struct Rows {
  const double *poses_a, *poses_b;  // 7 numbers a row: x y z qx qy qz qw
  const double *sizes_a, *sizes_b;  // full extents [m]
  long size_step_a, size_step_b;
};

// Where results go: one row a pair. Normals and points have three numbers a row, covariances nine.
// `volume` and `covariance` may be nullptr.
struct Results {
  bool* colliding;
  double *separation, *normal, *point;
  double *volume = nullptr, *covariance = nullptr;
};

// Rows `first` to `last` side by side. Lanes beyond them repeat the last one.
template <class T>
[[gnu::always_inline]] inline Query<T> query_rows(const Rows& rows, long first, long last) {
  alignas(sizeof(T)) double a[7][width<T>], b[7][width<T>], sizes[6][width<T>];
  for (int i = 0; i < width<T>; ++i) {
    long row = std::min(first + i, last - 1);
    for (int k = 0; k < 7; ++k) a[k][i] = rows.poses_a[7 * row + k];
    for (int k = 0; k < 7; ++k) b[k][i] = rows.poses_b[7 * row + k];
    for (int k = 0; k < 3; ++k) sizes[k][i] = rows.sizes_a[rows.size_step_a * row + k];
    for (int k = 0; k < 3; ++k) sizes[3 + k][i] = rows.sizes_b[rows.size_step_b * row + k];
  }
  auto lanes_of = [](const double(&numbers)[width<T>]) {
    T x;
    std::memcpy(&x, numbers, sizeof(T));
    return x;
  };
  Pose<T> pose_a, pose_b;
  Vec<T> half_a, half_b;
  for (int k = 0; k < 3; ++k) {
    pose_a.position[k] = lanes_of(a[k]);
    pose_b.position[k] = lanes_of(b[k]);
    half_a[k] = 0.5 * lanes_of(sizes[k]);
    half_b[k] = 0.5 * lanes_of(sizes[3 + k]);
  }
  for (int k = 0; k < 4; ++k) {
    pose_a.quaternion[k] = lanes_of(a[3 + k]);
    pose_b.quaternion[k] = lanes_of(b[3 + k]);
  }
  return query(pose_a, pose_b, half_a, half_b);
}

// Write `count` solved rows from `first` on. Returns the first that is refused, or −1.
template <class T, class Found>
[[gnu::always_inline]] inline long write_rows(const Query<T>& q, const Found& found, long first,
                                              long count, const Results& results) {
  Answer<T> rows = answer(q, found);
  Mat<T> covariance = matrix(rows.overlap.covariance);
  long refused = -1;
  for (int i = 0; i < count && i < width<T>; ++i) {
    long row = first + i;
    results.colliding[row] = lane(q.touching, i) != 0;
    results.separation[row] = lane(q.axis.separation, i);
    for (int k = 0; k < 3; ++k) results.normal[3 * row + k] = lane(rows.normal[k], i);
    for (int k = 0; k < 3; ++k) results.point[3 * row + k] = lane(rows.overlap.centroid[k], i);
    if (results.volume) results.volume[row] = lane(rows.overlap.volume, i);
    if (results.covariance)
      for (int k = 0; k < 9; ++k)
        results.covariance[9 * row + k] = lane(covariance[k / 3][k % 3], i);
    if (!lane(q.pair.valid, i)) {
      results.separation[row] = std::numeric_limits<double>::quiet_NaN();
      if (refused < 0) refused = row;
    }
  }
  return refused;
}

// Ask for the memory that rows will be written to, so that it is in the cache when they are solved.
inline void fetch_rows(const Results& results, long first, long last) {
  constexpr long line = 64 / sizeof(double);
  for (double* place : {results.normal, results.point})
    for (long k = 3 * first; k < 3 * last; k += line) __builtin_prefetch(place + k, 1);
  for (long k = 9 * first; results.covariance && k < 9 * last; k += line)
    __builtin_prefetch(results.covariance + k, 1);
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `separation` NaN.
template <class T, class Model>
long solve_rows(const Model& model, const Rows& rows, long begin, long end, const Results& results,
                Counts& counts) {
  constexpr int group = Model::template group<T>;
  long refused = -1;
  for (long first = begin; first < end; first += group * width<T>) {
    Query<T> queries[group];
    typename Model::template Found<T> found[group]{};
    bool touching = false;
    for (int g = 0; g < group; ++g) {
      long start = first + g * width<T>;
      queries[g] = query_rows<T>(rows, std::min(start, end - 1), end);
      // Lanes that repeat the last row are not counted.
      for (long i = std::max(0L, end - start); i < width<T>; ++i)
        set_lane(queries[g].touching, int(i), 0);
      touching |= any(queries[g].touching);
    }
    fetch_rows(results, first, std::min(first + group * width<T>, end));
    if (touching) model.solve(queries, found, counts);
    for (int g = 0; g < group; ++g) {
      long start = first + g * width<T>;
      long row = write_rows(queries[g], found[g], start, end - start, results);
      if (refused < 0) refused = row;
    }
  }
  return refused;
}

// Solve one pair; `half_a`, `half_b` are half extents. Returns false if poses or sizes are refused.
template <class Model>
[[gnu::always_inline]] inline bool solve_one(const Model& model, const double* pose_a,
                                             const double* pose_b, const Vec<double>& half_a,
                                             const Vec<double>& half_b, Contact& contact,
                                             Counts& counts) {
  Pose<double> a{{pose_a[0], pose_a[1], pose_a[2]}, {pose_a[3], pose_a[4], pose_a[5], pose_a[6]}};
  Pose<double> b{{pose_b[0], pose_b[1], pose_b[2]}, {pose_b[3], pose_b[4], pose_b[5], pose_b[6]}};
  Query<double> queries[1] = {query(a, b, half_a, half_b)};
  const Query<double>& q = queries[0];
  if (!q.pair.valid) return false;
  typename Model::template Found<double> found[1]{};
  if (q.touching) model.solve(queries, found, counts);
  Answer<double> one = answer(q, found[0]);
  const Moments<double>& overlap = one.overlap;
  contact = {q.touching,       q.axis.separation, one.normal,
             overlap.centroid, overlap.volume,    matrix(overlap.covariance)};
  return true;
}

}  // namespace box_contact
