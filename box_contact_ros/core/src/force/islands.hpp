// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which bodies and patches belong together: an island has all bodies that patches join, but for those
// that no force moves. These are in each island that they touch. So islands share nothing that changes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../kernel.hpp"
#include "iterations.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Islands in order.
struct Chunk {
  size_t island, island_end;
  size_t block, block_end;
  int64_t lost;  // the first body whose numbers are not finite at the end of an advance, or −1
};

template <class T>
struct RangeOf {
  T *first, *last;
  T* begin() const { return first; }
  T* end() const { return last; }
};

class Islands {
 public:
  // side: the instruction set's, or null.
  explicit Islands(const detail::ForceKernel* side) : side_(side) {}

  std::vector<Island> all;
  std::vector<Chunk> chunks;
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
    chunks.reserve(bodies);
    rooms_.reserve(patches + bodies);
    if (side_)
      groups_.resize(2 * patches / size_t(side_->lanes) * side_->group_size / sizeof(Line) + 1);
  }

  // awake: the bodies in islands, in order.
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
    blocks.resize(patches.size());  // what else is in them, an advance writes
    size_t count = 0;
    for (size_t island = 0; island < all.size(); ++island) {
      Island& here = all[island];
      here.body = moving.size();
      here.block = count;
      for (int32_t k : bodies_.of(island)) add(bodies, awake[size_t(k)]);
      for (int32_t patch : patches_.of(island)) {
        Block& block = blocks[count++];
        block.patch = patch;
        block.a = place(bodies, patches[size_t(patch)].a, here);
        block.b = place(bodies, patches[size_t(patch)].b, here);
      }
      here.body_end = moving.size();
      here.block_end = count;
    }
    cut();
    rooms_.resize(blocks.size() + chunks.size());
  }

  // The islands of a chunk.
  using Range = RangeOf<Island>;
  Range of(const Chunk& chunk) {
    return {all.data() + chunk.island, all.data() + chunk.island_end};
  }

  const detail::ForceKernel* side() const { return side_; }
  // Memory for groups of a chunk.
  void* groups_of(const Chunk& chunk) {
    return groups_[0].bytes + first_group(chunk.block) * side_->group_size;
  }

  // Put the blocks of the islands of a chunk that are due into groups, whose lanes are solved side by
  // side. In order, each goes into the first group with room behind those of its bodies. So bodies see
  // their blocks in the order of pairs, and no group has a body twice. Returns the number of groups; 0:
  // about half of the lanes would be empty, and each island is better solved alone.
  size_t group_blocks(const Chunk& chunk) {
    if (!side_) return 0;
    Room* rooms = rooms_.data() + chunk.block + size_t(&chunk - chunks.data());
    int32_t lanes = side_->lanes, count = 0, blocks_due = 0;
    for (int32_t k = 0; k <= int32_t(chunk.block_end - chunk.block); ++k) rooms[k] = {k, 0};
    for (size_t island = chunk.island; island < chunk.island_end; ++island) {
      const Island& here = all[island];
      if (!here.is_due) continue;
      for (size_t k = here.body; k < here.body_end; ++k) moving[k].side = 0;
      blocks_due += int32_t(here.block_end - here.block);
      for (size_t k = here.block; k < here.block_end; ++k) {
        Moving &a = moving[size_t(blocks[k].a)], &b = moving[size_t(blocks[k].b)];
        int32_t group = first_room(rooms, std::max(a.side, b.side));
        Room& room = rooms[group];
        blocks[k].side = group * lanes + room.filled;
        if (++room.filled == lanes) room.next = group + 1;
        if (a.inverse_mass > 0.0) a.side = group + 1;
        if (b.inverse_mass > 0.0) b.side = group + 1;
        count = std::max(count, group + 1);
      }
    }
    return 2 * blocks_due >= count * (lanes + 1) ? size_t(count) : 0;
  }

 private:
  // Of a group: the first one from it on that may have room, and how many lanes are filled.
  struct Room {
    int32_t next, filled;
  };
  static int32_t first_room(Room* rooms, int32_t group) {
    while (rooms[group].next != group) group = rooms[group].next = rooms[rooms[group].next].next;
    return group;
  }

  void cut() {
    chunks.clear();
    for (size_t island = 0; island < all.size();) {
      size_t first = island;
      // A body alone is some work, too.
      auto size = [&] { return all[island].block_end - all[first].block + (island - first); };
      do ++island;
      while (island < all.size() && size() <= blocks_per_chunk);
      chunks.push_back({first, island, all[first].block, all[island - 1].block_end, -1});
    }
  }

  // Groups of blocks from this one on begin here.
  size_t first_group(size_t block) const { return 2 * block / size_t(side_->lanes); }

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

  // Places of things in the order of their islands; those of an island stay in order (counting sort).
  class Sorted {
   public:
    void make_room(size_t islands, size_t count) {
      starts_.reserve(islands + 1);
      order_.reserve(count);
    }
    template <class IslandOf>
    void sort(size_t count, size_t islands, IslandOf island_of) {
      order_.resize(count);
      starts_.assign(islands + 1, 0);
      for (size_t k = 0; k < count; ++k) ++starts_[size_t(island_of(k))];
      int32_t sum = 0;
      for (int32_t& start : starts_) start = sum += start;
      for (size_t k = count; k-- > 0;) order_[size_t(--starts_[size_t(island_of(k))])] = int32_t(k);
    }
    RangeOf<const int32_t> of(size_t island) const {
      return {order_.data() + starts_[island], order_.data() + starts_[island + 1]};
    }

   private:
    std::vector<int32_t> starts_, order_;
  };

  std::vector<int32_t> root_, island_;  // of each body that is awake
  std::vector<int32_t> place_;          // of each body among those that move, in the last island
  Sorted bodies_, patches_;
  const detail::ForceKernel* side_;
  std::vector<Room> rooms_;  // of the groups of each chunk, and one behind them
  struct alignas(64) Line {
    char bytes[64];
  };
  std::vector<Line> groups_;  // memory for them
};

}  // namespace box_contact::BOX_CONTACT_SET::force
