// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Threads that advance an island together, each a part of it.
#pragma once

#include <sched.h>
#include <time.h>

#include <algorithm>
#include <cstdint>

#include "../lanes/target.hpp"
#include "../waiting.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// When a group of blocks is solved in a round, among those of all parts. Groups that share a body have levels in
// the order of its pairs. It waits for the groups of some parts, a bit each, that are below a level: in this
// round, and in the last one.
struct GroupTurn {
  int32_t level;
  int32_t after{}, after_last{};
  uint32_t parts{}, parts_last{};

  void wait(int32_t part, int32_t below) {
    after = std::max(after, below);
    parts |= 1u << part;
  }
  void wait_last(int32_t part, int32_t below) {
    after_last = std::max(after_last, below);
    parts_last |= 1u << part;
  }
};

// Above the level of any group.
constexpr int32_t last_level = INT32_MAX;

class Team {
 public:
  static constexpr int most = 32;  // parts

  explicit Team(int parts) : parts_(parts), begun_(now()) {}
  int parts() const { return parts_; }

  // Which share of their time parts have waited for others, beyond a moment each [1].
  double waited() const {
    double sum = 0.0;
    for (const At& at : at_) sum += at.waited;
    return sum / (parts_ * (now() - begun_));
  }

  // Wait until all parts are here. Returns all bits that they bring.
  unsigned meet(int part, unsigned bits = 0) {
    Meetings& mine = at_[part].meetings;
    int64_t count = mine.count;
    mine.brought[count % 2] = bits;
    release(mine.count, count + 1);
    for (int other = 0; other < parts_; ++other) {
      const Meetings& its = at_[other].meetings;
      wait(part, [&] { return acquire(its.count) > count; });
      bits |= its.brought[count % 2];
    }
    return bits;
  }

  // Begin a round of turns. All parts have as many.
  void begin_round(int part) { at_[part].round += one_round; }
  // A part has solved its groups below a level.
  void reach(int part, int32_t level) { release(at_[part].reached, at_[part].round + level); }
  // Wait for the groups of other parts that come before one.
  void await(int part, const GroupTurn& turn) {
    await(part, turn.parts_last, at_[part].round - one_round + turn.after_last);
    await(part, turn.parts, at_[part].round + turn.after);
  }

 private:
  struct Meetings {
    int64_t count = 0;
    unsigned brought[2] = {};  // a part is ahead of others by one meeting at most
  };
  // Where a part is, on lines of a cache of its own.
  struct At {
    alignas(64) Meetings meetings;
    alignas(64) int64_t reached = last_level;  // its round, and the level in it
    alignas(64) double waited = 0.0;           // beyond a moment [s]
    int64_t round = 0;
    int64_t seen[most] = {};  // where others were when it looked last
  };
  static constexpr int64_t one_round = int64_t(1) << 32;

  // What a part writes for others. Kernels must not share functions, as those of std::atomic would be.
  static void release(int64_t& number, int64_t value) {
    __atomic_store_n(&number, value, __ATOMIC_RELEASE);
  }
  static int64_t acquire(const int64_t& number) {
    return __atomic_load_n(&number, __ATOMIC_ACQUIRE);
  }

  static double now() {
    timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
  }
  template <class Condition>
  void wait(int part, const Condition& holds) {
    if (detail::holds_soon(holds)) return;
    double begun = now();
    do sched_yield();
    while (!detail::holds_soon(holds));
    at_[part].waited += now() - begun;
  }
  void await(int part, uint32_t parts, int64_t wanted) {
    for (; parts != 0; parts &= parts - 1) {
      int other = __builtin_ctz(parts);
      int64_t& seen = at_[part].seen[other];
      if (seen >= wanted) continue;
      wait(part, [&] {
        seen = acquire(at_[other].reached);
        return seen >= wanted;
      });
    }
  }

  const int parts_;
  const double begun_;
  At at_[most];
};

// Whether teams pay. Where other work takes a core, parts wait for the one that has lost it. Then no team is
// formed for some advances. Each further time, they are twice as many.
class TeamsPay {
 public:
  bool operator()() { return left_ == 0 || --left_ == 0; }
  void end(const Team& team) {
    if (team.waited() < most_waited) {
      pause_ = std::max(pause_ / 2, least_pause);
    } else {
      left_ = pause_;
      pause_ = std::min(2 * pause_, most_pause);
    }
  }

 private:
  // On cores of their own, parts wait for 5 % of their time. Where a loop takes one of two, they wait for most.
  static constexpr double most_waited = 0.25;
  static constexpr int least_pause = 8, most_pause = 256;  // advances

  int pause_ = least_pause, left_ = 0;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
