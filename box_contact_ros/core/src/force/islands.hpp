// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which bodies and patches belong together: an island has all bodies that patches join, but for those
// that no force moves. These are in each island that they touch. So islands share nothing that changes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "block.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

struct Island {
  size_t body, body_end;  // among those that move
  size_t block, block_end;
};

class Islands {
 public:
  std::vector<Island> all;
  std::vector<Moving> moving;      // by island; a body that no force moves comes once for each
  std::vector<Block> blocks;       // by island, then by pair
  std::vector<int32_t> by_height;  // places of blocks, by island: room for an order of its own

  void make_room(size_t bodies, size_t patches) {
    for (auto* places : {&root_, &island_, &place_}) places->reserve(bodies);
    all.reserve(bodies);
    bodies_.make_room(bodies, bodies);
    patches_.make_room(bodies, patches);
    moving.reserve(bodies + patches);
    blocks.reserve(patches);
    by_height.reserve(patches);
  }

  // awake: the bodies in islands, in turn.
  void group(const std::vector<Body>& bodies, const std::vector<int32_t>& awake,
             const std::vector<Patch>& patches) {
    by_height.resize(patches.size());
    number(bodies, awake, patches);
    bodies_.sort(awake.size(), all.size(), [&](size_t k) { return island_[size_t(awake[k])]; });
    patches_.sort(patches.size(), all.size(), [&](size_t k) {
      const Patch& patch = patches[k];
      return island_[size_t(bodies[size_t(patch.a)].is_free() ? patch.a : patch.b)];
    });
    place_.assign(bodies.size(), -1);
    moving.clear();
    blocks.clear();
    for (size_t island = 0; island < all.size(); ++island) {
      Island& here = all[island];
      here.body = moving.size();
      here.block = blocks.size();
      for (int32_t k : bodies_.of(island)) add(bodies, awake[size_t(k)]);
      for (int32_t patch : patches_.of(island)) {
        Block block{};
        block.patch = patch;
        block.a = place(bodies, patches[size_t(patch)].a, here);
        block.b = place(bodies, patches[size_t(patch)].b, here);
        blocks.push_back(block);
      }
      here.body_end = moving.size();
      here.block_end = blocks.size();
    }
  }

 private:
  int32_t root_of(int32_t body) {
    while (root_[size_t(body)] != body)
      body = root_[size_t(body)] = root_[size_t(root_[size_t(body)])];
    return body;
  }

  // The root of an island is its lowest body, and islands are in the order of their roots.
  void number(const std::vector<Body>& bodies, const std::vector<int32_t>& awake,
              const std::vector<Patch>& patches) {
    root_.resize(bodies.size());
    island_.resize(bodies.size());
    for (int32_t body : awake) root_[size_t(body)] = body;
    for (const Patch& patch : patches) {
      if (!bodies[size_t(patch.a)].is_free() || !bodies[size_t(patch.b)].is_free()) continue;
      int32_t a = root_of(patch.a), b = root_of(patch.b);
      root_[size_t(std::max(a, b))] = std::min(a, b);
    }
    all.clear();
    for (int32_t body : awake) {
      int32_t root = root_of(body);
      if (root == body) {
        island_[size_t(body)] = int32_t(all.size());
        all.push_back({});
      }
      island_[size_t(body)] = island_[size_t(root)];
    }
  }

  void add(const std::vector<Body>& bodies, int32_t body) {
    place_[size_t(body)] = int32_t(moving.size());
    moving.push_back({});
    moving.back().body = body;
    moving.back().inverse_mass = bodies[size_t(body)].inverse_mass;
  }
  int32_t place(const std::vector<Body>& bodies, int32_t body, const Island& here) {
    if (place_[size_t(body)] < int32_t(here.body)) add(bodies, body);
    return place_[size_t(body)];
  }

  // Things in the order of their islands.
  class Sorted {
   public:
    struct Range {
      const int32_t *first, *last;
      const int32_t* begin() const { return first; }
      const int32_t* end() const { return last; }
    };
    void make_room(size_t islands, size_t count) {
      starts_.reserve(islands + 1);
      order_.reserve(count);
    }
    // Counting sort.
    template <class IslandOf>
    void sort(size_t count, size_t islands, IslandOf island_of) {
      starts_.assign(islands + 1, 0);
      for (size_t k = 0; k < count; ++k) ++starts_[size_t(island_of(k))];
      int32_t end = 0;
      for (int32_t& start : starts_) start = end += start;
      order_.resize(size_t(end));
      for (size_t k = count; k-- > 0;) order_[size_t(--starts_[size_t(island_of(k))])] = int32_t(k);
    }
    Range of(size_t island) const {
      return {order_.data() + starts_[island], order_.data() + starts_[island + 1]};
    }

   private:
    std::vector<int32_t> starts_, order_;
  };

  std::vector<int32_t> root_, island_;  // of each body that is awake
  std::vector<int32_t> place_;          // of each body among those that move, in the last island
  Sorted bodies_, patches_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
