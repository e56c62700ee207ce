// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Time: a step of the caller's as sub-steps, by the steps and the answers before it. Nothing but numbers
// goes in and comes out.
//
// Springs are as hard as the longest step lately allows, and impulses are kept for a window of that
// step's sub-steps. Both would pump if they followed each step: a spring's rest depth goes with the
// square of the window. So the longest step of the last while counts, and sub-steps are equal in time: a
// short remainder of a frame is one of them.
#pragma once

#include <algorithm>
#include <cmath>

#include "../lanes/lanes.hpp"
#include "tuning.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A step of so many sub-steps and this share of one has no sub-step more [1]: the share is rounding.
constexpr double sub_step_slack = 1e-9;

// The frequency of a patch whose answers are late [1/s].
template <class T>
T frequency_of(T late, double period) {
  return late_frequency / (late + 0.5 * period);
}

// The equal sub-steps of an advance.
struct SubSteps {
  double dt, length;  // of all, and of each [s]
  int count, rounds;  // how many, and how many times all iterations are in each
  bool is_late;       // whether answers are late
  double window;      // the time in which the impulses that patches keep are given [s]
  double
      window_share;  // of the window in the longest step [1]: answers are late compared with that
  double period;     // from one answer to the next [s]
  double overdue;    // age of an answer that is overdue [s]

  static int count_of(double dt, double window) {
    return std::max(1, int(std::ceil(dt / window - sub_step_slack)));
  }
  // With windows shorter by a factor.
  SubSteps finer(double factor) const {
    SubSteps steps = *this;
    steps.window = window / factor;
    steps.window_share = window_share / factor;
    steps.count = count_of(dt, steps.window);
    steps.length = dt / steps.count;
    return steps;
  }
  // How much later than its start poses are to be taken for a force that depends on them [s]. A force that is
  // constant over the sub-steps moves a body by v·dt + a·dt²·(count + 1) / (2·count). Poses that are later by
  // this go on by semi-implicit Euler, under which springs keep their energy.
  double ahead() const { return 0.5 * dt * (count - 1) / count; }
  // In which time friction's centre follows what presses [s].
  double pressure_span() const {
    double late = is_late ? pressure_periods * period : 0.0;
    return late > pressure_time ? late : pressure_time;
  }
  // Which share of the impulses of a window `before` is given again at first, and which stays in this
  // one [1].
  template <class T>
  T again(T before) const {
    T share = min(splat<T>(most_again), length / before);
    return select<T>(before > 0.0, share, splat<T>(1.0));
  }
  template <class T>
  T kept(T before) const {
    return select<T>(before > 0.0, max(window - length, 0.0) / before, T{});
  }
};

// The longest step of the last while, in two halves of it.
class LongestStep {
 public:
  // Returns the length that counts [s] with a step of `dt` more.
  double with(double dt) {
    longest_ = std::max(longest_, dt);
    time_ += dt;
    ++count_;
    double lately = std::max(longest_, longest_before_);
    if (lately > goal_ || lately * step_shrinkage < goal_) goal_ = lately;
    length_ = std::max(goal_, length_ / step_shrinkage);
    if (time_ >= steps_time && count_ >= steps_count) {
      longest_before_ = longest_;
      longest_ = time_ = 0.0;
      count_ = 0;
    }
    return length_;
  }

 private:
  double longest_ = 0.0, longest_before_ = 0.0, time_ = 0.0;  // [s]
  int count_ = 0;
  double goal_ = 0.0, length_ = 0.0;  // [s]
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
    double longest = longest_.with(dt);
    // A late answer bears no stiffer patches in shorter sub-steps: all iterations are in one.
    bool is_late = frequency_of(late_, period_) < soft_frequency / longest;
    double window = is_late ? longest : std::min(longest / substeps, sub_step_limit);
    int count = SubSteps::count_of(dt, window);
    window_ = window;
    return {dt,
            dt / count,
            count,
            is_late ? substeps : 1,
            is_late,
            window,
            window / longest,
            period_,
            overdue_periods * std::max(period_, dt)};
  }
  // That of the last step [s].
  double window() const { return window_; }
  // Whether contacts are those of answers.
  bool is_told() const { return since_ >= 0.0; }
  // Since the last answer [s]; 0 with contacts of each step.
  double since() const { return std::max(0.0, since_); }
  void end(double dt) {
    if (is_told()) since_ += dt;
  }

 private:
  double least_interval() const {
    double least = 0.0;
    for (double interval : intervals_)
      if (interval > 0.0 && (least == 0.0 || interval < least)) least = interval;
    return least;
  }
  LongestStep longest_;
  double window_ = 0.0;
  double since_ = -1.0;                    // the last answer [s]; below 0: there was none
  double period_ = 0.0;                    // between answers [s]
  double late_ = 0.0;                      // age of the last answer when it came [s]
  double intervals_[intervals_kept] = {};  // between answers, the last one first; 0: none [s]
};

}  // namespace box_contact::BOX_CONTACT_SET::force
