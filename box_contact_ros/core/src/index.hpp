// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The boxes of a scene that never move, by where they are. It does not change: where boxes come and
// go, the next index takes over what it can.
#pragma once

#include "bounds_tree.hpp"

namespace box_contact::detail {

class Index {
 public:
  // Boxes by number, with poses and sizes that are valid. Seven NaN: a box that is not in the index.
  Index(std::vector<Pose<double>> poses, std::vector<Vec<double>> sizes) { take(poses, sizes); }
  // The same, after `former`. kept: the number in `former` of each box that has the same size and pose
  // there, or −1.
  Index(const Index& former, const int64_t* kept, std::vector<Pose<double>> poses,
        std::vector<Vec<double>> sizes) {
    std::vector<int32_t> number_of(former.count(), -1);
    for (size_t box = 0; box < poses.size(); ++box)
      if (kept[box] >= 0 && former.has(kept[box])) number_of[size_t(kept[box])] = int32_t(box);
    tree_ = former.tree_;
    tree_.renumber(number_of);
    take(poses, sizes);
  }

  size_t count() const { return bounds_.size(); }
  bool has(int64_t box) const { return !bounds_[size_t(box)].is_nowhere(); }
  const Bounds& bounds(int64_t box) const { return bounds_[size_t(box)]; }
  const Pose<double>& pose(int64_t box) const { return poses_[size_t(box)]; }
  const Vec<double>& size(int64_t box) const { return sizes_[size_t(box)]; }

  // Call `visit` with each box whose bounds overlap, until it returns false. Returns whether it never
  // did.
  template <class Visit>
  bool each_near(const Bounds& bounds, Visit visit) const {
    size_t visits = 0;
    return tree_.each_near(bounds, 0, visit, visits) && later_.each_near(bounds, 0, visit, visits);
  }

 private:
  // Boxes that came later are in a tree of their own up to this share of all.
  static constexpr size_t later_share = 8;

  void take(std::vector<Pose<double>>& poses, std::vector<Vec<double>>& sizes) {
    poses_.swap(poses), sizes_.swap(sizes);
    std::vector<uint8_t> is_kept(poses_.size(), 0);
    for (int32_t box : tree_.order())
      if (box >= 0) is_kept[size_t(box)] = 1;
    std::vector<int32_t> all, later;
    bounds_.assign(poses_.size(), nowhere);
    for (int32_t box = 0; box < int32_t(poses_.size()); ++box) {
      if (std::isnan(poses_[size_t(box)].position[0])) continue;
      bounds_[size_t(box)] = bounds_of(poses_[size_t(box)], 0.5 * sizes_[size_t(box)]);
      all.push_back(box);
      if (!is_kept[size_t(box)]) later.push_back(box);
    }
    size_t gone = tree_.order().size() + later.size() - all.size();
    if (later_share * std::max(later.size(), gone) > all.size()) {
      tree_.build(all, bounds_);
      later.clear();
    }
    later_.build(later, bounds_);
  }

  std::vector<Pose<double>> poses_;
  std::vector<Vec<double>> sizes_;
  std::vector<Bounds> bounds_;  // nowhere: not in the index
  BoundsTree tree_, later_;
};

}  // namespace box_contact::detail
