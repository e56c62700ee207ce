// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Parts of a large island, which threads advance together: slabs of bodies, and the groups of their blocks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "counting_sort.hpp"
#include "iterations.hpp"
#include "team.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// A part of an island has about so many blocks, at least: some 400 µs of work for a thread.
constexpr size_t blocks_per_part = 128;

// The first of some groups, from one on, that has room. `next` of each: the first from it on that may have.
template <class Group>
int32_t first_room(Group* groups, int32_t group) {
  while (groups[group].next != group) group = groups[group].next = groups[groups[group].next].next;
  return group;
}

class Parts {
 public:
  std::vector<Island> all;       // of large islands, in turn
  std::vector<GroupTurn> turns;  // of groups

  void make_room(size_t bodies, size_t patches) {
    all.reserve(patches / blocks_per_part);
    for (auto* places : {&bodies_, &order_, &starts_}) places->reserve(bodies + patches);
    blocks_.reserve(patches);
    ends_.reserve(bodies + patches);
    links_.reserve(patches);
    open_.reserve(patches + Team::most);
    turns.reserve(patches);
  }
  void begin(size_t bodies, size_t blocks) {
    all.clear();
    bodies_.resize(bodies);
    blocks_.resize(blocks);
    turns.resize(blocks);
  }

  // Cut an island into parts, `most` at most, whose groups begin at `first_group`. Returns whether it pays:
  // whether half of the lanes are filled, and no chain of blocks takes longer than a part.
  bool cut(const Island& island, size_t most, const bc_pose* poses, int32_t lanes,
           size_t first_group, const std::vector<Moving>& moving, std::vector<Block>& blocks) {
    size_t longest = chain(island, moving, blocks);
    size_t count = std::min({most, links_.size() / blocks_per_part,
                             links_.size() / (size_t(lanes) * longest), size_t(Team::most)});
    if (count < 2) return false;
    size_t first = all.size();
    all.resize(first + count, island);
    Island* parts = &all[first];
    share_bodies(island, poses, moving, parts, count);
    share_blocks(island, parts, count);
    if (!make_groups(island, lanes, parts, count)) {
      all.resize(first);
      return false;
    }
    for (size_t part = 0; part < count; ++part)
      for (size_t k = parts[part].group; k < parts[part].group_end; ++k)
        turns[first_group + k] = open_of(island, parts, part)[k - parts[part].group].turn;
    for (size_t k = 0; k < links_.size(); ++k)
      blocks[island.block + k].side = links_[k].side + int32_t(parts[links_[k].part].group) * lanes;
    return true;
  }

 private:
  // A body, by the groups of its blocks up to now.
  struct End {
    bool is_free;
    int32_t part;
    int32_t level;  // above that of the last one; 0: there is none
    int32_t last_part, first_part, first_group;
  };
  // A block between two bodies of the island.
  struct Link {
    int32_t a, b;
    int32_t number;  // in the longest chain of blocks that ends with it
    int32_t part, side;
  };
  // A group of a part.
  struct Open {
    int32_t next;  // the first group of its part from this one on that may have room
    int32_t filled;
    GroupTurn turn;
  };

  // Read the blocks of an island, and sort them by their numbers in chains: those of a body stay in turn.
  // Returns the length of the longest chain.
  size_t chain(const Island& island, const std::vector<Moving>& moving,
               const std::vector<Block>& blocks) {
    ends_.clear();
    for (size_t k = island.body; k < island.body_end; ++k)
      ends_.push_back({moving[k].inverse_mass > 0.0, 0, 0, 0, 0, 0});
    links_.clear();
    int32_t longest = 0, first = int32_t(island.body);
    for (size_t k = island.block; k < island.block_end; ++k) {
      int32_t a = blocks[k].a - first, b = blocks[k].b - first;
      int32_t number = std::max(ends_[size_t(a)].level, ends_[size_t(b)].level);
      for (int32_t body : {a, b})
        if (ends_[size_t(body)].is_free) ends_[size_t(body)].level = number + 1;
      links_.push_back({a, b, number, 0, 0});
      longest = std::max(longest, number + 1);
    }
    order_.resize(links_.size());
    counting_sort(
        links_.size(), size_t(longest), [&](size_t k) { return links_[k].number; }, starts_,
        order_.data());
    return size_t(longest);
  }

  // Share bodies along the axis along which they spread most. Those that no force moves are of the last part.
  void share_bodies(const Island& island, const bc_pose* poses, const std::vector<Moving>& moving,
                    Island* parts, size_t count) {
    auto place_of = [&](int32_t k) -> const double(&)[3] {
      return poses[moving[island.body + size_t(k)].body].position;
    };
    int32_t *first = &bodies_[island.body], *end = first;
    double low[3], high[3];
    for (size_t k = 0; k < ends_.size(); ++k) {
      ends_[k].part = int32_t(count) - 1;
      if (!ends_[k].is_free) continue;
      for (int i = 0; i < 3; ++i) {
        double at = place_of(int32_t(k))[i];
        low[i] = end == first ? at : std::min(low[i], at);
        high[i] = end == first ? at : std::max(high[i], at);
      }
      *end++ = int32_t(k);
    }
    int axis = 0;
    for (int i = 1; i < 3; ++i)
      if (high[i] - low[i] > high[axis] - low[axis]) axis = i;
    size_t free = size_t(end - first);
    for (size_t part = 0; part + 1 < count; ++part) {
      int32_t *from = first + free * part / count, *to = first + free * (part + 1) / count;
      std::nth_element(from, to, end,
                       [&](int32_t j, int32_t k) { return place_of(j)[axis] < place_of(k)[axis]; });
      for (int32_t* at = from; at < to; ++at) ends_[size_t(*at)].part = int32_t(part);
    }
    counting_sort(ends_.size(), count, [&](size_t k) { return ends_[k].part; }, starts_, first);
    for (int32_t* at = first; at < first + ends_.size(); ++at) *at += int32_t(island.body);
    for (size_t part = 0; part < count; ++part) {
      parts[part].bodies = bodies_.data();
      parts[part].body = island.body + size_t(starts_[part]);
      parts[part].body_end = island.body + size_t(starts_[part + 1]);
    }
  }
  // A block is of the first part of its bodies.
  void share_blocks(const Island& island, Island* parts, size_t count) {
    for (Link& link : links_)
      link.part = std::min(ends_[size_t(link.a)].part, ends_[size_t(link.b)].part);
    int32_t* first = &blocks_[island.block];
    counting_sort(links_.size(), count, [&](size_t k) { return links_[k].part; }, starts_, first);
    for (int32_t* at = first; at < first + links_.size(); ++at) *at += int32_t(island.block);
    for (size_t part = 0; part < count; ++part) {
      parts[part].blocks = blocks_.data();
      parts[part].block = island.block + size_t(starts_[part]);
      parts[part].block_end = island.block + size_t(starts_[part + 1]);
    }
  }

  // Put blocks into groups of their parts: each into the first one with room whose level is above those of its
  // bodies' last ones. Returns whether half of the lanes are filled.
  bool make_groups(const Island& island, int32_t lanes, Island* parts, size_t count) {
    open_.resize(links_.size() + count);
    for (size_t part = 0; part < count; ++part) {
      parts[part].group_end = 0;
      open_of(island, parts, part)[0] = {0, 0, {}};
    }
    for (End& end : ends_) end.level = 0;
    for (int32_t k : order_) {
      Link& link = links_[size_t(k)];
      End* ends[] = {&ends_[size_t(link.a)], &ends_[size_t(link.b)]};
      Open* groups = open_of(island, parts, size_t(link.part));
      auto count = int32_t(parts[link.part].group_end);
      int32_t at = group_for(groups, count, std::max(ends[0]->level, ends[1]->level));
      if (at == count) {
        groups[at + 1] = {at + 1, 0, {}};
        ++parts[link.part].group_end;
      }
      Open& group = groups[at];
      link.side = at * lanes + group.filled;
      if (++group.filled == lanes) group.next = at + 1;
      for (End* end : ends)
        if (end->is_free) add(link.part, at, group.turn, *end);
    }
    for (const End& end : ends_)
      if (end.level > 0 && end.first_part != end.last_part)
        open_of(island, parts, size_t(end.first_part))[end.first_group].turn.wait_last(
            end.last_part, end.level);
    size_t all = 0;
    for (size_t part = 0; part < count; ++part) {
      parts[part].group = all;
      all = parts[part].group_end += all;
    }
    return 2 * links_.size() >= all * size_t(lanes + 1);
  }
  // The groups of a part, and one behind them.
  Open* open_of(const Island& island, const Island* parts, size_t part) {
    return &open_[parts[part].block - island.block + part];
  }
  // The first group with room at a level or above it; the one behind all others gets its own level.
  static int32_t group_for(Open* groups, int32_t count, int32_t level) {
    Open* from =
        std::lower_bound(groups, groups + count, level,
                         [](const Open& group, int32_t level) { return group.turn.level < level; });
    int32_t group = first_room(groups, int32_t(from - groups));
    if (group == count)
      groups[group].turn = {group > 0 ? std::max(level, groups[group - 1].turn.level + 1) : level};
    return group;
  }
  static void add(int32_t part, int32_t group, GroupTurn& turn, End& end) {
    if (end.level == 0) {
      end.first_part = part;
      end.first_group = group;
    } else if (end.last_part != part) {
      turn.wait(end.last_part, end.level);
    }
    end.level = turn.level + 1;
    end.last_part = part;
  }

  std::vector<int32_t> bodies_, blocks_;  // of the parts
  // Of the island that is cut.
  std::vector<End> ends_;
  std::vector<Link> links_;
  std::vector<int32_t> order_, starts_;
  std::vector<Open> open_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
