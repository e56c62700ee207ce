// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs of many boxes may touch.
//
// Fat bounds are a bounding box, grown a little. The pairs whose fat bounds overlap are kept from
// call to call. While a box stays within its fat bounds, it can be near the boxes of its kept pairs
// alone. So a call tests the kept pairs, and searches for others for the boxes that left their fat
// bounds. There are trees to search: one of fixed boxes, a small one of those that came later, and
// one of the others' fat bounds. Where no box has moved, the last answer holds.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "bounds_tree.hpp"

namespace box_contact::detail {

// Fat bounds grow by this share of a box's shortest half extent. With more, each call tests more
// pairs. With less, a box leaves its fat bounds sooner.
constexpr double fattening = 0.1;

// Fixed boxes that come later are in a tree of their own up to this share of all.
constexpr size_t later_share = 8;

// Which pairs are asked for: those that are listed, and those that the groups of boxes allow.
struct Asked {
  std::vector<int64_t> listed;  // (n, 2) boxes
  std::vector<int32_t> group;   // of each box
  // (groups, groups), by the group of the lower and of the higher box: 0: not asked for; 1: the
  // lower is box A; 2: the higher is.
  std::vector<uint8_t> allowed;
  int32_t groups = 0;

  uint8_t side(int32_t lower, int32_t higher) const {
    return allowed[size_t(group[lower]) * size_t(groups) + size_t(group[higher])];
  }
};

class BroadPhase {
 public:
  struct Row {
    Row(int64_t a, int64_t b) : a(a), b(b) {}
    int64_t a, b;
  };

  // half: half extents of each box, larger by half the margin [m]. fixed: which boxes never move,
  // and never meet each other. body: of each box; boxes of one body never meet each other.
  BroadPhase(std::vector<Vec<double>> half, double margin, std::vector<uint8_t> fixed,
             std::vector<int32_t> body, Asked asked)
      : margin(margin),
        half_(std::move(half)),
        fixed_(std::move(fixed)),
        body_(std::move(body)),
        asked_(std::move(asked)),
        meets_(half_.size(), 0),
        bounds_(half_.size(), nowhere),
        fat_(half_.size(), nowhere),
        last_(new std::array<double, 7>[half_.size()]),
        is_settled_(half_.size(), 0),
        is_changed_(half_.size(), 0) {
    for (size_t k = 0; k + 1 < asked_.listed.size(); k += 2)
      listed_.push_back(pair_of(asked_.listed[k], asked_.listed[k + 1]));
    std::sort(listed_.begin(), listed_.end());
    std::vector<uint8_t> group_meets(size_t(asked_.groups), 0);
    for (size_t k = 0; k < asked_.allowed.size(); ++k)
      if (asked_.allowed[k])
        group_meets[k / size_t(asked_.groups)] = group_meets[k % size_t(asked_.groups)] = 1;
    to_read_.reserve(count());
    for (int32_t box = 0; box < int32_t(count()); ++box) {
      to_read_.push_back(box);
      meets_[size_t(box)] = asked_.groups && group_meets[size_t(asked_.group[box])];
    }
  }

  const double margin;  // [m]
  size_t count() const { return half_.size(); }
  bool is_fixed(int64_t box) const { return fixed_[size_t(box)]; }
  void resize(int64_t box, const Vec<double>& half) {
    half_[size_t(box)] = half;
    is_settled_[size_t(box)] = 0;
    is_found_ = false;
  }

  // Take over what `former` knows of fixed boxes, so that only others are read and sorted. kept: the index
  // of each box in `former`; −1: it has another size or pose there, or is not there.
  void take_fixed(const BroadPhase& former, const int64_t* kept) {
    std::vector<int32_t> number_of(former.count(), -1);
    for (size_t box = 0; box < count(); ++box) {
      if (kept[box] < 0 || !fixed_[box] || !former.fixed_[size_t(kept[box])]) continue;
      bounds_[box] = former.bounds_[size_t(kept[box])];
      number_of[size_t(kept[box])] = int32_t(box);
    }
    fixed_tree_ = former.fixed_tree_;
    fixed_tree_.renumber(number_of);
    build_fixed();
  }

  // Find the pairs that may touch at `poses` (boxes, 7); seven NaN: the box is not there. The poses
  // of fixed boxes are read once. Stops with more than `most` pairs. Returns −1, or a box without a
  // valid pose; nothing is found then.
  int64_t find(const double* poses, int64_t most) { return find(poses, to_read_, most); }
  // The same, where only the poses of some boxes may be others than in the last call.
  int64_t find_changed(const double* poses, const int64_t* changed, int64_t count, int64_t most) {
    if (!is_found_) return find(poses, most);
    named_.assign(changed, changed + count);
    std::sort(named_.begin(), named_.end());
    named_.erase(std::unique(named_.begin(), named_.end()), named_.end());
    auto is_read = [this](int32_t box) { return fixed_[size_t(box)] && is_known(box); };
    named_.erase(std::remove_if(named_.begin(), named_.end(), is_read), named_.end());
    return find(poses, named_, most);
  }

  // Boxes A and B. Those listed first, then the others by the lower and the higher box.
  const std::vector<Row>& pairs() const { return pairs_; }
  // Listed pairs without both poses; (box, −1): all other pairs of a box without a pose.
  const std::vector<Row>& stale() const { return stale_; }

 private:
  // A pair is a number: the lower box, the higher one, and a bit that is set if the higher is box
  // A. Numbers are in the order of the answer.
  static constexpr int lower_bit = 32, higher_bit = 1;
  static uint64_t pair_of(int64_t a, int64_t b) {
    return uint64_t(std::min(a, b)) << lower_bit | uint64_t(std::max(a, b)) << higher_bit;
  }
  static size_t box_at(int bit, uint64_t pair) { return pair >> bit & 0x7fffffff; }

  bool is_known(int32_t box) const { return !bounds_[size_t(box)].is_nowhere(); }
  // Whether a moving box may be in other pairs than the listed ones.
  bool is_searched(int32_t box) const { return meets_[size_t(box)] && !fixed_[size_t(box)]; }

  // boxes: whose poses are read; those of the others are as they were.
  int64_t find(const double* poses, const std::vector<int32_t>& boxes, int64_t most) {
    bool was_found = is_found_;
    is_found_ = false;
    most_ = size_t(most);
    int64_t refused = read_poses(poses, boxes);
    if (was_found && refused < 0 && !is_any_moved_ && pairs_.size() <= most_) {
      is_found_ = true;
      return -1;
    }
    pairs_.clear();
    stale_.clear();
    if (refused >= 0) return refused;
    append_listed();
    for (int32_t box : to_read_)
      if (meets_[size_t(box)] && !is_known(box)) stale_.emplace_back(box, -1);
    update_kept();
    append_kept();
    is_found_ = !is_partial_ && pairs_.size() <= most_;
    return -1;
  }

  // Take the bounds of boxes. Returns −1, or one without a valid pose.
  int64_t read_poses(const double* poses, const std::vector<int32_t>& boxes) {
    changed_.clear();
    is_any_moved_ = false;
    bool is_fixed_new = false;
    for (int32_t box : boxes) {
      bool was_known = is_known(box);
      Bounds& bounds = bounds_[size_t(box)];
      const double* p = poses + 7 * int64_t(box);
      if (is_settled_[size_t(box)] && std::memcmp(p, &last_[size_t(box)], sizeof last_[0]) == 0)
        continue;
      bounds = nowhere;
      is_settled_[size_t(box)] = 0;
      searched_count_ -= was_known && is_searched(box);
      if (std::all_of(p, p + 7, [](double number) { return std::isnan(number); })) {
        is_any_moved_ |= was_known;
        continue;
      }
      is_any_moved_ = true;
      Pose<double> pose{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
      if (!pose_valid(triple(pose.position), squared_norm(pose.quaternion))) return box;
      bounds = bounds_of(pose, half_[size_t(box)]);
      is_fixed_new |= fixed_[size_t(box)];
      searched_count_ += is_searched(box);
      if (is_searched(box) && !bounds.is_within(fat_[size_t(box)])) {
        changed_.push_back(box);
      } else if (!fixed_[size_t(box)]) {
        std::memcpy(&last_[size_t(box)], p, sizeof last_[0]);
        is_settled_[size_t(box)] = 1;
      }
    }
    if (is_fixed_new) build_fixed();
    return -1;
  }

  void build_fixed() {
    is_partial_ = true;  // also where memory ends
    for (int32_t box : fixed_tree_.order())
      if (box >= 0) is_changed_[size_t(box)] = 1;
    std::vector<int32_t> all, later;
    for (int32_t box = 0; box < int32_t(count()); ++box) {
      if (!meets_[size_t(box)] || !fixed_[size_t(box)] || !is_known(box)) continue;
      all.push_back(box);
      if (!is_changed_[size_t(box)]) later.push_back(box);
    }
    is_changed_.assign(count(), 0);
    size_t gone = fixed_tree_.order().size() + later.size() - all.size();
    if (later_share * std::max(later.size(), gone) > all.size()) {
      fixed_tree_.build(all, bounds_);
      later.clear();
    }
    later_tree_.build(later, bounds_);
    auto is_read = [&](int32_t box) { return fixed_[size_t(box)] && is_known(box); };
    to_read_.erase(std::remove_if(to_read_.begin(), to_read_.end(), is_read), to_read_.end());
  }

  void append_listed() {
    for (size_t k = 0; k + 1 < asked_.listed.size() && pairs_.size() <= most_; k += 2) {
      int64_t a = asked_.listed[k], b = asked_.listed[k + 1];
      bool known = is_known(int32_t(a)) && is_known(int32_t(b));
      if (known && !bounds_[size_t(a)].overlaps(bounds_[size_t(b)])) continue;
      (known ? pairs_ : stale_).emplace_back(a, b);
    }
  }

  // Keep all pairs whose fat bounds overlap. Where most boxes left theirs, all get others.
  void update_kept() {
    bool all = is_partial_ || 2 * changed_.size() > searched_count_;
    if (all) {
      forget_kept();
    } else if (changed_.empty()) {
      return;
    }
    is_partial_ = true;  // until all is done: memory may end
    bool is_new = all;
    for (int32_t box : changed_) {
      const Vec<double>& half = half_[size_t(box)];
      double length = fattening * std::min({half[0], half[1], half[2]});
      is_new |= fat_[size_t(box)].is_nowhere();
      fat_[size_t(box)] = bounds_[size_t(box)].grown(length);
      is_changed_[size_t(box)] = 1;
    }
    auto is_of_changed = [&](uint64_t pair) {
      return is_changed_[box_at(lower_bit, pair)] || is_changed_[box_at(higher_bit, pair)];
    };
    kept_.erase(std::remove_if(kept_.begin(), kept_.end(), is_of_changed), kept_.end());
    if (is_new) {
      build_moving();
    } else {
      moving_tree_.refit(fat_);
    }
    if (all) changed_ = moving_tree_.order();
    found_.clear();
    bool is_complete = search(all);
    for (int32_t box : changed_) is_changed_[size_t(box)] = 0;
    sort_found();
    sorted_.resize(kept_.size() + found_.size());
    std::merge(kept_.begin(), kept_.end(), found_.begin(), found_.end(), sorted_.begin());
    kept_.swap(sorted_);
    is_partial_ = !is_complete;
  }

  void forget_kept() {
    if (is_partial_) fat_.assign(count(), nowhere), is_changed_.assign(count(), 0);
    kept_.clear();
    changed_.clear();
    for (int32_t box : moving_tree_.order()) fat_[size_t(box)] = nowhere;
    for (int32_t box : to_read_)
      if (is_searched(box) && is_known(box)) changed_.push_back(box);
  }

  // All boxes with fat bounds are in the tree.
  void build_moving() {
    boxes_.clear();
    for (int32_t box : to_read_)
      if (!fat_[size_t(box)].is_nowhere()) boxes_.push_back(box);
    moving_tree_.build(boxes_, fat_);
  }

  // Search for pairs of the boxes that changed, or of all boxes, which are in the tree's order.
  // Returns false with too many pairs.
  bool search(bool all) {
    near_count_ = pairs_.size();
    for (size_t index = 0; index < changed_.size(); ++index) {
      if (!all && moving_tree_.is_worn()) build_moving();
      int32_t box = changed_[index];
      auto take = [&](int32_t other) {
        bool is_twice = !all && is_changed_[size_t(other)] && other <= box;
        return is_twice || add(box, other);
      };
      const Bounds& fat = fat_[size_t(box)];
      if (!fixed_tree_.each_near(fat, 0, take) || !later_tree_.each_near(fat, 0, take) ||
          !moving_tree_.each_near(fat, all ? index + 1 : 0, take))
        return false;
    }
    return true;
  }

  // Take two boxes whose fat bounds overlap, if they are asked for. Returns false with too many.
  bool add(int32_t a, int32_t b) {
    if (body_[size_t(a)] == body_[size_t(b)]) return true;
    uint8_t side = asked_.side(std::min(a, b), std::max(a, b));
    uint64_t pair = pair_of(a, b);
    if (!side || std::binary_search(listed_.begin(), listed_.end(), pair)) return true;
    found_.push_back(pair | uint64_t(side == 2));
    near_count_ += bounds_[size_t(a)].overlaps(bounds_[size_t(b)]);
    return near_count_ <= most_;
  }

  void sort_found() {
    if (found_.size() < count() / 8) {
      std::sort(found_.begin(), found_.end());
    } else {
      sort_found_by(higher_bit);
      sort_found_by(lower_bit);
    }
  }
  // Counting sort by one box. Pairs of the same box keep their order.
  void sort_found_by(int bit) {
    sorted_.resize(found_.size());
    begins_.assign(count() + 1, 0);
    for (uint64_t pair : found_) ++begins_[box_at(bit, pair) + 1];
    for (size_t box = 1; box < begins_.size(); ++box) begins_[box] += begins_[box - 1];
    for (uint64_t pair : found_) sorted_[begins_[box_at(bit, pair)]++] = pair;
    found_.swap(sorted_);
  }

  void append_kept() {
    for (uint64_t pair : kept_) {
      size_t a = box_at(lower_bit, pair), b = box_at(higher_bit, pair);
      if (!bounds_[a].overlaps(bounds_[b])) continue;
      if (pairs_.size() > most_) {
        is_partial_ = true;  // so that kept pairs take no more memory
        return;
      }
      if (pair & 1) std::swap(a, b);
      pairs_.emplace_back(int64_t(a), int64_t(b));
    }
  }

  std::vector<Vec<double>> half_;
  std::vector<uint8_t> fixed_;
  std::vector<int32_t> body_;
  Asked asked_;
  std::vector<uint64_t> listed_;  // the listed pairs, sorted
  std::vector<uint8_t> meets_;    // boxes that some group lets meet
  std::vector<int32_t> to_read_;  // all boxes but the fixed ones that are known
  // Of the last call.
  std::vector<Bounds> bounds_;
  std::vector<Row> pairs_, stale_;
  bool is_found_ = false;  // whether it answered: all poses were read, and all pairs found
  // From call to call.
  std::vector<Bounds> fat_;
  std::unique_ptr<std::array<double, 7>[]> last_;  // the pose of a box that is settled
  std::vector<uint8_t> is_settled_;  // whether the bounds are those of it, within the fat ones
  std::vector<uint64_t> kept_;
  bool is_partial_ = false;  // not all pairs whose fat bounds overlap are kept
  BoundsTree fixed_tree_, later_tree_, moving_tree_;
  // Memory that calls use again.
  size_t most_ = 0, searched_count_ = 0, near_count_ = 0;
  bool is_any_moved_ = false;
  std::vector<int32_t> named_, changed_, boxes_;
  std::vector<uint8_t> is_changed_;
  std::vector<size_t> begins_;
  std::vector<uint64_t> found_, sorted_;
};

}  // namespace box_contact::detail
