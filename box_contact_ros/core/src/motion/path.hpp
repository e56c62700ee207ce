// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A path of boxes among others: what comes too near on it, when, and how near all else comes.
//
// Segment k goes from pose k to pose k + 1, and the path's time with it. A ride is two boxes on a
// segment. Bounds around what a segment sweeps find the rides that matter. All is done in small steps,
// and the path goes on where it was: a program that has other things to do gives it some work at a
// time.
//
// 1. Hold: the pairs within the clearance at the first pose are set aside.
// 2. Count: how many rides the bounds leave. Too many are refused before they are looked at.
// 3. Meet: first times of the other pairs within the clearance, and the first touch.
// 4. Least: where nothing touches, the least distance. Rides within a radius are looked at, then those
//    of a larger one, up to the least distance known.
// 5. Part: when pairs that were set aside come near again, or get deeper into each other.
#pragma once

#include <algorithm>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "../../include/box_contact/index.h"
#include "../filter.hpp"
#include "../index.hpp"
#include "least_distance.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

// After a turn by this angle, boxes that begin within the clearance are looked at once more [rad].
constexpr double parting_angle = 0.02;
// Boxes that begin within the clearance may get deeper into each other by this [m].
constexpr double deeper = 1e-4;
// Of an extent that is made smaller, this share is left.
constexpr double least_part = 1e-3;

using detail::Bounds;
using detail::BoxPair;

// Boxes that move, and what they move among.
struct Way {
  int64_t times;                       // of the path
  std::vector<int64_t> numbers;        // of the boxes, as the filter has them
  std::vector<Vec<double>> sizes;      // full extents [m]
  std::vector<Vec<double>> centres;    // of turning, in the boxes' frames [m]; none: the boxes' own
  std::vector<Pose<double>> poses;     // (times, boxes)
  std::vector<const detail::Index*> around;
  const detail::Filter* filter;
  double clearance, tolerance;         // [m]
  int64_t most_pairs, most_looks;

  size_t count() const { return sizes.size(); }
  const Pose<double>& pose(int64_t time, size_t box) const {
    return poses[size_t(time) * count() + box];
  }
};

using Meeting = bc_meeting;

// What ends a path before it is done.
enum class Ending { none, too_many_pairs, too_many_looks, rounding };

class Path {
 public:
  Path(Way way, const detail::Kernel& kernel) : way_(std::move(way)), kernel_(kernel) {
    double largest = 0.0;
    auto reach_of = [](const Pose<double>& pose, const Vec<double>& size) {
      const Vec<double>& p = pose.position;
      return std::max({std::fabs(p[0]), std::fabs(p[1]), std::fabs(p[2])}) +
             2.0 * std::max({size[0], size[1], size[2]});
    };
    for (size_t box = 0; box < way_.count(); ++box) {
      const Vec<double>& size = way_.sizes[box];
      step_ = std::max(step_, 0.125 * std::max({size[0], size[1], size[2]}));
      for (int64_t time = 0; time < way_.times; ++time)
        largest = std::max(largest, reach_of(way_.pose(time, box), size));
      looks_.push_back(double(way_.times));
      for (int64_t segment = 0; segment + 1 < way_.times; ++segment)
        looks_.back() += turned(turns(box, segment)) / parting_angle;
      boxes_.push_back(int32_t(box));
    }
    for (const detail::Index* index : way_.around)
      for (int64_t box = 0; box < int64_t(index->count()); ++box)
        if (index->has(box))
          largest = std::max(largest, reach_of(index->pose(box), index->size(box)));
    farthest_ = 4.0 * largest;
    list_pairs();
    begin(Stage::hold, way_.clearance + way_.tolerance);
  }

  // Go on by about so many looks. Returns whether all is done; see `ending`.
  bool advance(int64_t work) {
    for (spent_ = 0; spent_ < work && stage_ != Stage::done;) step();
    return stage_ == Stage::done;
  }

  Ending ending() const { return ending_; }
  // What the ending is about: how many were counted, or the least tolerance [m].
  double ended_at() const { return ended_at_; }

  // What comes within the clearance, in the order of time.
  const std::vector<Meeting>& impacts() const { return impacts_; }
  // The pairs that are within the clearance at the first pose.
  const std::vector<BoxPair>& held() const { return held_pairs_; }
  // What comes nearest, of pairs that are not held: none, or one.
  const std::vector<Meeting>& least() const { return least_; }

 private:
  enum class Stage { hold, count, meet, least, part, done };

  // A box beside a mover.
  struct Other {
    int64_t number;
    int32_t mover;  // −1: it stands
    const Pose<double>* pose;
    const Vec<double>* size;
    bool is_a;  // of the pair with the mover
    double gap = 0.0;  // of both bounds [m]
  };
  struct Held {
    size_t mover;
    Other other;
    double depth;  // at the first pose [m]
  };

  // --- Boxes and bounds ---------------------------------------------------------------------------

  SweepNumbers sweep(size_t box, int64_t segment) const {
    return {way_.pose(segment, box).position.v, way_.pose(segment + 1, box).position.v,
            way_.sizes[box].v, way_.centres.empty() ? nullptr : way_.centres[box].v};
  }
  SweepNumbers sweep(const Other& other, int64_t segment) const {
    if (other.mover >= 0) return sweep(size_t(other.mover), segment);
    return {other.pose->position.v, other.pose->position.v, other.size->v, nullptr};
  }
  // Both boxes on a segment. A tolerance that rounding does not allow ends the path.
  bool set(Motion& motion, const SweepNumbers& mover, const SweepNumbers& other, bool other_is_a) {
    motion.set(other_is_a ? other : mover, other_is_a ? mover : other);
    if (way_.tolerance < motion.least_tolerance())
      end(Ending::rounding, 1.01 * motion.least_tolerance());
    return stage_ != Stage::done;
  }

  // Bounds around what a box sweeps. A corner of a box that turns by an angle is at most
  // reach · angle² / 8 beside the line between where it is before and after, at right angles to the axis.
  Bounds swept(size_t box, int64_t segment) const {
    const Pose<double>&from = way_.pose(segment, box), &to = way_.pose(segment + 1, box);
    Vec<double> half = 0.5 * way_.sizes[box];
    Bounds bounds = detail::bounds_of(from, half).around(detail::bounds_of(to, half));
    Turns turned_by = turns(box, segment);
    double angle = turned(turned_by), reach = length(half);
    if (!way_.centres.empty()) reach += length(way_.centres[box]);
    for (int k = 0; k < 3; ++k) {
      double along = turned_by.axis[k][0];
      double bulge = 0.125 * reach * angle * angle * std::sqrt(max(1.0 - along * along, 0.0));
      bounds.ends[k] -= bulge, bounds.ends[k + 3] -= bulge;
    }
    return bounds;
  }
  Turns turns(size_t box, int64_t segment) const {
    Both start[4], end[4];
    for (int k = 0; k < 4; ++k) {
      start[k] = splat<Both>(way_.pose(segment, box).quaternion[k]);
      end[k] = splat<Both>(way_.pose(segment + 1, box).quaternion[k]);
    }
    Turns turns;
    find_shortest_turns(start, end, turns);
    return turns;
  }
  static double turned(const Turns& turns) { return 2.0 * turns.half_angle[0]; }
  static double turned(const Motion& motion) { return motion.turned[0] + motion.turned[1]; }

  void list_pairs() {
    listed_of_.resize(way_.count());
    std::unordered_map<int64_t, int32_t> mover_of;
    for (int32_t box : boxes_) mover_of[way_.numbers[size_t(box)]] = box;
    auto find = [&](int64_t number, Other& other) {
      auto mover = mover_of.find(number);
      if (mover != mover_of.end()) return place(mover->second, other), true;
      for (const detail::Index* index : way_.around)
        if (number < int64_t(index->count()) && index->has(number))
          return other = standing(*index, int32_t(number)), true;
      return false;
    };
    for (const BoxPair& pair : way_.filter->listed) {
      Other a{}, b{};
      if (!find(pair.a, a) || !find(pair.b, b) || (a.mover < 0 && b.mover < 0)) continue;
      bool by_a = a.mover >= 0;
      Other& other = by_a ? b : a;
      other.is_a = !by_a;
      listed_of_[size_t(by_a ? a.mover : b.mover)].push_back(other);
    }
  }
  void place(int32_t mover, Other& other) const {
    other = {way_.numbers[size_t(mover)], mover, nullptr, &way_.sizes[size_t(mover)], false};
  }
  static Other standing(const detail::Index& index, int32_t box) {
    return {box, -1, &index.pose(box), &index.size(box), false};
  }

  // Bounds of all movers on a segment, and of the first pose as a segment −1.
  void bound(int64_t segment) {
    if (segment == bounded_) return;
    bounds_.resize(way_.count());
    for (size_t box = 0; box < way_.count(); ++box)
      bounds_[box] = segment < 0 ? detail::bounds_of(way_.pose(0, box), 0.5 * way_.sizes[box])
                                 : swept(box, segment);
    tree_.build(boxes_, bounds_);
    bounded_ = segment;
    spent_ += int64_t(way_.count()) / 8;
  }

  // Set `near_` to the boxes whose bounds are within a radius of a mover's on a segment [m].
  void search(size_t mover, int64_t segment, double radius) {
    bound(segment);
    near_.clear();
    int64_t visited = 0;
    const Bounds& own = bounds_[mover];
    Bounds grown = own.grown(radius);
    auto take = [&](Other other, const Bounds& bounds) {
      other.gap = own.gap(bounds);
      if (other.gap <= radius) near_.push_back(other);
    };
    auto take_asked = [&](Other other, const Bounds& bounds) {
      ++visited;
      uint8_t side = way_.filter->side(way_.numbers[mover], other.number);
      other.is_a = side == 2;
      if (side) take(other, bounds);
    };
    for (const detail::Index* index : way_.around)
      index->each_near(grown, [&](int32_t box) {
        take_asked(standing(*index, box), index->bounds(box));
        return true;
      });
    size_t visits = 0;
    auto take_mover = [&](int32_t box) {
      Other other{};
      place(box, other);
      if (size_t(box) > mover) take_asked(other, bounds_[size_t(box)]);
      return true;
    };
    tree_.each_near(grown, 0, take_mover, visits);
    for (const Other& other : listed_of_[mover])
      take(other, other.mover >= 0 ? bounds_[size_t(other.mover)]
                                   : detail::bounds_of(*other.pose, 0.5 * *other.size));
    spent_ += 1 + visited / 16;
  }

  // --- Stages -------------------------------------------------------------------------------------

  void begin(Stage stage, double radius) {
    stage_ = stage, radius_ = radius;
    segment_ = stage == Stage::hold ? -1 : 0;
    mover_ = 0, at_ = 0, is_searched_ = false;
  }
  void end(Ending ending, double at) {
    stage_ = Stage::done, ending_ = ending, ended_at_ = at;
  }

  // Look at one ride, or search for the rides of the next mover.
  void step() {
    if (stage_ == Stage::part) return part();
    if (way_.count() == 0 || segment_ == last_segment()) return next_stage();
    if (!is_searched_) {
      search(mover_, segment_, reach());
      if (stage_ == Stage::least)
        std::sort(near_.begin(), near_.end(),
                  [](const Other& a, const Other& b) { return a.gap < b.gap; });
      is_searched_ = true, at_ = 0;
      if (stage_ == Stage::count) count_rides();
    }
    if (stage_ == Stage::done) return;
    if (stage_ != Stage::count && at_ < near_.size()) {
      look(near_[at_]);  // again, where memory ends
      ++at_;
      return;
    }
    is_searched_ = false;
    if (++mover_ < way_.count()) return;
    mover_ = 0;
    ++segment_;
    is_touch_known_ = !touch_.empty();
  }
  int64_t last_segment() const { return stage_ == Stage::hold ? 0 : way_.times - 1; }
  // How far a search reaches now [m].
  double reach() const { return stage_ == Stage::least ? min(radius_, bound_) : radius_; }

  void next_stage() {
    double near = way_.clearance + way_.tolerance;
    if (stage_ == Stage::hold) {
      std::sort(held_.begin(), held_.end(), [&](const Held& one, const Held& other) {
        BoxPair a = pair_of(one.mover, one.other), b = pair_of(other.mover, other.other);
        return std::pair(a.a, a.b) < std::pair(b.a, b.b);
      });
      held_pairs_.clear(), counted_ = 0.0;
      for (const Held& held : held_) {
        held_pairs_.push_back(pair_of(held.mover, held.other));
        counted_ += looks_[held.mover];
        if (held.other.mover >= 0) counted_ += looks_[size_t(held.other.mover)];
      }
      begin(Stage::count, near);
      if (counted_ > double(way_.most_looks)) end(Ending::too_many_looks, counted_);
    } else if (stage_ == Stage::count) {
      begin(Stage::meet, near);
    } else if (stage_ == Stage::meet && touch_.empty() && way_.count()) {
      begin(Stage::least, step_);
    } else if (stage_ == Stage::least && radius_ < bound_ && radius_ <= farthest_) {
      seen_ = radius_;
      begin(Stage::least, min(bound_, 4.0 * radius_));
    } else {
      if (!touch_.empty()) least_ = touch_;
      begin(Stage::part, near);
      if (held_.empty()) finish();
    }
  }

  void count_rides() {
    for (const Other& other : near_) counted_ += !is_held(other);
    if (counted_ > double(way_.most_looks)) end(Ending::too_many_looks, counted_);
  }

  void look(const Other& other) {
    ++spent_;
    if (stage_ == Stage::hold) return hold(other);
    if (is_held(other)) return;
    if (stage_ == Stage::meet) meet(other);
    else approach(other);
  }
  bool set(Motion& motion, const Other& other) {
    return set(motion, sweep(mover_, segment_), sweep(other, segment_), other.is_a);
  }

  void hold(const Other& other) {
    const Pose<double>& pose = way_.pose(0, mover_);
    const Pose<double>& its = other.mover >= 0 ? way_.pose(0, size_t(other.mover)) : *other.pose;
    detail::PairNumbers pair{pose.position.v, its.position.v, way_.sizes[mover_].v, other.size->v};
    if (other.is_a) std::swap(pair.pose_a, pair.pose_b), std::swap(pair.size_a, pair.size_b);
    bc_nearest nearest;
    nearest.size = sizeof nearest;
    kernel_.nearest_pair(pair, nearest);
    if (nearest.distance > radius_) return;
    bc_contact contact;
    kernel_.solve_pair[int(detail::Model::exact)][int(detail::Finds::point)](nullptr, pair, 0.0,
                                                                             contact);
    held_keys_.insert(key(mover_, other));
    held_.push_back({mover_, other, max(0.0, -contact.separation)});
    if (int64_t(held_.size()) > way_.most_pairs) end(Ending::too_many_pairs, double(held_.size()));
  }

  void meet(const Other& other) {
    bool is_new = impact_of_.find(key(mover_, other)) == impact_of_.end();
    bool may_touch = !is_touch_known_ && other.gap <= way_.tolerance;
    Motion motion;
    if ((!is_new && !may_touch) || !set(motion, other)) return;
    Meeting found;
    if (is_new) {
      if (!find_first(motion, way_.clearance, mover_, other, found)) return;
      add_impact(mover_, other, found);
    }
    if (!may_touch || stage_ == Stage::done) return;
    bool is_found = is_new && way_.clearance == 0.0;
    if (!is_found && !find_first(motion, 0.0, mover_, other, found)) return;
    if (touch_.empty() || is_before(found, touch_[0])) touch_.assign(1, found);
  }
  bool find_first(const Motion& motion, double clearance, size_t mover, const Other& other,
                  Meeting& found, double begun = 0.0) const {
    Follower follower(motion, kernel_);
    Near near;
    if (!find_time_of_impact(follower, clearance, way_.tolerance, near)) return false;
    found = meeting(mover, other, follower.rate(near), near, begun);
    return true;
  }

  // Look whether two boxes come nearer than all before.
  void approach(const Other& other) {
    Motion motion;
    if (other.gap <= seen_ || !(other.gap < bound_) || !set(motion, other)) return;
    Meeting found;
    // Few come nearer, and this takes less.
    if (bound_ < infinity && !find_first(motion, max(bound_, 0.0), mover_, other, found)) return;
    Follower follower(motion, kernel_);
    Near near = LeastDistance(follower, way_.tolerance).find();
    spent_ += 4;
    if (!least_.empty() && near.nearest.distance >= least_[0].approach.nearest.distance) return;
    least_.assign(1, meeting(mover_, other, follower.rate(near), near));
    bound_ = near.nearest.distance - way_.tolerance;
  }

  // --- Pairs that are held ------------------------------------------------------------------------

  // Look at a segment of a held pair. First, whether it is apart somewhere, and meets later; then,
  // whether it is pressed together.
  void part() {
    const Held& held = held_[at_];
    SweepNumbers mover = sweep(held.mover, segment_), other = sweep(held.other, segment_);
    if (!is_pressing_) {
      if (!is_apart_) find_apart(held, mover, other);
      else meet_again(held, mover, other);
    } else {
      press(held, mover, other);
    }
    ++spent_;
    if (stage_ == Stage::done) return;
    if (is_over_ || ++segment_ == way_.times - 1) {
      segment_ = 0, is_over_ = is_apart_ = false;
      is_pressing_ = !is_pressing_;
      if (!is_pressing_ && ++at_ == held_.size()) finish();
    }
  }

  // Apart is farther than the clearance and two tolerances: what is as near as that may be answered.
  void find_apart(const Held& held, const SweepNumbers& mover, const SweepNumbers& other) {
    Motion motion;
    if (!set(motion, mover, other, held.other.is_a)) return;
    Follower follower(motion, kernel_);
    int64_t looks = 1 + int64_t(std::ceil(turned(motion) / parting_angle));
    for (int64_t look = 1; look <= looks; ++look, ++spent_) {
      Instant now = motion.at(look == looks ? 1.0 : double(look) / double(looks));
      if (follower.see(now).nearest.distance <= way_.clearance + 2.0 * way_.tolerance) continue;
      if (look == looks) {
        is_apart_ = true;
        return;
      }
      // The rest of this segment.
      Pose<double> starts[2] = {motion.pose(0, now), motion.pose(1, now)};
      bool is_a = held.other.is_a;
      SweepNumbers rest = mover, its = other;
      rest.start = starts[is_a].position.v, its.start = starts[!is_a].position.v;
      meet_again(held, rest, its, now.s);
      is_apart_ = true;
      return;
    }
  }

  void meet_again(const Held& held, const SweepNumbers& mover, const SweepNumbers& other,
                  double begun = 0.0) {
    Motion motion;
    Meeting found;
    if (are_far(held, way_.clearance) || !set(motion, mover, other, held.other.is_a) ||
        !find_first(motion, way_.clearance, held.mover, held.other, found, begun))
      return;
    add_impact(held.mover, held.other, found);
    is_over_ = true;
  }

  // Boxes that are smaller by their depth, and by `deeper`, are apart at the first pose. Where one is not
  // as thick as that, it is not known what is deeper.
  void press(const Held& held, const SweepNumbers& mover, const SweepNumbers& other) {
    if (are_far(held, 0.0)) return;
    double sizes[2][3], less = held.depth + deeper;
    SweepNumbers thin = mover, other_thin = other;
    for (int k = 0; k < 3; ++k) {
      sizes[0][k] = max(mover.size[k] - less, least_part * mover.size[k]);
      sizes[1][k] = max(other.size[k] - less, least_part * other.size[k]);
    }
    thin.size = sizes[0], other_thin.size = sizes[1];
    Motion smaller, motion;
    if (!set(smaller, thin, other_thin, held.other.is_a)) return;
    Follower follower(smaller, kernel_);
    Near near;
    if (!find_time_of_impact(follower, 0.0, way_.tolerance, near)) return;
    is_over_ = true;
    if ((segment_ == 0 && near.s == 0.0) || !set(motion, mover, other, held.other.is_a)) return;
    double rate = follower.rate(near);
    near = Follower(motion, kernel_).see(motion.at(near.s));
    add_impact(held.mover, held.other, meeting(held.mover, held.other, rate, near));
  }

  // Whether the bounds of a held pair on the segment are apart by more than a distance [m].
  bool are_far(const Held& held, double distance) const {
    const Other& other = held.other;
    Bounds bounds = other.mover >= 0 ? swept(size_t(other.mover), segment_)
                                     : detail::bounds_of(*other.pose, 0.5 * *other.size);
    return swept(held.mover, segment_).gap(bounds) > distance + way_.tolerance;
  }

  // --- Answers ------------------------------------------------------------------------------------

  BoxPair pair_of(size_t mover, const Other& other) const {
    int64_t number = way_.numbers[mover];
    return other.is_a ? BoxPair(other.number, number)
                      : BoxPair(number, other.number);
  }
  uint64_t key(size_t mover, const Other& other) const {
    return detail::Filter::key(way_.numbers[mover], other.number);
  }
  bool is_held(const Other& other) const {
    return !held_keys_.empty() && held_keys_.count(key(mover_, other));
  }
  // begun: the share of the segment that was gone before.
  Meeting meeting(size_t mover, const Other& other, double rate, const Near& near,
                  double begun = 0.0) const {
    BoxPair pair = pair_of(mover, other);
    double time = double(segment_) + begun + (1.0 - begun) * near.s;
    return {pair.a, pair.b, {sizeof(bc_approach), time, -rate / (1.0 - begun), near.nearest}};
  }
  static bool is_before(const Meeting& one, const Meeting& other) {
    return std::tuple(one.approach.time, one.a, one.b) <
           std::tuple(other.approach.time, other.a, other.b);
  }
  // Keep the first of each pair.
  void add_impact(size_t mover, const Other& other, const Meeting& found) {
    if (impacts_.size() == impacts_.capacity()) impacts_.reserve(2 * impacts_.size() + 16);
    auto [known, is_new] = impact_of_.try_emplace(key(mover, other), impacts_.size());
    if (is_new) impacts_.push_back(found);  // there is room
    else if (is_before(found, impacts_[known->second])) impacts_[known->second] = found;
    if (int64_t(impacts_.size()) > way_.most_pairs)
      end(Ending::too_many_pairs, double(impacts_.size()));
  }
  void finish() {
    std::sort(impacts_.begin(), impacts_.end(), is_before);
    stage_ = Stage::done;
  }

  Way way_;
  const detail::Kernel& kernel_;
  double step_ = 0.0, farthest_ = 0.0;         // [m]
  std::vector<int32_t> boxes_;                 // that move
  std::vector<double> looks_;                  // at each, until it has turned, at most
  std::vector<std::vector<Other>> listed_of_;  // by movers
  // Where the path is.
  Stage stage_ = Stage::hold;
  Ending ending_ = Ending::none;
  double ended_at_ = 0.0, counted_ = 0.0;
  int64_t segment_ = 0, spent_ = 0;
  size_t mover_ = 0, at_ = 0;
  bool is_searched_ = false;                                            // `near_` is that of a mover
  bool is_pressing_ = false, is_apart_ = false, is_over_ = false;       // of a held pair
  bool is_touch_known_ = false;                                         // on an earlier segment
  double radius_ = 0.0, seen_ = -1.0, bound_ = infinity;                // [m]
  // Of a segment.
  int64_t bounded_ = -2;
  std::vector<Bounds> bounds_;
  detail::BoundsTree tree_;
  std::vector<Other> near_;
  // What was found.
  std::vector<Held> held_;
  std::vector<BoxPair> held_pairs_;
  std::unordered_set<uint64_t> held_keys_;
  std::unordered_map<uint64_t, size_t> impact_of_;  // by keys
  std::vector<Meeting> impacts_, touch_, least_;
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
