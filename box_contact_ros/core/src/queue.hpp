// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of a batch: axes are found block by block, and pairs that take the same way to their overlap are
// solved side by side.
//
// A row of a batch has the bits of a single call, whatever it waits with.
#pragma once

#include "rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

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
  // Blocks whose axes are found before their overlaps. The code of all ways to an overlap does not fit
  // the first cache, so blocks of four gain by it. Blocks of eight do not.
  static constexpr int blocks_at_once = width<T> < 8 ? 8 : 1;

  BC_INLINE Queue(const Model& model, const Results& results)
      : model_(model), results_(results) {
    for (int n = 0; n < blocks_at_once; ++n) next_[n] = &blocks_[n];
  }

  // Where the axes of the next pairs are found.
  BC_INLINE Block<T>& next(int n) { return *next_[n]; }

  // Solve those of them that touch: at once where all do, or there are no others; else when they fill a
  // block.
  BC_INLINE void add_next(int n, bool no_others) {
    unsigned touching = bits(next_[n]->query.touching);
    if (__builtin_popcount(touching) == width<T> || (touching && no_others)) {
      solve(next_[n]);
      return;
    }
    for (; touching; touching &= touching - 1)
      if (waiting_->take(*next_[n], __builtin_ctz(touching))) solve_waiting();
  }
  BC_INLINE void finish() {
    if (waiting_->count) solve_waiting();
    if (pending_->count) solve_pending(*pending_);
  }

 private:
  // A first block of two is exchanged for a free one.
  BC_INLINE void solve(Block<T>*& block) {
    if constexpr (Model::solves_two_blocks) {
      if (pending_->count) {
        solve_pending(*block);
      } else {
        std::swap(pending_, block);
        pending_->count = width<T>;
      }
    } else {
      typename Model::template Found<T> found{};
      unsigned left = model_.solve(block->query, found),
               touching = bits(block->query.touching);
      write_overlaps<T>(found, touching & ~left, block->rows, results_);
      for (left &= touching; left; left &= left - 1)
        if (pending_->take(*block, __builtin_ctz(left))) solve_pending(*pending_);
    }
  }
  BC_INLINE void solve_waiting() {
    waiting_->fill();
    solve(waiting_);
    waiting_->count = 0;
  }
  // Solve what is pending: with `second` where the model solves two blocks; else it is what the model
  // left, and `second` is not read.
  [[gnu::noinline]] void solve_pending(const Block<T>& second) {
    typename Model::template Found<T> found{};
    if constexpr (Model::solves_two_blocks) {
      typename Model::template Found<T> of_second;
      model_.solve_two(pending_->query, second.query, found, of_second);
      write_overlaps<T>(of_second, bits(second.query.touching), second.rows, results_);
    } else {
      pending_->fill();
      model_.solve_left(pending_->query, found);
    }
    write_overlaps<T>(found, bits(pending_->query.touching), pending_->rows, results_);
    pending_->count = 0;
  }

  const Model& model_;
  const Results& results_;
  Block<T> blocks_[blocks_at_once + 2];
  Block<T>* next_[blocks_at_once];
  Block<T>* waiting_ = &blocks_[blocks_at_once];      // for others, to fill a block
  Block<T>* pending_ = &blocks_[blocks_at_once + 1];  // the first of two, or what the model left
};

// A row alone. No model leaves it.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results) {
  Query<double> query;
  query_rows(rows, row, row + 1, query);
  long refused = write_query(query, row, row + 1, results);
  if (query.touching && want_overlap(results)) {
    typename Model::template Found<double> found;
    model.solve(query, found);
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
                                         const Results& results) {
  long refused = -1, first = begin;
  auto note = [&](long row) { refused = refused < 0 ? row : refused; };
  if constexpr (!is_scalar<T>) {
    Queue<T, Model> queue(model, results);
    constexpr int lanes = width<T>;
    constexpr long few = lanes <= 2 ? 0 : 2;
    bool no_others = end - begin <= lanes;
    while (end - first > few) {
      int count = 0;
      for (; count < queue.blocks_at_once && end - first > few; ++count, first += lanes) {
        Block<T>& block = queue.next(count);
        long last = min(first + lanes, end);
        fetch_rows(results, first, last);
        query_rows(rows, first, last, block.query);
        note(write_query(block.query, first, last, results));
        for (int i = 0; i < lanes; ++i) block.rows[i] = first + i;
      }
      for (int n = 0; n < count && want_overlap(results); ++n) queue.add_next(n, no_others);
    }
    queue.finish();
  }
  for (; first < end; ++first) note(solve_row(model, rows, first, results));
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
