// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which boxes that move may touch each other, or boxes of an index.
//
// Fat bounds are a bounding box, grown a little. The pairs whose fat bounds overlap are kept from
// call to call. While a box stays within its fat bounds, it can be near the boxes of its kept pairs
// alone. So a call tests the kept pairs, and searches for others for the boxes that left their fat
// bounds, in a tree of fat bounds and in the index. Where no box has moved, the last answer holds.
#pragma once

#include <array>
#include <cstring>
#include <memory>

#include "filter.hpp"
#include "index.hpp"

namespace box_contact::detail {

// Fat bounds grow by this share of a box's shortest half extent. With more, each call tests more
// pairs. With less, a box leaves its fat bounds sooner.
constexpr double fattening = 0.1;

class Movers {
 public:
  // half: half extents of each box. margin: boxes whose distance is at most that are near [m]. The boxes
  // that the index has do not move. Filter and index, which may be nullptr, outlive the movers.
  Movers(std::vector<Vec<double>> half, double margin, const Filter* filter, const Index* index)
      : half_(std::move(half)),
        reach_(0.5 * margin),
        filter_(*filter),
        index_(index),
        meets_(half_.size(), 0),
        bounds_(half_.size(), nowhere),
        fat_(half_.size(), nowhere),
        last_(new std::array<double, 7>[half_.size()]),
        is_settled_(half_.size(), 0),
        is_changed_(half_.size(), 0) {
    for (int32_t box = 0; box < int32_t(count()); ++box) {
      for (int k = 0; k < 3; ++k) half_[size_t(box)][k] += reach_;
      meets_[size_t(box)] = filter_.meets(box);
      if (is_fixed(box)) bounds_[size_t(box)] = index_->bounds(box).grown(reach_);
      else to_read_.push_back(box);
    }
  }

  size_t count() const { return half_.size(); }

  // Find the pairs that may touch at `poses` (boxes, 7), of which those of fixed boxes are not read. Seven
  // NaN: the box is not there. Stops with more than `most` pairs. Returns −1, or a box without a valid
  // pose; nothing is found then.
  int64_t find(const double* poses, int64_t most) {
    bool was_found = is_found_;
    is_found_ = false;
    most_ = size_t(most);
    int64_t refused = read_poses(poses);
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

  // Boxes A and B. Those listed first, then the others by the lower and the higher box.
  const std::vector<BoxPair>& pairs() const { return pairs_; }
  // Listed pairs without both poses; (box, −1): all other pairs of a box without a pose.
  const std::vector<BoxPair>& stale() const { return stale_; }

 private:
  // A pair is a number: the lower box, the higher one, and a bit that is set if the higher is box
  // A. Numbers are in the order of the answer.
  static constexpr int lower_bit = 32, higher_bit = 1;
  static uint64_t pair_of(int64_t a, int64_t b) {
    return uint64_t(std::min(a, b)) << lower_bit | uint64_t(std::max(a, b)) << higher_bit;
  }
  static size_t box_at(int bit, uint64_t pair) { return pair >> bit & 0x7fffffff; }

  bool is_fixed(int32_t box) const { return index_ && index_->has(box); }
  bool is_known(int64_t box) const { return !bounds_[size_t(box)].is_nowhere(); }
  // Whether a moving box may be in other pairs than the listed ones.
  bool is_searched(int32_t box) const { return meets_[size_t(box)]; }

  // Take the bounds of boxes. Returns −1, or one without a valid pose.
  int64_t read_poses(const double* poses) {
    changed_.clear();
    is_any_moved_ = false;
    for (int32_t box : to_read_) {
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
      searched_count_ += is_searched(box);
      if (is_searched(box) && !bounds.is_within(fat_[size_t(box)])) {
        changed_.push_back(box);
      } else {
        std::memcpy(&last_[size_t(box)], p, sizeof last_[0]);
        is_settled_[size_t(box)] = 1;
      }
    }
    return -1;
  }

  void append_listed() {
    for (const BoxPair& pair : filter_.listed) {
      if (pairs_.size() > most_) return;
      bool known = is_known(pair.a) && is_known(pair.b);
      if (known && !bounds_[size_t(pair.a)].overlaps(bounds_[size_t(pair.b)])) continue;
      (known ? pairs_ : stale_).push_back(pair);
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
      tree_.refit(fat_);
    }
    if (all) changed_ = tree_.order();
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
    for (int32_t box : tree_.order()) fat_[size_t(box)] = nowhere;
    for (int32_t box : to_read_)
      if (is_searched(box) && is_known(box)) changed_.push_back(box);
  }

  // All boxes with fat bounds are in the tree.
  void build_moving() {
    visits_ = 0;
    boxes_.clear();
    for (int32_t box : to_read_)
      if (!fat_[size_t(box)].is_nowhere()) boxes_.push_back(box);
    tree_.build(boxes_, fat_);
  }

  // Search for pairs of the boxes that changed, or of all boxes, which are in the tree's order.
  // Returns false with too many pairs.
  bool search(bool all) {
    near_count_ = pairs_.size();
    for (size_t index = 0; index < changed_.size(); ++index) {
      if (!all && tree_.is_worn(visits_)) build_moving();
      int32_t box = changed_[index];
      auto take = [&](int32_t other) {
        bool is_twice = !all && is_changed_[size_t(other)] && other <= box;
        return is_twice || add(box, other);
      };
      const Bounds& fat = fat_[size_t(box)];
      if ((index_ && !index_->each_near(fat.grown(reach_), take)) ||
          !tree_.each_near(fat, all ? index + 1 : 0, take, visits_))
        return false;
    }
    return true;
  }

  // Take two boxes whose fat bounds overlap, if they are asked for. Returns false with too many.
  bool add(int32_t a, int32_t b) {
    uint8_t side = filter_.side(std::min(a, b), std::max(a, b));
    if (!side) return true;
    found_.push_back(pair_of(a, b) | uint64_t(side == 2));
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

  std::vector<Vec<double>> half_;  // larger by `reach_`
  double reach_;                   // half the margin, by which all bounds are grown [m]
  const Filter& filter_;
  const Index* index_;
  std::vector<uint8_t> meets_;    // boxes that some group lets meet
  std::vector<int32_t> to_read_;  // all boxes but the fixed ones
  // Of the last call.
  std::vector<Bounds> bounds_;
  std::vector<BoxPair> pairs_, stale_;
  bool is_found_ = false;  // whether it answered: all poses were read, and all pairs found
  // From call to call.
  std::vector<Bounds> fat_;
  std::unique_ptr<std::array<double, 7>[]> last_;  // the pose of a box that is settled
  std::vector<uint8_t> is_settled_;  // whether the bounds are those of it, within the fat ones
  std::vector<uint64_t> kept_;
  bool is_partial_ = false;  // not all pairs whose fat bounds overlap are kept
  BoundsTree tree_;
  // Memory that calls use again.
  size_t most_ = 0, searched_count_ = 0, near_count_ = 0, visits_ = 0;
  bool is_any_moved_ = false;
  std::vector<int32_t> changed_, boxes_;
  std::vector<uint8_t> is_changed_;
  std::vector<size_t> begins_;
  std::vector<uint64_t> found_, sorted_;
};

}  // namespace box_contact::detail
