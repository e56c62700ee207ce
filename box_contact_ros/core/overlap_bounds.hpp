// The bounding box of the overlap A∩B in the frame of one of the boxes, and a point inside.
//
// Every corner of A∩B lies on an edge of A or of B. So the 24 edges, each cut off where it leaves
// the other box, give the exact bounding box of the overlap in either box's frame, and the mean of
// the pieces, weighted by their lengths, is a point of A∩B near its centroid.
//
// Of the two bounding boxes A's is chosen, or B's if it is clearly smaller. The smaller one follows
// the overlap's own direction, and the network's errors are two to seven times smaller in it.
#pragma once

#include <limits>

#include "edge_pieces.hpp"

namespace box_contact {

// Slabs are wider by this fraction of the size: where faces of both boxes lie in one plane,
// rounding may put either box's edges outside the other, and nothing would be left.
constexpr double flush = 0x1p-46;

// Share of A's bounding box below which B's is chosen. Boxes that lie on each other have almost
// equal ones, and a container at rest must not hop between the frames.
constexpr double clearly_smaller = 0.8;

// Least half extent of a bounding box [m], so that one can divide by it.
constexpr double thinnest = 1e-290;

// The chosen bounding box. "Its frame" is that of box B where `in_b`, else of A, from that box's
// centre. The "other box" is the one whose faces cut the bounding box.
template <class T>
struct OverlapBounds {
  Mask<T> in_b;
  Vec<T> middle, half;  // its frame [m]
  Vec<T> inside;        // a point of A∩B, its frame [m]
  Mat<T> other_axes;    // the other box's axes as rows, its frame
  Vec<T> other_offset;  // from the other box's centre to `middle`, along the other box's axes [m]
  Vec<T> other_half;    // the other box's half extents [m]
};

namespace bounds {

template <class T>
struct Interval {
  Four<T> low, high;
};
template <class T>
struct BoundingBox {
  Vec<T> low, high;
};

template <class T>
[[gnu::always_inline]] inline T smallest_of(const Four<T>& x) {
  if constexpr (is_scalar<T>) {
    return min(min(x[0], x[1]), min(x[2], x[3]));
  } else {
    return x;
  }
}

// Widen by coordinates of pieces that are there; NaN comes in by no comparison.
template <class T>
[[gnu::always_inline]] inline void widen(Interval<T>& interval, Four<T> p) {
  interval.low = min(p, interval.low);
  interval.high = max(p, interval.high);
}

// Widen the bounding boxes in X's own frame and in Y's by the pieces of X's edges.
template <class T>
[[gnu::always_inline]] inline void widen_by_edges(const EdgePieces<T>& pieces, const Mat<T>& axes,
                                                  const Vec<T>& centre, const Vec<T>& half,
                                                  Interval<T> (&own)[3], Interval<T> (&other)[3]) {
  Four<T> nowhere = Four<T>{} + std::numeric_limits<double>::quiet_NaN();
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    int a = (j + 1) % 3, b = (j + 2) % 3;
#pragma GCC unroll 4
    for (int n = 0; n < steps<T>; ++n) {
      Four<T> at_a = sigma<T>(n) * half[a], at_b = tau<T>(n) * half[b];
      auto there = pieces.t[j][n] >= pieces.s[j][n];
      Four<T> s = there ? pieces.s[j][n] : nowhere, t = there ? pieces.t[j][n] : nowhere;
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) {
        Four<T> x = centre[k] + (at_a * axes[k][a] + at_b * axes[k][b]);
        widen<T>(other[k], x + s * axes[k][j]);
        widen<T>(other[k], x + t * axes[k][j]);
      }
      widen<T>(own[j], s);
      widen<T>(own[j], t);
      widen<T>(own[a], there ? at_a : nowhere);
      widen<T>(own[b], there ? at_b : nowhere);
    }
  }
}

template <class T>
[[gnu::always_inline]] inline BoundingBox<T> joined(const Interval<T> (&intervals)[3]) {
  BoundingBox<T> box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = smallest_of<T>(intervals[k].low);
    box.high[k] = -smallest_of<T>(-intervals[k].high);
  }
  return box;
}

template <class T>
[[gnu::always_inline]] inline T volume(const BoundingBox<T>& box) {
  Vec<T> extent = box.high - box.low;
  return extent[0] * extent[1] * extent[2];
}

}  // namespace bounds

// The bounds of a pair that has been pressed in; of pairs that do not overlap, without meaning.
template <class T>
[[gnu::always_inline]] inline OverlapBounds<T> overlap_bounds(const Pair<T>& pair) {
  using namespace bounds;
  const Mat<T>& r = pair.rotation;
  Mat<T> inverse = reciprocals(r), back = transpose(r);
  Vec<T> a_in_b = -pair.offset_b, wide_a, wide_b;
  T slack = flush * pair.size;
  for (int k = 0; k < 3; ++k) wide_a[k] = pair.half_a[k] + slack, wide_b[k] = pair.half_b[k] + slack;
  EdgePieces<T> edges_a = cut_edges(back, transpose(inverse), a_in_b, pair.half_a, wide_b, {});
  EdgePieces<T> edges_b = cut_edges(r, inverse, pair.offset_a, pair.half_b, wide_a, {});

  Four<T> far = Four<T>{} + std::numeric_limits<double>::max();
  Interval<T> in_a[3], in_b[3];
  for (int k = 0; k < 3; ++k) in_a[k] = in_b[k] = {far, -far};
  widen_by_edges(edges_a, back, a_in_b, pair.half_a, in_a, in_b);
  widen_by_edges(edges_b, r, pair.offset_a, pair.half_b, in_b, in_a);
  BoundingBox<T> box_a = joined(in_a), box_b = joined(in_b);

  OverlapBounds<T> found;
  found.in_b = volume(box_b) < clearly_smaller * volume(box_a);
  T scale = 1.0 / (edges_a.length + edges_b.length);
  Vec<T> inside_a = scale * (edges_a.mean + (r * edges_b.mean + edges_b.length * pair.offset_a));
  Vec<T> inside_b =
      scale * (edges_b.mean + (transposed_times(r, edges_a.mean) + edges_a.length * a_in_b));
  Vec<T> low = select(found.in_b, box_b.low, box_a.low);
  Vec<T> high = select(found.in_b, box_b.high, box_a.high);
  Vec<T> inside = select(found.in_b, inside_b, inside_a);
  for (int k = 0; k < 3; ++k) {
    found.middle[k] = 0.5 * (low[k] + high[k]);
    found.half[k] = max(0.5 * (high[k] - low[k]), splat<T>(thinnest));
    found.inside[k] = min(high[k], max(low[k], inside[k]));
  }
  found.other_axes = select(found.in_b, r, back);
  found.other_half = select(found.in_b, pair.half_a, pair.half_b);
  // The other box's centre along its own axes: B's is at offset_b, A's, seen from B, at −offset_a.
  Vec<T> centre = select(found.in_b, -pair.offset_a, pair.offset_b);
  found.other_offset = found.other_axes * found.middle - centre;
  return found;
}

// Bring a point from the bounds' frame to A's.
template <class T>
[[gnu::always_inline]] inline Vec<T> point_in_frame_a(const Pair<T>& pair,
                                                      const OverlapBounds<T>& bounds,
                                                      const Vec<T>& point) {
  return select(bounds.in_b, pair.offset_a + pair.rotation * point, point);
}

}  // namespace box_contact
