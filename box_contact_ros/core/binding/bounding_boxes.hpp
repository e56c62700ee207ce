// Axis-aligned bounding boxes of posed boxes: which of the listed pairs can touch at all.
#pragma once

#include <cstdint>

#include "../poses.hpp"

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

  bool are_near(int64_t a, int64_t b) const {
    double gap = 0.0, scale = 0.0;
    for (int k = 0; k < 3; ++k) {
      double low_a = low[3 * a + k], high_a = high[3 * a + k];
      double low_b = low[3 * b + k], high_b = high[3 * b + k];
      gap = max(gap, max(low_a - high_b, low_b - high_a));
      scale = max(scale, max(max(abs(low_a), abs(high_a)), max(abs(low_b), abs(high_b))));
      scale = max(scale, max(high_a - low_a, high_b - low_b));
    }
    return gap <= near * scale;
  }
};

}  // namespace box_contact
