// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The stages of an advance of islands, with their blocks one by one or side by side.
#pragma once

#include "../kernel.hpp"
#include "side_by_side.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// G: a block, or a group of them. `all`: a Work.
template <class G>
class Stages {
 public:
  // Take what blocks know.
  static void load(void* all) {
    if constexpr (!is_alone) {
      const Work& work = work_of(all);
      each(work, [](G& group) { group.filled = group.is_free_a = group.is_free_b = 0; });
      each_due(work, [&](Island& island) {
        for (size_t k = island.block; k < island.block_end; ++k) join(work, island, k);
      });
      each(work, [&](G& group) {
        for (int i = 0; i < G::lanes; ++i)
          if (!(group.filled >> i & 1)) {
            group.a[i] = group.a[0];
            group.b[i] = group.b[0];
            group.block[i] = group.block[0];
            group.island[i] = group.island[0];
          }
        force::load(work, group);
      });
    }
  }
  // Prepare a sub-step, and push.
  static void push(void* all) {
    const Work& work = work_of(all);
    for (Island* island = work.first; island < work.last; ++island)
      island->impact = work.steps.is_late ? no_impact : least_impact(*island, work.steps.length);
    forget_changes(work);
    each(work, [&](G& group) { prepare(work, group); });
    each(work, [&](G& group) { warm_start(work, group); });
    iterate_all(work, iterations, true);
    if (work.counts) each(work, [&](G& group) { count(work, group); });
  }
  // Move bodies by their velocities.
  static void move(void* all) {
    const Work& work = work_of(all);
    if constexpr (is_alone) {
      each_due_body(work, [&](size_t k) { force::move(work, work.moving[k]); });
    } else {
      int32_t places[G::lanes];
      int filled = 0;
      auto move_them = [&] {
        for (int i = filled; i < G::lanes; ++i) places[i] = places[0];
        force::move<typename G::Type>(work, places, (1u << filled) - 1);
        filled = 0;
      };
      each_due_body(work, [&](size_t k) {
        places[filled++] = int32_t(k);
        if (filled == G::lanes) move_them();
      });
      if (filled > 0) move_them();
    }
  }
  // Relax, and end the sub-step.
  static void relax(void* all) {
    const Work& work = work_of(all);
    forget_changes(work);
    each(work, [&](G& group) { follow(work, group); });
    iterate_all(work, relaxations, false);
    if (work.counts && !work.is_last) each(work, [&](G& group) { count(work, group); });
    each(work, [&](G& group) { store(work.steps, group); });
  }
  // Give blocks what is known.
  static void end(void* all) {
    if constexpr (!is_alone) {
      const Work& work = work_of(all);
      each(work, [&](G& group) { force::end(work, group); });
    }
  }

  static constexpr int lanes() {
    if constexpr (is_alone) {
      return 1;
    } else {
      return G::lanes;
    }
  }
  static constexpr detail::ForceKernel kernel = {lanes(), sizeof(G), load, push, move, relax, end};

 private:
  static constexpr bool is_alone = std::is_same_v<G, Block>;
  static const Work& work_of(void* all) { return *static_cast<const Work*>(all); }
  static G* groups(const Work& work) { return static_cast<G*>(work.groups); }
  template <class Visit>
  static void each(const Work& work, const Visit& visit) {
    for (size_t k = 0; k < work.group_count; ++k) visit(groups(work)[k]);
  }
  template <class Visit>
  static void each_due(const Work& work, const Visit& visit) {
    for (Island* island = work.first; island < work.last; ++island)
      if (island->is_due) visit(*island);
  }
  template <class Visit>
  static void each_due_body(const Work& work, const Visit& visit) {
    each_due(work, [&](const Island& island) {
      for (size_t k = island.body; k < island.body_end; ++k) visit(k);
    });
  }

  static void join(const Work& work, Island& island, size_t k) {
    const Block& block = work.blocks[k];
    G& group = groups(work)[block.side / G::lanes];
    int i = block.side % G::lanes;
    unsigned bit = 1u << i;
    group.a[i] = block.a;
    group.b[i] = block.b;
    group.block[i] = int32_t(k);
    group.island[i] = &island;
    group.filled |= bit;
    if (work.moving[block.a].inverse_mass > 0.0) group.is_free_a |= bit;
    if (work.moving[block.b].inverse_mass > 0.0) group.is_free_b |= bit;
  }

  static void forget_changes(const Work& work) {
    for (Island* island = work.first; island < work.last; ++island)
      force::forget_changes(*island, work.moving);
  }

  static void iterate_all(const Work& work, int count, bool is_pushing) {
    count *= work.steps.rounds;
    auto solve_all = [&](int iteration, bool is_beyond) {
      bool is_changed = false;
      each(work,
           [&](G& group) { is_changed |= solve(work, {is_pushing, iteration, is_beyond}, group); });
      return is_changed;
    };
    auto scale_it = [&](const Island& island, int iteration) {
      scale_one(work, island, is_pushing, iteration);
    };
    iterate(work.first, work.last, count, work.moving, solve_all, scale_it);
  }
  // Its blocks are in all groups, so they come out for it.
  static void scale_one(const Work& work, const Island& island, bool is_pushing, int iteration) {
    auto scale_all = [&] { scale(island, is_pushing, iteration, work.moving, work.blocks); };
    if constexpr (is_alone) {
      scale_all();
    } else {
      auto each_lane = [&](const auto& visit) {
        for (size_t k = island.block; k < island.block_end; ++k) {
          Block& block = work.blocks[k];
          visit(groups(work)[block.side / G::lanes], block.side % G::lanes, block);
        }
      };
      each_lane([&](G& group, int i, Block& block) { group.copy_to(i, is_pushing, block); });
      scale_all();
      each_lane([](G& group, int i, const Block& block) {
        for (int k = 0; k < 3; ++k) set_lane(group.normal_impulses[k], i, block.normal_impulses[k]);
      });
    }
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::force
