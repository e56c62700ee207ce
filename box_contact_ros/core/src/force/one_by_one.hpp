// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What an advance does with a block, or a body.
#pragma once

#include "iterations.hpp"
#include "preparing.hpp"
#include "rotation.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Islands that are advanced together, and the groups of their blocks: a block alone, or side by side.
// Kernels of all instruction sets have it alike.
struct Work {
  Island *first, *last;
  const Body* bodies;
  Moving* moving;
  Block* blocks;
  const Patch* patches;
  void* groups;
  size_t group_count;
  const SubSteps& steps;
  bool counts;           // whether impulses are added up
  bool is_last = false;  // whether it is the last sub-step
};

// By how much B has rotated more than A since the answer.
inline Vec<double> rotation_since(const Patch& patch, const Moving& a, const Moving& b) {
  return rotation(patch.asked_b, b.placed) - rotation(patch.asked_a, a.placed);
}

// An iteration over all blocks.
struct Iteration {
  bool is_pushing;
  int number;
  bool is_beyond;  // whether only impacts go on
};

inline void prepare(const Work& work, Block& block) {
  Moving &a = work.moving[block.a], &b = work.moving[block.b];
  auto rotated = [&] { return rotation_since(work.patches[block.patch], a, b); };
  prepare<double>(work.steps, a, b, a, b, rotated, block);
}
inline void warm_start(const Work& work, Block& block) {
  warm_start<double>(work.steps, block, work.moving[block.a], work.moving[block.b]);
}
inline void follow(const Work& work, Block& block) {
  const Moving &a = work.moving[block.a], &b = work.moving[block.b];
  follow<double>(a, b, a, b, work.steps.length, block);
}
// Solve it if its bodies have changed since it was solved last. Returns whether a speed changed.
inline bool solve(const Work& work, const Iteration& at, Block& block) {
  Moving &a = work.moving[block.a], &b = work.moving[block.b];
  Island& island = *work.first;
  if (max(a.last_change, b.last_change) < at.number - 1) return false;
  double closing = solve_normal<double>(block, rows_of(block, at.is_pushing), true, a, b);
  double slipping = solve_friction<double>(block, true, a, b);  // bounded by what presses now
  if (closing > island.impact) island.is_struck = true;
  if (max(closing, slipping) <= (at.is_beyond ? island.impact : least_change)) return false;
  if (a.inverse_mass > 0.0) a.last_change = at.number;
  if (b.inverse_mass > 0.0) b.last_change = at.number;
  return true;
}
inline void move(const Work& work, Moving& moving) {
  move(work.bodies[moving.body], work.steps.length, moving);
}
inline void count(const Work& work, Block& block) {
  count<double>(block, work.moving[block.a], work.moving[block.b]);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
