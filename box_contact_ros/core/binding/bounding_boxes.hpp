// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Axis-aligned bounding boxes of posed boxes: which pairs can touch at all.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../src/poses.hpp"

namespace box_contact {

// Bounding boxes count as near up to a gap of this share of the largest coordinate or extent, far
// above rounding. Boxes whose bounding boxes are a gap apart are that far apart themselves, and the
// largest gap on the SAT axes is at least 1/√3 of the distance: no contact is lost.
constexpr double near = 1e-9;

struct BoundingBoxes {
  const double* poses;  // (boxes, 7), common frame
  const double* sizes;  // (boxes, 3) full extents [m]
  double *low, *high;   // (boxes, 3) [m], common frame

  // Bound one box anew. Returns false, and changes nothing, for what is no pose.
  bool update(int64_t box) const {
    const double *p = poses + 7 * box, *size = sizes + 3 * box;
    Pose<double> pose{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
    if (!pose_valid(pose)) return false;
    Mat<double> axes = rotation_matrix(pose.quaternion);
    Vec<double> half{0.5 * size[0], 0.5 * size[1], 0.5 * size[2]};
    for (int k = 0; k < 3; ++k) {
      double reach = dot(abs(row(axes, k)), half);
      low[3 * box + k] = p[k] - reach;
      high[3 * box + k] = p[k] + reach;
    }
    return true;
  }

  // The largest coordinate or extent of a bounding box [m].
  double scale(int64_t box) const {
    double largest = 0.0;
    for (int64_t i = 3 * box; i < 3 * box + 3; ++i)
      largest = max(largest, max(max(abs(low[i]), abs(high[i])), high[i] - low[i]));
    return largest;
  }

  bool are_near(int64_t a, int64_t b) const {
    double gap = 0.0;
    for (int k = 0; k < 3; ++k)
      gap = max(gap, max(low[3 * a + k] - high[3 * b + k], low[3 * b + k] - high[3 * a + k]));
    return gap <= near * max(scale(a), scale(b));
  }

  // The axis on which the middles of the boxes are spread most.
  int widest_axis(const std::vector<int64_t>& boxes) const {
    Vec<double> sum{}, squares{};
    double count = double(boxes.size());
    for (int64_t box : boxes)
      for (int k = 0; k < 3; ++k) {
        double middle = 0.5 * (low[3 * box + k] + high[3 * box + k]);
        sum[k] += middle / count;
        squares[k] += middle * middle / count;
      }
    Vec<double> variance;
    for (int k = 0; k < 3; ++k) variance[k] = squares[k] - sum[k] * sum[k];
    return int(std::max_element(variance.v, variance.v + 3) - variance.v);
  }

  // Call `visit` with every two boxes that are near if one of them moves: sweep and prune.
  // Each box has an interval on one axis. Where it begins, the box meets those that have begun and
  // not ended. Intervals are widened, so that are_near, which decides, sees all that it would take.
  // Returns false, and stops, where more than `most` boxes have met: thousands may be in one place.
  template <class Visit>
  bool sweep(const std::vector<int64_t>& boxes, const unsigned char* moves, int64_t most,
             Visit visit) const {
    struct Interval {
      double begin, end;
      int64_t box;
    };
    int axis = widest_axis(boxes);
    std::vector<Interval> intervals;
    for (int64_t box : boxes) {
      double margin = 2.0 * near * scale(box);
      intervals.push_back({low[3 * box + axis] - margin, high[3 * box + axis] + margin, box});
    }
    std::sort(intervals.begin(), intervals.end(),
              [](const Interval& a, const Interval& b) { return a.begin < b.begin; });
    std::vector<Interval> begun[2];  // boxes that do not move, boxes that do
    for (const Interval& interval : intervals) {
      bool is_moving = moves[interval.box] != 0;
      for (int kind = is_moving ? 0 : 1; kind < 2; ++kind) {
        size_t kept = 0;
        if ((most -= int64_t(begun[kind].size())) < 0) return false;
        for (const Interval& other : begun[kind]) {
          if (other.end < interval.begin) continue;
          if (are_near(other.box, interval.box)) visit(other.box, interval.box);
          begun[kind][kept++] = other;
        }
        begun[kind].resize(kept);
      }
      begun[is_moving].push_back(interval);
    }
    return true;
  }
};

}  // namespace box_contact
