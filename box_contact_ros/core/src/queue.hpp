// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of a batch: axes are found block by block, and pairs that take the same way to their overlap are
// solved side by side.
//
// A row of a batch has the bits of a single call, whatever it waits with.
#pragma once

#include "overlap/exact.hpp"
#include "rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Blocks whose axes are found before their overlaps, so that the code of either stays in the first
// cache. Eight of eight pairs have 32 kB.
constexpr int blocks_at_once = 8;

// Pairs side by side, and their rows.
template <class T>
struct Block {
  Query<T> query;
  long rows[width<T>];
  int count = 0;  // lanes that are taken

  // Take lane i of another block. Returns whether all lanes are taken.
  BC_INLINE bool take(const Block& other, int i) {
    put(other, i, count++);
    return count == width<T>;
  }
  // Idle lanes repeat the first one, and do not touch.
  BC_INLINE void fill() {
    for (; count < width<T>; ++count) {
      put(*this, 0, count);
      set_lane(query.touching, count, 0);
    }
  }

 private:
  BC_INLINE void put(const Block& other, int from, int to) {
    copy_lane<T, T>(other.query, from, query, to);
    rows[to] = other.rows[from];
  }
};

// The overlaps of a batch.
template <class T, class Model>
class Queue {
 public:
  BC_INLINE Queue(const Model& model, const Results& results, Counts& counts)
      : model_(model), results_(results), counts_(counts) {}

  // Solve the pairs of a block that touch: at once where all do, or it is the only block; else when
  // they fill one.
  BC_INLINE void add(Block<T>& block, bool only_block) {
    unsigned touching = bits(block.query.touching);
    if (__builtin_popcount(touching) == width<T> || (touching && only_block)) {
      solve(block);
      return;
    }
    for (; touching; touching &= touching - 1)
      if (waiting_.take(block, __builtin_ctz(touching))) solve_waiting();
  }
  // The memory of the blocks that were added is about to be used anew.
  BC_INLINE void keep() {
    if (first_ && first_ != &kept_) {
      kept_ = *first_;
      first_ = &kept_;
    }
  }
  BC_INLINE void finish() {
    if (waiting_.count) solve_waiting();
    if constexpr (!Model::takes_two)
      if (left_.count) solve_left();
    if (first_) solve_two(*first_, *first_);
  }

 private:
  BC_INLINE void solve(const Block<T>& block) {
    if constexpr (Model::takes_two) {
      if (first_) solve_two(*first_, block);
      first_ = first_ ? nullptr : &block;
    } else {
      typename Model::template Found<T> found{};
      unsigned left = model_.solve(block.query, found, counts_),
               touching = bits(block.query.touching);
      write_overlaps<T>(found, touching & ~left, block.rows, results_);
      for (left &= touching; left; left &= left - 1)
        if (left_.take(block, __builtin_ctz(left))) solve_left();
    }
  }
  BC_INLINE void solve_two(const Block<T>& one, const Block<T>& other) {
    if constexpr (Model::takes_two) {
      typename Model::template Found<T> found, other_found;
      model_.solve_two(one.query, other.query, found, other_found);
      write_overlaps<T>(found, bits(one.query.touching), one.rows, results_);
      write_overlaps<T>(other_found, bits(other.query.touching), other.rows, results_);
    }
  }
  BC_INLINE void solve_waiting() {
    waiting_.fill();
    solve(waiting_);
    keep();
    waiting_.count = 0;
  }
  [[gnu::noinline]] void solve_left() {
    left_.fill();
    typename Model::template Found<T> found{};
    model_.solve_left(left_.query, found, counts_);
    write_overlaps<T>(found, bits(left_.query.touching), left_.rows, results_);
    left_.count = 0;
  }

  const Model& model_;
  const Results& results_;
  Counts& counts_;
  Block<T> waiting_;                 // for others, to fill a block
  Block<T> left_;                    // by the model, for others of their kind
  const Block<T>* first_ = nullptr;  // of two that a model solves at once, and waits for the second
  Block<T> kept_;                    // it, where its memory is used anew
};

// A row alone. No model leaves it.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results, Counts& counts) {
  Query<double> query;
  query_rows(rows, row, row + 1, query);
  long refused = write_query(query, row, row + 1, results);
  if (query.touching && want_overlap(results)) {
    typename Model::template Found<double> found;
    model.solve(query, found, counts);
    write_overlaps<double>(found, 1, {row}, results);
  }
  return refused;
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `separation` NaN.
//
// A few rows that are left are solved one by one, which is faster than a block with idle lanes. With
// registers of two a pair alone is slower than a block of two with an idle lane.
template <class T, class Model>
[[gnu::noinline]] inline long solve_rows(const Model& model, const Rows& rows, long begin, long end,
                                         const Results& results, Counts& counts) {
  long refused = -1, first = begin;
  auto note = [&](long row) { refused = refused < 0 ? row : refused; };
  if constexpr (!is_scalar<T>) {
    Block<T> blocks[blocks_at_once];
    Queue<T, Model> queue(model, results, counts);
    constexpr int lanes = width<T>;
    constexpr long few = lanes <= 2 ? 0 : 2;
    bool only_block = end - begin <= lanes;
    while (end - first > few) {
      int count = 0;
      for (; count < blocks_at_once && end - first > few; ++count, first += lanes) {
        Block<T>& block = blocks[count];
        long last = min(first + lanes, end);
        fetch_rows(results, first, last);
        query_rows(rows, first, last, block.query);
        note(write_query(block.query, first, last, results));
        for (int i = 0; i < lanes; ++i) block.rows[i] = first + i;
      }
      if (!want_overlap(results)) continue;
      for (int n = 0; n < count; ++n) queue.add(blocks[n], only_block);
      queue.keep();
    }
    queue.finish();
  }
  for (; first < end; ++first) note(solve_row(model, rows, first, results, counts));
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
