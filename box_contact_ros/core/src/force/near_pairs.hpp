// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs of boxes an advance solves, where the forces find them themselves: those of a box that is
// active, as its body is awake or moves though no force moves it.
//
// Each box has fat bounds in a tree: its bounding box, grown by what it may fall and a little more. They
// stay while the box is within them. So only active boxes are looked at, and partners are searched for
// those alone that left their fat bounds. Where none did, an advance has the pairs of the last one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "../movers.hpp"
#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

class NearPairs {
 public:
  // By the lower and the higher box.
  const std::vector<BoxPair>& pairs() const { return pairs_; }

  void set_boxes(const std::vector<bc_body_box>& boxes) {
    size_t bodies = 0;
    for (const bc_body_box& box : boxes) bodies = std::max(bodies, size_t(box.body) + 1);
    begins_.assign(bodies + 1, 0);
    for (const bc_body_box& box : boxes) ++begins_[size_t(box.body)];
    for (size_t body = 0, sum = 0; body < begins_.size(); ++body) begins_[body] = sum += begins_[body];
    of_body_.resize(boxes.size());
    for (size_t box = boxes.size(); box-- > 0;)
      of_body_[--begins_[size_t(boxes[box].body)]] = int32_t(box);
    is_searched_.assign(boxes.size(), 0);
    place_.resize(boxes.size());
    active_.clear();
    forget();
  }
  // The next search begins anew.
  void forget() { longest_ = 0.0; }
  // The longest step since then [s].
  double longest_step() const { return longest_; }

  // Find the pairs of a step `dt`. `each_active(visit)` visits the bodies that are active, which are others
  // only if `revision` is another. `place(box, dt)` gives the bounds around a box, with what it falls in
  // a step. Returns whether pairs may be others than before.
  template <class EachActive, class Place>
  bool find(double dt, int64_t revision, const std::vector<bc_body_box>& boxes,
            const std::vector<Body>& bodies, const EachActive& each_active, const Place& place) {
    bool all = dt > longest_, anew = all || revision != revision_;
    longest_ = std::max(longest_, dt);
    revision_ = revision;
    if (anew) list(each_active);
    left_.clear();
    auto look = [&](int32_t box) {
      detail::Bounds bounds = place(box, longest_), &fat = fat_[size_t(box)];
      if (bounds.is_within(fat)) return;
      const double(&size)[3] = boxes[size_t(box)].box.size.extent;
      fat = bounds.grown(0.5 * detail::fattening * std::min({size[0], size[1], size[2]}));
      left_.push_back(box);
    };
    if (all) fat_.assign(boxes.size(), detail::nowhere);
    if (all)
      for (int32_t box : of_body_) look(box);
    else
      for (int32_t box : active_) look(box);
    if (all || (!left_.empty() && tree_.is_worn(visits_)))
      build();
    else
      for (int32_t box : left_) tree_.refit_one(place_[size_t(box)], fat_[size_t(box)]);
    if (!anew && left_.empty()) return false;
    search(anew, boxes, bodies);
    return true;
  }

 private:
  template <class EachActive>
  void list(const EachActive& each_active) {
    active_.clear();
    each_active([&](size_t body) {
      if (body + 1 >= begins_.size()) return;  // it has no box
      for (size_t k = begins_[body]; k < begins_[body + 1]; ++k) active_.push_back(of_body_[k]);
    });
  }
  void build() {
    visits_ = 0;
    tree_.build(of_body_, fat_);
    for (size_t index = 0; index < tree_.order().size(); ++index)
      place_[size_t(tree_.order()[index])] = index;
  }
  // Search for the partners of all boxes that are active, or of those that left their fat bounds.
  void search(bool anew, const std::vector<bc_body_box>& boxes, const std::vector<Body>& bodies) {
    const std::vector<int32_t>& searched = anew ? active_ : left_;
    for (int32_t box : searched) is_searched_[size_t(box)] = 1;
    auto is_of_searched = [this](const BoxPair& pair) {
      return is_searched_[size_t(pair.first)] || is_searched_[size_t(pair.second)];
    };
    if (anew) pairs_.clear();
    pairs_.erase(std::remove_if(pairs_.begin(), pairs_.end(), is_of_searched), pairs_.end());
    auto kept = long(pairs_.size());
    for (int32_t box : searched) {
      auto body = size_t(boxes[size_t(box)].body);
      tree_.each_near(fat_[size_t(box)], 0, [&](int32_t other) {
        auto its = size_t(boxes[size_t(other)].body);
        bool is_twice = is_searched_[size_t(other)] && other <= box;
        bool is_pair = its != body && (bodies[its].is_free() || bodies[body].is_free());
        if (is_pair && !is_twice) pairs_.push_back(std::minmax(box, other));
        return true;
      }, visits_);
    }
    for (int32_t box : searched) is_searched_[size_t(box)] = 0;
    std::sort(pairs_.begin() + kept, pairs_.end());
    std::inplace_merge(pairs_.begin(), pairs_.begin() + kept, pairs_.end());
  }

  std::vector<size_t> begins_;    // of each body, among the boxes by body
  std::vector<int32_t> of_body_;  // boxes, by body
  std::vector<BoxPair> pairs_;
  double longest_ = 0.0;  // [s]; 0: no box has fat bounds
  int64_t revision_ = 0;
  std::vector<int32_t> active_, left_;
  std::vector<uint8_t> is_searched_;
  std::vector<detail::Bounds> fat_;
  std::vector<size_t> place_;  // of each box in the tree
  detail::BoundsTree tree_;
  size_t visits_ = 0;  // of its blocks, since it was built
};

}  // namespace box_contact::BOX_CONTACT_SET::force
