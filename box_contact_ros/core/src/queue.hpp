// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Queues: pairs of a batch that take the same way wait for each other, and are solved side by side.
//
// A row of a batch has the bits of a single call, whatever it waits with.
#pragma once

#include "overlap/exact.hpp"
#include "rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Blocks whose axes are found before their overlaps, so that the code of either stays in the first
// cache. Eight of eight pairs have 32 kB.
constexpr int blocks_at_once = 8;

// Pairs that a model takes at once.
template <class T, class Model>
struct Block {
  Query<T> query;
  long rows[width<T>];

  // Solve the lanes that touch, and hand those that the model leaves to `rest`.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    typename Model::template Found<T> found{};
    unsigned left = model.solve(query, found, counts), touching = bits(query.touching);
    write_overlaps<T>(found, touching & ~left, rows, results);
    for (left &= touching; left; left &= left - 1) {
      int i = __builtin_ctz(left);
      rest.take(query, i, rows[i], results, counts);
    }
  }
};

// Rows that wait until they fill a block.
template <class T, class Model>
struct Waiting {
  Block<T, Model> block;
  int count = 0;

  // Put lane i of `q` at place `at`.
  BC_INLINE void put(const Query<T>& q, int i, long row, int at) {
    static_assert(sizeof(Query<T>) % sizeof(T) == 0, "all that a query has are lanes");
    constexpr size_t one = sizeof(Number<T>);
    auto* from = reinterpret_cast<const char*>(&q) + one * i;
    auto* to = reinterpret_cast<char*>(&block.query) + one * at;
    for (size_t k = 0; k < sizeof q; k += sizeof(T)) std::memcpy(to + k, from + k, one);
    block.rows[at] = row;
  }
  // Solve what waits. Idle lanes repeat the first one.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    if (!count) return;
    for (int at = count; at < width<T>; ++at) {
      put(block.query, 0, 0, at);
      set_lane(block.query.touching, at, 0);
    }
    block.solve(model, results, counts, rest);
    count = 0;
  }
};

// What becomes of the pairs that a model leaves: nothing, where there are none.
template <class T>
struct NoRest {
  BC_INLINE void take(const Query<T>&, int, long, const Results&, Counts&) {}
  BC_INLINE void finish(const Results&, Counts&) {}
};
template <class T, class Model>
struct WaitingRest;
template <class T, class Model>
using Rest =
    std::conditional_t<std::is_void_v<typename Model::Rest>, NoRest<T>, WaitingRest<T, Model>>;

// They wait for the next model.
template <class T, class Model>
struct WaitingRest {
  using Next = typename Model::Rest;
  Waiting<T, Next> waiting;
  Rest<T, Next> rest;

  BC_INLINE void take(const Query<T>& q, int i, long row, const Results& results, Counts& counts) {
    waiting.put(q, i, row, waiting.count);
    if (++waiting.count == width<T>) solve(results, counts);
  }
  BC_INLINE void finish(const Results& results, Counts& counts) {
    if (waiting.count) solve(results, counts);
    rest.finish(results, counts);
  }

 private:
  [[gnu::noinline]] void solve(const Results& results, Counts& counts) {
    waiting.solve(Next{}, results, counts, rest);
  }
};

// A row alone. No model leaves it.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results, Counts& counts) {
  Block<double, Model> one;
  query_rows(rows, row, row + 1, one.query);
  one.rows[0] = row;
  NoRest<double> rest;
  if (one.query.touching) one.solve(model, results, counts, rest);
  return write_query(one.query, row, row + 1, results, counts);
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
    Block<T, Model> blocks[blocks_at_once];
    Waiting<T, Model> waiting;
    Rest<T, Model> rest;
    constexpr int lanes = width<T>;
    constexpr long few = lanes <= 2 ? 0 : 2;
    bool only_block = end - begin <= lanes;
    while (end - first > few) {
      int count = 0;
      for (; count < blocks_at_once && end - first > few; ++count, first += lanes) {
        Block<T, Model>& block = blocks[count];
        long last = min(first + lanes, end);
        fetch_rows(results, first, last);
        query_rows(rows, first, last, block.query);
        note(write_query(block.query, first, last, results, counts));
        for (int i = 0; i < lanes; ++i) block.rows[i] = first + i;
      }
      for (int n = 0; n < count; ++n) {
        Block<T, Model>& block = blocks[n];
        unsigned touching = bits(block.query.touching);
        if (__builtin_popcount(touching) == lanes || (touching && only_block)) {
          block.solve(model, results, counts, rest);
          continue;
        }
        for (; touching; touching &= touching - 1) {
          int i = __builtin_ctz(touching);
          waiting.put(block.query, i, block.rows[i], waiting.count);
          if (++waiting.count == lanes) waiting.solve(model, results, counts, rest);
        }
      }
    }
    waiting.solve(model, results, counts, rest);
    rest.finish(results, counts);
  }
  for (; first < end; ++first) note(solve_row(model, rows, first, results, counts));
  return refused;
}

}  // namespace box_contact::BOX_CONTACT_SET
