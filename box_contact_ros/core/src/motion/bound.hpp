// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bounds in time: how far a gap stays above a target, by values and rates now.
#pragma once

#include "sweep.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

// A number of each box that changes with s: its value, its rate, and a bound of its second derivative.
struct Terms {
  Both value, rate, bend;
};

// A lower bound of a gap less a target after a time d. It is concave, and exact to first order.
//
// Of each box a vertex is followed. Where the plane's normal crosses the right angle to an edge, the
// other end of the edge comes nearer: such a term is the least of two lines, less a parabola.
class Bound {
 public:
  double value = -1.0, rate = 0.0, curve = 0.0;
  double horizon = 0.0;  // up to which d it is one

  // Add the least of low · term and high · term of an edge of each box, where low ≤ 0 ≤ high.
  BC_INLINE void add_least(const Both& low, const Both& high, const Terms& term) {
    edges_[count_++] = {low, high, term.value, term.rate, 0.5 * term.bend};
  }
  // Find a time until which the bound stays above 0: the last one, but for what takes it below `spare`.
  // 0: it is below `spare` now, or none was found. Newton's steps from the right end before the root.
  double last_time(double spare) const {
    double gap = value, slope = rate, low = 0.4 * spare;
    add_edges(0.0, gap, slope);
    if (!(gap > spare)) return 0.0;
    double d = min(horizon, smooth_root(value - low));
    if (slope < 0.0) d = min(d, (gap - low) / -slope);
    for (int round = 0; round < 60; ++round) {
      gap = (value + rate * d) - curve * (d * d), slope = rate - 2.0 * curve * d;
      add_edges(d, gap, slope);
      if (gap >= 0.0) return max(d, 0.0);
      d -= (gap - low) / slope;
    }
    return 0.0;
  }

 private:
  struct Edges {
    Both low, high, value, rate, curve;
  };

  BC_INLINE void add_edges(double d, double& gap, double& slope) const {
    Both gaps{}, slopes{};
    for (int k = 0; k < count_; ++k) {
      const Edges& edge = edges_[k];
      Both x = edge.value + edge.rate * d, fall = edge.curve * d;
      Both low = edge.low * (x + fall * d), high = edge.high * (x - fall * d);
      gaps += min(low, high);
      slopes += select<Both>(low < high, edge.low * (edge.rate + 2.0 * fall),
                             edge.high * (edge.rate - 2.0 * fall));
    }
    gap += gaps[0] + gaps[1];
    slope += slopes[0] + slopes[1];
  }
  // The last d at which start + rate · d − curve · d² is not below 0, of a start above 0.
  double smooth_root(double start) const {
    double root = std::sqrt(rate * rate + 4.0 * curve * start);
    return rate > 0.0 ? (rate + root) / (2.0 * curve) : 2.0 * start / (root - rate);
  }

  int count_ = 0;
  Edges edges_[3];
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
