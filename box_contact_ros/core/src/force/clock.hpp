// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Time: a step of the caller's as sub-steps, by the steps and the answers before it. Nothing but numbers
// goes in and comes out.
#pragma once

#include <algorithm>
#include <cmath>

#include "../lanes/target.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Steps accepted [s]: at least this long, so that a speed divided by one is a number; and shorter than
// that, as nothing that touches stays within its patch for so long.
constexpr double step_min = 1e-50, step_limit = 1.0;
// Sub-steps are no longer [s], unless answers are late: a step of 0.1 s in four would sink a stack of
// eight by 42 mm.
constexpr double sub_step_limit = 0.005;
// A window shrinks by the first where three steps are shorter by more: a frame may end with two shorter
// ones, and a step that is measured varies. A step begins with at most the second times the impulses of
// a window [1]. What iterations leave is as large in a step of 1 ns as in one of 5 ms: divided by the
// step it would be any force. A window that is halved by each tiny step loses a tower's impulses in
// three of them.
constexpr double window_shrinkage = 1.25, most_again = 2.0;
// Angular frequency of a soft constraint times the window [1]: a quarter turn. A box that rests on a
// whole face is 0.4·g·step² deep.
constexpr double soft_frequency = 1.57;
// The same times half a period and the latency of an answer [1]. With 2 a container at 50 Hz and 5 ms
// tilts by 0.06°; from 4 on late loads vibrate.
constexpr double late_frequency = 2.5;
// An answer that is overdue by so many periods [1] pushes nothing out.
constexpr double overdue_periods = 3.0;
// A period that is not told is the least of so many intervals between answers: some get lost.
constexpr int intervals_kept = 8;

// The frequency of a patch whose answers are late [1/s].
inline double frequency_of(double late, double period) {
  return late_frequency / (late + 0.5 * period);
}

// What all patches of a sub-step share.
struct SubStep {
  double length;   // [s]
  double window;   // the time in which the impulses that patches keep were given [s]
  double again;    // share of the impulses of the window before that is given at first [1]
  double kept;     // share of them that stays in the window [1]
  double share;    // of the advance [1]; answers are late in comparison with all of it
  double period;   // from one answer to the next [s]
  double overdue;  // age of an answer that is overdue [s]
};

// The sub-steps of an advance.
struct SubSteps {
  double dt, length;  // of all, and of each [s]
  int count, rounds;  // how many, and how many times all iterations are in each
  SubStep first, later;
};

class Clock {
 public:
  // An answer came `late` seconds after its question. period: from one question to the next [s]; 0: the
  // least of the last intervals between answers.
  void answer(double late, double period) {
    if (since_ > 0.0) {
      std::copy_backward(intervals_, intervals_ + intervals_kept - 1, intervals_ + intervals_kept);
      intervals_[0] = since_;
    }
    period_ = period > 0.0 ? period : least_interval();
    late_ = late;
    since_ = 0.0;
  }
  // Contacts are solved at the start of each advance.
  void answer_each_step() {
    since_ = -1.0;
    period_ = late_ = 0.0;
  }

  SubSteps begin(double dt, int substeps) {
    // A late answer bears no stiffer patches in shorter sub-steps: all iterations are in one.
    double longest = std::max({dt, advance_, advance_before_});
    double shrunk = step_ / window_shrinkage;
    if (longest > step_ || longest < shrunk) step_ = std::max(longest, shrunk);
    bool is_late = frequency_of(late_, period_) < soft_frequency / step_;
    int count = is_late ? 1 : std::max(substeps, int(std::ceil(dt / sub_step_limit)));
    double window = is_late ? step_ : std::min(step_ / substeps, sub_step_limit);
    SubSteps steps{dt, dt / count, count, is_late ? substeps : 1, {}, {}};
    steps.first = sub_step(steps, window);
    steps.later = sub_step(steps, window);
    return steps;
  }
  void end(double dt) {
    if (since_ >= 0.0) since_ += dt;
    advance_before_ = advance_;
    advance_ = dt;
  }
  // Length of the last advance [s].
  double advance() const { return advance_; }

 private:
  double least_interval() const {
    double least = 0.0;
    for (double interval : intervals_)
      if (interval > 0.0 && (least == 0.0 || interval < least)) least = interval;
    return least;
  }
  // A sub-step of an advance. Its window begins the next one.
  SubStep sub_step(const SubSteps& steps, double window) {
    double before = window_, h = steps.length;
    window_ = window;
    return {h,
            window,
            before > 0.0 ? std::min(h / before, most_again) : 1.0,
            before > 0.0 ? (window - h) / before : 0.0,
            1.0 / steps.count,
            period_,
            overdue_periods * std::max(period_, steps.dt)};
  }

  double since_ = -1.0;                    // the last answer [s]; below 0: there was none
  double period_ = 0.0;                    // between answers [s]
  double late_ = 0.0;                      // age of the last answer when it came [s]
  double step_ = 0.0;                      // the longest one lately, or a little more [s]
  double window_ = 0.0;                    // in which the patches' impulses were given [s]
  double advance_ = 0.0;                   // length of the last one [s]
  double advance_before_ = 0.0;            // and of the one before [s]
  double intervals_[intervals_kept] = {};  // between answers, the last one first; 0: none [s]
};

}  // namespace box_contact::BOX_CONTACT_SET::force
