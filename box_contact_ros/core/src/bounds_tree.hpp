// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Axis-aligned bounding boxes, and a tree to search many of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "poses.hpp"

namespace box_contact::detail {

// Bounds grow on all sides by this share of the box's largest coordinate or extent. Boxes touch up
// to a separation of 8 ulp. The largest gap on the SAT axes is at least 1/√3 of the distance, so 14
// ulp; the rest is for the rounding of separation and bounds.
constexpr double widening = 64.0 * 0x1p-52;

// An axis-aligned bounding box, common frame [m]: its low corner, and its high corner negated. All
// six numbers of the bounds around several are then minima.
struct Bounds {
  double ends[6];

  bool is_nowhere() const { return ends[0] == infinity; }
  bool overlaps(const Bounds& other) const {
    double gap = ends[0] + other.ends[3];
    for (int k = 1; k < 6; ++k) gap = std::max(gap, ends[k] + other.ends[(k + 3) % 6]);
    return gap <= 0.0;
  }
  bool is_within(const Bounds& other) const {
    double least = ends[0] - other.ends[0];
    for (int k = 1; k < 6; ++k) least = std::min(least, ends[k] - other.ends[k]);
    return least >= 0.0;
  }
  // How far apart they are, at most the distance of what is within [m].
  double gap(const Bounds& other) const {
    double square = 0.0;
    for (int k = 0; k < 3; ++k) {
      double apart = std::max({0.0, ends[k] + other.ends[k + 3], ends[k + 3] + other.ends[k]});
      square += apart * apart;
    }
    return std::sqrt(square);
  }
  Bounds around(const Bounds& other) const {
    Bounds both;
    for (int k = 0; k < 6; ++k) both.ends[k] = std::min(ends[k], other.ends[k]);
    return both;
  }
  Bounds grown(double length) const {
    Bounds larger;
    for (int k = 0; k < 6; ++k) larger.ends[k] = ends[k] - length;
    return larger;
  }
};
constexpr Bounds nowhere{{infinity, infinity, infinity, infinity, infinity, infinity}};

inline Bounds bounds_of(const Pose<double>& pose, const Vec<double>& half) {
  Mat<double> axes = rotation_matrix(pose.quaternion);
  double reach[3], largest = 0.0;
  for (int k = 0; k < 3; ++k) {
    reach[k] = dot(abs(row(axes, k)), half);
    largest = std::max(largest, std::fabs(pose.position[k]) + 2.0 * reach[k]);
  }
  Bounds bounds;
  for (int k = 0; k < 3; ++k) {
    bounds.ends[k] = pose.position[k] - reach[k] - widening * largest;
    bounds.ends[k + 3] = -pose.position[k] - reach[k] - widening * largest;
  }
  return bounds;
}

// Sixteen boxes that are near each other share a block. Sixteen blocks share a block of the next
// level, up to the root. A search tests all bounds of a block at once.
class BoundsTree {
 public:
  // The boxes, in the order of the tree; below 0: one that is in it no more.
  const std::vector<int32_t>& order() const { return order_; }

  // Whether searches since the tree was built have visited so many blocks that building it anew
  // costs less. The order of boxes that moved far tells little.
  bool is_worn(size_t visits) const { return visits > 4 * size_t(levels_) * order_.size(); }

  // Where memory ends, the tree stays as it was.
  void build(const std::vector<int32_t>& boxes, const std::vector<Bounds>& bounds) {
    size_t starts[levels_max], blocks = 0;
    int levels = 0;
    for (size_t count = boxes.size(); count > size_t(levels > 0); ++levels) {
      starts[levels] = blocks;
      count = (count + width - 1) / width;
      blocks += count;
    }
    order_.reserve(boxes.size());
    blocks_.reserve(blocks);
    order_ = boxes;
    blocks_.assign(blocks, Block());
    std::copy_n(starts, levels, starts_);
    levels_ = levels;
    halve(order_.data(), order_.data() + order_.size(), bounds);
    refit(bounds);
  }

  // Take other bounds of the same boxes.
  void refit(const std::vector<Bounds>& bounds) {
    for (size_t index = 0; index < order_.size(); ++index)
      blocks_[index / width].set(index % width, bounds[size_t(order_[index])]);
    for (int level = 1; level < levels_; ++level)
      for (size_t below = starts_[level - 1]; below < starts_[level]; ++below) {
        size_t index = below - starts_[level - 1];
        blocks_[starts_[level] + index / width].set(index % width, blocks_[below].around());
      }
  }

  // Take other bounds of the box at an index of the order.
  void refit_one(size_t index, const Bounds& bounds) {
    blocks_[index / width].set(index % width, bounds);
    for (int level = 1; level < levels_; ++level) {
      index /= width;
      blocks_[starts_[level] + index / width].set(index % width,
                                                  blocks_[starts_[level - 1] + index].around());
    }
  }

  // Give the boxes other numbers; those below 0 are in the tree no more.
  void renumber(const std::vector<int32_t>& number_of) {
    for (size_t index = 0; index < order_.size(); ++index) {
      int32_t& box = order_[index];
      if (box >= 0) box = number_of[size_t(box)];
      if (box < 0) blocks_[index / width].set(index % width, nowhere);
    }
  }

  // Call `visit` with each box from index `first` on whose bounds overlap, until it returns false.
  // Returns whether it never did. visits: how many blocks were visited, is added.
  template <class Visit>
  bool each_near(const Bounds& bounds, size_t first, Visit visit, size_t& visits) const {
    return levels_ == 0 || each_below(levels_ - 1, 0, bounds, first, visit, visits);
  }

 private:
  static constexpr size_t width = 16;
  static constexpr int width_bits = 4;
  static constexpr int levels_max = 8;  // 16⁸ exceeds the number of boxes

  struct Block {
    double ends[6][width];

    Block() {
      for (auto& end : ends) std::fill_n(end, width, infinity);
    }
    void set(size_t index, const Bounds& bounds) {
      for (int k = 0; k < 6; ++k) ends[k][index] = bounds.ends[k];
    }
    Bounds around() const {
      Bounds bounds = nowhere;
      for (int k = 0; k < 6; ++k)
        for (double end : ends[k]) bounds.ends[k] = std::min(bounds.ends[k], end);
      return bounds;
    }
    // A bit for each of the bounds that overlap.
    unsigned overlapping(const Bounds& bounds) const {
      using Two = Lanes<double, 2>;
      unsigned found = 0;
      for (size_t index = 0; index < width; index += 2) {
        Two gap = splat<Two>(-infinity);
        for (int k = 0; k < 6; ++k) {
          Two end;
          std::memcpy(&end, &ends[k][index], sizeof end);
          gap = max(end + splat<Two>(bounds.ends[(k + 3) % 6]), gap);
        }
        found |= bits(gap <= 0.0) << index;
      }
      return found;
    }
  };

  template <class Visit>
  bool each_below(int level, size_t block, const Bounds& bounds, size_t first, Visit& visit,
                  size_t& visits) const {
    ++visits;
    unsigned near = blocks_[starts_[level] + block].overlapping(bounds);
    size_t begin = width * block, first_here = first >> (width_bits * level);
    if (first_here > begin) near &= ~0U << (first_here - begin);
    for (; near; near &= near - 1) {
      size_t index = begin + size_t(__builtin_ctz(near));
      if (level ? !each_below(level - 1, index, bounds, first, visit, visits)
                : !visit(order_[index]))
        return false;
    }
    return true;
  }

  // Order boxes: halve them along the axis on which they are spread most, and so on.
  static void halve(int32_t* begin, int32_t* end, const std::vector<Bounds>& bounds) {
    while (end - begin > long(width)) {
      long half = width;  // times a power of two: all blocks of a level but the last are full
      while (2 * half < end - begin) half *= 2;
      double low[3] = {infinity, infinity, infinity}, high[3] = {-infinity, -infinity, -infinity};
      for (const int32_t* box = begin; box < end; ++box)
        for (int k = 0; k < 3; ++k) {
          low[k] = std::min(low[k], bounds[size_t(*box)].ends[k]);
          high[k] = std::max(high[k], bounds[size_t(*box)].ends[k]);
        }
      int axis = 0;
      for (int k = 1; k < 3; ++k)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
      std::nth_element(begin, begin + half, end, [&](int32_t a, int32_t b) {
        return bounds[size_t(a)].ends[axis] < bounds[size_t(b)].ends[axis];
      });
      halve(begin, begin + half, bounds);
      begin += half;
    }
  }

  std::vector<int32_t> order_;
  std::vector<Block> blocks_;  // those of boxes, then level by level up to the root
  size_t starts_[levels_max] = {};
  int levels_ = 0;
};

}  // namespace box_contact::detail
