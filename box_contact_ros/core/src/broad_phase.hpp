// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs of many boxes may touch: sweep and prune of bounding boxes, tile by tile.
//
// Two axes are divided into tiles twice as wide as a typical box. A box is an entry of each tile it
// reaches. Along the third axis the boxes are sorted by where they begin. In each tile, a box meets
// those that begin before it ends. The cost per box does not grow with their number.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "poses.hpp"

namespace box_contact::detail {

// Bounds grow on all sides by this share of the box's largest coordinate or extent. Boxes touch up
// to a separation of 8 ulp. The largest gap on the SAT axes is at least 1/√3 of the distance, so 14
// ulp; the rest is for the rounding of separation and bounds.
constexpr double widening = 64.0 * 0x1p-52;

// An axis-aligned bounding box, common frame [m].
struct Bounds {
  double low[3], high[3];

  bool overlaps(const Bounds& other) const {
    bool apart = false;
    for (int k = 0; k < 3; ++k) apart |= (low[k] > other.high[k]) | (other.low[k] > high[k]);
    return !apart;
  }
};

inline Bounds bounds_of(const Pose<double>& pose, const Vec<double>& half) {
  Mat<double> axes = rotation_matrix(pose.quaternion);
  double reach[3], largest = 0.0;
  for (int k = 0; k < 3; ++k) {
    reach[k] = dot(abs(row(axes, k)), half);
    largest = std::max(largest, std::fabs(pose.position[k]) + 2.0 * reach[k]);
  }
  Bounds bounds;
  for (int k = 0; k < 3; ++k) {
    bounds.low[k] = pose.position[k] - reach[k] - widening * largest;
    bounds.high[k] = pose.position[k] + reach[k] + widening * largest;
  }
  return bounds;
}

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
  // half: half extents of each box, larger by half the margin [m]. fixed: which boxes never move,
  // and never meet each other. body: of each box; boxes of one body never meet each other.
  BroadPhase(std::vector<Vec<double>> half, double margin, std::vector<uint8_t> fixed,
             std::vector<int32_t> body, Asked asked)
      : margin(margin),
        half_(std::move(half)),
        fixed_(std::move(fixed)),
        body_(std::move(body)),
        asked_(std::move(asked)),
        bounds_(half_.size(), Bounds{}),
        known_(half_.size(), 0),
        is_alone_(half_.size(), 0) {
    for (size_t k = 0; k + 1 < asked_.listed.size(); k += 2)
      listed_keys_.push_back(key(asked_.listed[k], asked_.listed[k + 1]));
    std::sort(listed_keys_.begin(), listed_keys_.end());
    std::vector<uint8_t> meets(size_t(asked_.groups), 0);
    for (size_t k = 0; k < asked_.allowed.size(); ++k)
      if (asked_.allowed[k])
        meets[k / size_t(asked_.groups)] = meets[k % size_t(asked_.groups)] = 1;
    for (int32_t box = 0; asked_.groups && box < int32_t(half_.size()); ++box)
      if (meets[size_t(asked_.group[box])]) members_.push_back(box), order_.push_back({0.0, box});
  }

  const double margin;  // [m]
  size_t count() const { return half_.size(); }
  bool is_fixed(int64_t box) const { return fixed_[size_t(box)]; }
  void resize(int64_t box, const Vec<double>& half) { half_[size_t(box)] = half; }

  // Find the pairs that may touch at `poses` (boxes, 7); seven NaN: the box is not there. The poses
  // of fixed boxes are read once. Stops with more than `most` pairs. Returns −1, or a box without a
  // valid pose; nothing is found then.
  int64_t find(const double* poses, int64_t most) {
    pairs_.clear();
    stale_.clear();
    found_.clear();
    most_ = size_t(most);
    for (size_t box = 0; box < half_.size(); ++box) {
      if (fixed_[box] && known_[box]) continue;
      const double* p = poses + 7 * box;
      known_[box] = !std::all_of(p, p + 7, [](double number) { return std::isnan(number); });
      if (!known_[box]) continue;
      Pose<double> pose{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
      if (!pose_valid(triple(pose.position), squared_norm(pose.quaternion)))
        return known_[box] = 0, int64_t(box);
      bounds_[box] = bounds_of(pose, half_[box]);
    }
    test_listed();
    sweep();
    append_found();
    return -1;
  }

  // (n, 2): boxes A and B. Those listed first, then the others by the lower and the higher box.
  const std::vector<int64_t>& pairs() const { return pairs_; }
  // (n, 2): listed pairs without both poses; (box, −1): all other pairs of a box without a pose.
  const std::vector<int64_t>& stale() const { return stale_; }

 private:
  // Moving boxes up to which each is compared with every box: sorting all takes longer.
  static constexpr size_t few = 32;
  // Tiles that a box may be in. One that reaches more is compared with every box.
  static constexpr int64_t most_tiles = 16;

  struct Place {
    double low;  // where the box begins on the swept axis
    int32_t box;
  };
  struct Reach {
    Bounds bounds;
    int32_t box;
    uint32_t first[2], last[2];  // tiles that it reaches
  };
  struct Entry {
    uint32_t reach, tile[2];
  };
  struct Tiling {
    int swept, tiled[2];
    double per_width[2];  // tiles per metre

    uint32_t tile(int axis, double coordinate) const {
      return uint32_t(std::min(std::max(coordinate * per_width[axis], -1e9), 1e9) + 1e9);
    }
  };
  struct Found {
    int32_t lower, higher;
    uint8_t side;
  };

  static uint64_t key(int64_t a, int64_t b) {
    return uint64_t(std::min(a, b)) << 32 | uint64_t(std::max(a, b));
  }
  static size_t hash(uint32_t u, uint32_t v) {
    uint32_t mixed = u * 0x9e3779b1U + v * 0x85ebca77U;
    return mixed ^ mixed >> 15;
  }

  bool is_full() const { return found_.size() + pairs_.size() / 2 > most_; }

  void test_listed() {
    for (size_t k = 0; k + 1 < asked_.listed.size() && !is_full(); k += 2) {
      int64_t a = asked_.listed[k], b = asked_.listed[k + 1];
      bool known = known_[size_t(a)] && known_[size_t(b)];
      if (known && !bounds_[size_t(a)].overlaps(bounds_[size_t(b)])) continue;
      std::vector<int64_t>& rows = known ? pairs_ : stale_;
      rows.push_back(a);
      rows.push_back(b);
    }
  }

  // Take two boxes whose bounds overlap, if they are asked for. Returns false with too many pairs.
  bool add(int32_t a, int32_t b) {
    if (fixed_[size_t(a)] && fixed_[size_t(b)]) return true;
    if (body_[size_t(a)] == body_[size_t(b)]) return true;
    if (a > b) std::swap(a, b);
    uint8_t side = asked_.side(a, b);
    if (!side) return true;
    if (std::binary_search(listed_keys_.begin(), listed_keys_.end(), key(a, b))) return true;
    found_.push_back({a, b, side});
    return !is_full();
  }

  void sweep() {
    alone_.clear();
    size_t moving = 0;
    for (int32_t box : members_) {
      is_alone_[size_t(box)] = 0;
      moving += !fixed_[size_t(box)] && known_[size_t(box)];
      if (!known_[size_t(box)]) stale_.insert(stale_.end(), {box, -1});
    }
    if (moving <= few) {
      for (int32_t box : members_)
        if (!fixed_[size_t(box)] && known_[size_t(box)]) set_alone(box);
    } else if (!sweep_tiles()) {
      return;
    }
    for (int32_t a : alone_)
      for (int32_t b : members_) {
        bool twice = is_alone_[size_t(b)] && b <= a;
        if (known_[size_t(b)] && !twice && bounds_[size_t(a)].overlaps(bounds_[size_t(b)]) &&
            !add(a, b))
          return;
      }
  }

  void set_alone(int32_t box) {
    alone_.push_back(box);
    is_alone_[size_t(box)] = 1;
  }

  // Sort the boxes, spread them over the tiles, and sweep each tile. Tiles share a table by their
  // hash, so that neither far coordinates nor empty space take memory.
  bool sweep_tiles() {
    Tiling tiling = choose_tiling();
    for (Place& place : order_) place.low = bounds_[size_t(place.box)].low[tiling.swept];
    sort_order();
    reaches_.clear();
    size_t entries = 0;
    for (const Place& place : order_) {
      if (!known_[size_t(place.box)]) continue;
      Reach reach{bounds_[size_t(place.box)], place.box, {}, {}};
      int64_t tiles = 1;
      for (int t = 0; t < 2; ++t) {
        reach.first[t] = tiling.tile(t, reach.bounds.low[tiling.tiled[t]]);
        reach.last[t] = tiling.tile(t, reach.bounds.high[tiling.tiled[t]]);
        tiles *= int64_t(reach.last[t]) - reach.first[t] + 1;
      }
      if (tiles > most_tiles) {
        set_alone(place.box);
        continue;
      }
      reaches_.push_back(reach);
      entries += size_t(tiles);
    }
    fill_table(entries);
    for (size_t slot = 0; slot + 1 < starts_.size(); ++slot)
      if (!sweep_slot(starts_[slot], starts_[slot + 1], tiling.swept)) return false;
    return true;
  }

  // Sweep the axis on which the boxes are spread least, by a sample of them.
  Tiling choose_tiling() {
    size_t step = std::max<size_t>(1, order_.size() / 256);
    double width[3], spread[3];
    for (int k = 0; k < 3; ++k) {
      sample_.clear();
      double least = HUGE_VAL, most = -HUGE_VAL;
      for (size_t i = 0; i < order_.size(); i += step) {
        const Bounds& bounds = bounds_[size_t(order_[i].box)];
        if (!known_[size_t(order_[i].box)]) continue;
        sample_.push_back(bounds.high[k] - bounds.low[k]);
        least = std::min(least, bounds.low[k]);
        most = std::max(most, bounds.low[k]);
      }
      auto middle = sample_.begin() + long(sample_.size() / 2);
      std::nth_element(sample_.begin(), middle, sample_.end());
      width[k] = sample_.empty() ? 1.0 : 2.0 * *middle;
      spread[k] = (most - least) / width[k];
    }
    int swept = int(std::min_element(spread, spread + 3) - spread);
    int u = (swept + 1) % 3, v = (swept + 2) % 3;
    return {swept, {u, v}, {1.0 / width[u], 1.0 / width[v]}};
  }

  // Insertion sort: the order of the tick before is nearly right. If it is not, sort anew.
  void sort_order() {
    size_t left = 8 * order_.size();
    for (size_t i = 1; i < order_.size(); ++i) {
      Place place = order_[i];
      size_t j = i;
      for (; j > 0 && order_[j - 1].low > place.low; --j) order_[j] = order_[j - 1];
      order_[j] = place;
      if (i - j > left) {
        std::sort(order_.begin(), order_.end(),
                  [](const Place& a, const Place& b) { return a.low < b.low; });
        return;
      }
      left -= i - j;
    }
  }

  // Call `visit` with each tile that a box reaches, and its place in the table.
  template <class Visit>
  void each_tile(const Reach& reach, Visit visit) const {
    size_t mask = starts_.size() - 2;
    for (uint32_t u = reach.first[0]; u <= reach.last[0]; ++u)
      for (uint32_t v = reach.first[1]; v <= reach.last[1]; ++v) visit(u, v, hash(u, v) & mask);
  }

  // Counting sort of the entries by tile; within a tile they keep the order of the boxes.
  void fill_table(size_t entries) {
    size_t slots = 1;
    while (slots < entries) slots *= 2;
    starts_.assign(slots + 1, 0);
    entries_.resize(entries);
    for (const Reach& reach : reaches_)
      each_tile(reach, [&](uint32_t, uint32_t, size_t slot) { ++starts_[slot]; });
    uint32_t end = 0;
    for (uint32_t& start : starts_) start = end += start;
    for (size_t i = reaches_.size(); i-- > 0;)
      each_tile(reaches_[i], [&](uint32_t u, uint32_t v, size_t slot) {
        entries_[--starts_[slot]] = {uint32_t(i), {u, v}};
      });
  }

  bool sweep_slot(uint32_t begin, uint32_t end, int swept) {
    for (uint32_t i = begin; i < end; ++i) {
      const Entry& entry = entries_[i];
      const Reach& a = reaches_[entry.reach];
      for (uint32_t j = i + 1; j < end; ++j) {
        const Entry& other = entries_[j];
        const Reach& b = reaches_[other.reach];
        if (b.bounds.low[swept] > a.bounds.high[swept]) break;
        // Two boxes meet once: in the tile where their overlap begins.
        bool here = true;
        for (int t = 0; t < 2; ++t)
          here &= (entry.tile[t] == other.tile[t]) &
                  (std::max(a.first[t], b.first[t]) == entry.tile[t]);
        if (here && a.bounds.overlaps(b.bounds) && !add(a.box, b.box)) return false;
      }
    }
    return true;
  }

  // Counting sort of what was found by the lower box, then by the higher.
  void append_found() {
    begins_.assign(half_.size() + 1, 0);
    for (const Found& found : found_) ++begins_[size_t(found.lower)];
    uint32_t end = 0;
    for (uint32_t& begin : begins_) begin = end += begin;
    sorted_.resize(found_.size());
    for (const Found& found : found_) sorted_[--begins_[size_t(found.lower)]] = found;
    for (size_t box = 0; box + 1 < begins_.size(); ++box)
      std::sort(sorted_.begin() + begins_[box], sorted_.begin() + begins_[box + 1],
                [](const Found& a, const Found& b) { return a.higher < b.higher; });
    for (const Found& found : sorted_) {
      pairs_.push_back(found.side == 1 ? found.lower : found.higher);
      pairs_.push_back(found.side == 1 ? found.higher : found.lower);
    }
  }

  std::vector<Vec<double>> half_;
  std::vector<uint8_t> fixed_;
  std::vector<int32_t> body_;
  Asked asked_;
  std::vector<uint64_t> listed_keys_;
  std::vector<int32_t> members_;  // boxes that some group lets meet
  // Of the last call.
  std::vector<Bounds> bounds_;
  std::vector<uint8_t> known_;
  std::vector<int64_t> pairs_, stale_;
  std::vector<Place> order_;
  // Memory that calls use again.
  size_t most_ = 0;
  std::vector<uint8_t> is_alone_;
  std::vector<int32_t> alone_;
  std::vector<double> sample_;
  std::vector<Reach> reaches_;
  std::vector<Entry> entries_;
  std::vector<uint32_t> starts_, begins_;
  std::vector<Found> found_, sorted_;
};

}  // namespace box_contact::detail
