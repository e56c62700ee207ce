// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bounds in time: how far a gap stays above a target, by values and rates now.
#pragma once

#include "sweep.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

// A number that changes with s: its value, its rate, and a bound of its second derivative.
struct Term {
  double value, rate, bend;
};

// A lower bound of a gap less a target after a time d. It is concave, and exact to first order.
//
// Of each box a vertex is followed. Where the plane's normal crosses the right angle to an edge, the
// other end of the edge comes nearer: such a term is the least of two lines, less a parabola.
class Bound {
 public:
  double value = -1.0, rate = 0.0, curve = 0.0;
  double horizon = 0.0;  // up to which d it is one

  // Add the least of low · term and high · term, where low ≤ 0 ≤ high.
  void add_least(double low, double high, const Term& term) {
    edges_[count_++] = {low, high, term.value, term.rate, 0.5 * term.bend};
  }

  double at(double d) const {
    double gap = (value + rate * d) - curve * (d * d);
    for (int k = 0; k < count_; ++k) gap += edges_[k].at(d);
    return gap;
  }
  // Find a time until which the bound stays above 0: the last one, but for what takes it below `spare`.
  // It is above that now. Newton's steps from the right end before the root. 0: none was found.
  double last_time(double spare) const {
    double d = horizon, gap = at(d);
    for (int round = 0; round < 60 && gap < 0.0; ++round) {
      d -= (gap - 0.4 * spare) / slope(d);
      gap = at(d);
    }
    return gap >= 0.0 && d > 0.0 ? d : 0.0;
  }

 private:
  struct Edge {
    double low, high, value, rate, curve;

    double at(double d) const {
      double x = value + rate * d, fall = curve * (d * d);
      return min(low * x + low * fall, high * x - high * fall);
    }
    double slope(double d) const {
      double x = value + rate * d, fall = curve * (d * d);
      return low * x + low * fall < high * x - high * fall ? low * (rate + 2.0 * curve * d)
                                                           : high * (rate - 2.0 * curve * d);
    }
  };

  double slope(double d) const {
    double found = rate - 2.0 * curve * d;
    for (int k = 0; k < count_; ++k) found += edges_[k].slope(d);
    return found;
  }

  int count_ = 0;
  Edge edges_[6];
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
