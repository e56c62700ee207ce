// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// One island, from the start of an advance to its end. Islands share nothing that changes, so each thread
// takes some.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "body_step.hpp"
#include "closing.hpp"
#include "fineness.hpp"
#include "islands.hpp"
#include "iterations.hpp"
#include "own_contacts.hpp"
#include "stages.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

struct Options {
  int substeps, threads;
  double friction, most_depth;
  bool rest;  // whether islands come to rest
};

// What an advance begins with, and where its end goes.
struct StepInputs {
  SubSteps steps;
  Given given;
  const bc_motion& motion;
  const OwnContacts* own;  // none: contacts are those of an answer
  SolvePair solve_pair;
};

class IslandStep {
 public:
  IslandStep(const Options& options, const std::vector<Body>& bodies, const StepInputs& step,
             const BodyStep& body_step, std::vector<Patch>& patches, std::vector<Load>& loads,
             Islands& islands)
      : options_(options),
        bodies_(bodies),
        step_(step),
        body_step_(body_step),
        patches_(patches),
        loads_(loads),
        islands_(islands),
        moving_(islands.moving),
        blocks_(islands.blocks),
        fineness_of_(step.given.outside, options.most_depth, patches, islands) {}

  // Advance all islands. Returns the first body whose numbers are not finite at the end, or −1. No bit depends
  // on the number of threads.
  template <class InThreads>
  int64_t solve_all(InThreads& in_threads) const {
    std::vector<Chunk>& chunks = islands_.chunks;
    in_threads(options_.threads, long(chunks.size()),
               [&](long, long k) { solve(chunks[size_t(k)]); });
    for (const Chunk& chunk : chunks)
      if (chunk.lost >= 0) return chunk.lost;
    return -1;
  }
  // Write where they end.
  template <class InThreads>
  void write_ends(InThreads& in_threads) const {
    size_t count = std::max(moving_.size(), blocks_.size());
    in_threads(options_.threads, long((count + rows_per_chunk - 1) / rows_per_chunk),
               [&](long, long chunk) {
                 size_t first = size_t(chunk) * rows_per_chunk, last = first + rows_per_chunk;
                 for (size_t k = first; k < std::min(last, moving_.size()); ++k)
                   body_step_.write_end(moving_[k]);
                 for (size_t k = first; k < std::min(last, blocks_.size()); ++k) end(blocks_[k]);
               });
  }

 private:
  void solve(Chunk& chunk) const {
    for (Island& island : islands_.of(chunk)) begin(island);
    // Those with as many iterations, in sub-steps as fine, are advanced together.
    for (const Island& island : islands_.of(chunk))
      if (island.factor > 0.0) solve_alike(chunk, island.factor, island.rounds);
    chunk.lost = first_lost(chunk);
  }
  // The first body of a chunk whose numbers are not finite at the end, or −1.
  int64_t first_lost(const Chunk& chunk) const {
    for (const Island& island : islands_.of(chunk))
      for (size_t k = island.body; k < island.body_end; ++k)
        if (!body_step_.ends_finite(moving_[k])) return moving_[k].body;
    return -1;
  }
  // Begin an island. One without contacts ends the advance, too.
  void begin(Island& island) const {
    for (size_t k = island.body; k < island.body_end; ++k) body_step_.begin(moving_[k]);
    island.factor = 0.0;
    if (island.block == island.block_end) {
      for (size_t k = island.body; k < island.body_end; ++k) body_step_.fly(moving_[k]);
      return;
    }
    begin_blocks(island);
    choose(island);
  }
  void begin_blocks(Island& island) const {
    island.is_new = true;
    island.fastest = 0.0;
    island.over_relaxation =
        step_.steps.is_late ? 1.0 : over_relaxation(island.block_end - island.block);
    each(island, [&](Block& block, const Patch& patch, Moving& a, Moving& b) {
      read_patch(patch, island.over_relaxation, block);
      island.fastest = std::max(island.fastest, passing_speed(patch, a, b));
      block.normal_sum = block.friction_sum = {};
      island.is_new = island.is_new && patch.kept.window == 0.0;
    });
  }
  // Choose how fine its sub-steps are, and how many iterations they take.
  void choose(Island& island) const {
    double swayed = fineness_of_.swayed(island, island.fastest, step_.steps.dt);
    island.rounds = step_.steps.is_late ? 1 : rounds_of(swayed);
    island.factor = step_.own ? fineness_of_(island, step_.steps) : 1.0;
  }
  // Advance the islands whose sub-steps are finer by a factor, and that take so many times the iterations.
  void solve_alike(const Chunk& chunk, double factor, int rounds) const {
    SubSteps steps = steps_of(factor, rounds);
    auto solve_range = [&](Islands::Range range, const detail::ForceKernel& kernel, void* groups,
                           size_t count) {
      Work work = work_of(range, steps, groups, count);
      take_sub_steps(kernel, factor, work);
    };
    for (Island& island : islands_.of(chunk))
      island.is_due = island.factor == factor && island.rounds == rounds;
    size_t groups = islands_.group_blocks(chunk);
    if (groups > 0)
      solve_range(islands_.of(chunk), *islands_.side(), islands_.groups_of(chunk), groups);
    for (Island& island : islands_.of(chunk)) {
      if (!island.is_due) continue;
      island.factor = 0.0;
      if (groups == 0)
        solve_range({&island, &island + 1}, Stages<Block>::kernel, &blocks_[island.block],
                    island.block_end - island.block);
    }
  }
  SubSteps steps_of(double factor, int rounds) const {
    SubSteps steps = step_.steps.finer(factor);
    steps.rounds *= rounds;
    return steps;
  }
  Work work_of(Islands::Range range, const SubSteps& steps, void* groups, size_t count) const {
    bool counts = step_.motion.wrenches;
    return {range.first,     range.last, bodies_.data(), moving_.data(), blocks_.data(),
            patches_.data(), groups,     count,          steps,          counts};
  }
  template <class Visit>
  void each(const Island& island, const Visit& visit) const {
    for (size_t k = island.block; k < island.block_end; ++k) {
      Block& block = blocks_[k];
      visit(block, patches_[size_t(block.patch)], moving_[size_t(block.a)],
            moving_[size_t(block.b)]);
    }
  }

  void take_sub_steps(const detail::ForceKernel& kernel, double factor, Work& work) const {
    auto each_island = [&](const auto& visit) {
      for (const Island* island = work.first; island < work.last; ++island)
        if (island->is_due) visit(*island);
    };
    auto each_moving = [&](const auto& visit) {
      each_island([&](const Island& island) {
        for (size_t k = island.body; k < island.body_end; ++k) visit(moving_[k]);
      });
    };
    auto end = [&] {
      kernel.end(&work);
      each_island([&](const Island& island) {
        each(island,
             [](const Block& block, Patch& patch, Moving&, Moving&) { patch.kept = block; });
      });
    };
    // Bodies move side by side where their blocks are solved alone, too.
    const detail::ForceKernel& moves = islands_.side() ? *islands_.side() : Stages<Block>::kernel;
    const SubSteps& steps = work.steps;
    // From one answer to the next.
    double time =
        factor > 1.0 ? std::min(sub_steps_per_contact * steps.length, steps.dt) : steps.dt;
    each_island([&](const Island& island) {
      each(island, [&](Block& block, const Patch& patch, Moving& a, Moving& b) {
        close(patch, a, b, time, block);
        if (steps.is_late) block.closing = {};  // rocking is soft
      });
    });
    kernel.load(&work);
    for (int number = 1; number <= steps.count; ++number) {
      if (factor > 1.0 && number > 1 && number % sub_steps_per_contact == 1) {
        end();
        each_island([&](const Island& island) { ask_again(island, time); });
        kernel.load(&work);
      }
      work.is_last = number == steps.count;
      each_moving([&](Moving& moving) { body_step_.drive(moving, number, steps); });
      kernel.push(&work);
      moves.move(&work);
      kernel.relax(&work);
    }
    end();
  }

  // Solve the contacts of an island anew, where its bodies are within the advance.
  void ask_again(const Island& island, double time) const {
    each(island, [&](Block& block, Patch& patch, Moving& a, Moving& b) {
      step_.own->solve_again(step_.solve_pair, body_step_.pose_of(a), body_step_.pose_of(b),
                             a.placed, b.placed, is_lighter_b(bodies_, patch), patch);
      read_patch(patch, island.over_relaxation, block);
      close(patch, a, b, time, block);
    });
  }
  // Let faces close that do so within a time.
  void close(const Patch& patch, const Moving& a, const Moving& b, double time,
             Block& block) const {
    auto pull = [&](const Moving& moving) {
      return step_.given.outside
                 ? pull_along(block.normal, step_.given.outside[moving.body], moving.inverse_mass)
                 : 0.0;
    };
    close_faces(patch, a, b, time, std::max(pull(a), pull(b)), block);
  }

  void end(const Block& block) const {
    Patch& patch = patches_[size_t(block.patch)];
    const Moving& a = moving_[size_t(block.a)];
    patch.age += step_.steps.dt;
    patch.force = block.normal_sum[0] / step_.steps.dt;
    loads_[size_t(block.patch)] = {patch.box_a,      patch.box_b,
                                   block.normal_sum, block.friction_sum,
                                   block.normal,     a.placed.position + block.arm_a,
                                   block.shape,
                                   block.depth > std::min(options_.most_depth, patch.most_depth),
                                   step_.steps.dt};
  }
  const Options& options_;
  const std::vector<Body>& bodies_;
  const StepInputs& step_;
  const BodyStep& body_step_;
  std::vector<Patch>& patches_;
  std::vector<Load>& loads_;
  Islands& islands_;
  std::vector<Moving>& moving_;
  std::vector<Block>& blocks_;
  FinenessOf fineness_of_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
