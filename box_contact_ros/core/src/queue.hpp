// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Queues: pairs of a batch that take the same way wait for each other, and are solved side by side.
//
// A row of a batch has the bits of a single call, whatever it waits with.
#pragma once

#include "overlap/exact.hpp"
#include "rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A group of blocks: what a model takes at once.
template <class T, class Model>
struct Group {
  static constexpr int blocks = Model::template group<T>, lanes = blocks * width<T>;
  Query<T> queries[blocks];
  long rows[blocks][width<T>];

  // Solve the lanes that touch, and hand those that the model leaves to `rest`.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    typename Model::template Found<T> found[blocks]{};
    unsigned left[blocks]{};
    model.solve(queries, found, left, counts);
    for (int g = 0; g < blocks; ++g) {
      unsigned touching = bits(queries[g].touching);
      write_overlaps<T>(found[g], touching & ~left[g], rows[g], results);
      for (unsigned lanes_left = touching & left[g]; lanes_left; lanes_left &= lanes_left - 1) {
        int i = __builtin_ctz(lanes_left);
        counts.exact += Model::leaves_to_exact;
        rest.take(queries[g], i, rows[g][i], results, counts);
      }
    }
  }
};

// Rows that wait until they fill a group.
template <class T, class Model>
struct Waiting {
  Group<T, Model> group;
  int count = 0;

  // Put lane i of `q` at place `at`.
  BC_INLINE void put(const Query<T>& q, int i, long row, int at) {
    static_assert(sizeof(Query<T>) % sizeof(T) == 0, "all that a query has are lanes");
    constexpr size_t one = sizeof(Number<T>);
    auto* from = reinterpret_cast<const char*>(&q) + one * i;
    auto* to = reinterpret_cast<char*>(&group.queries[at / width<T>]) + one * (at % width<T>);
    for (size_t k = 0; k < sizeof q; k += sizeof(T)) std::memcpy(to + k, from + k, one);
    group.rows[at / width<T>][at % width<T>] = row;
  }
  // Solve what waits. Idle lanes repeat the first one.
  template <class Rest>
  BC_INLINE void solve(const Model& model, const Results& results, Counts& counts, Rest& rest) {
    if (!count) return;
    for (int at = count; at < group.lanes; ++at) {
      put(group.queries[0], 0, 0, at);
      set_lane(group.queries[at / width<T>].touching, at % width<T>, 0);
    }
    group.solve(model, results, counts, rest);
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

// They wait for the next model. What it clips counts, unless it is another model than was asked for.
template <class T, class Model>
struct WaitingRest {
  using Next = typename Model::Rest;
  Waiting<T, Next> waiting;
  Rest<T, Next> rest;
  Counts uncounted{};

  BC_INLINE void take(const Query<T>& q, int i, long row, const Results& results, Counts& counts) {
    if constexpr (is_scalar<T>) {
      waiting.group.queries[0] = q;
      waiting.group.rows[0][0] = row;
    } else {
      waiting.put(q, i, row, waiting.count);
    }
    if (++waiting.count == waiting.group.lanes) solve(results, counts);
  }
  BC_INLINE void finish(const Results& results, Counts& counts) {
    if (waiting.count) solve(results, counts);
    rest.finish(results, Model::leaves_to_exact ? uncounted : counts);
  }

 private:
  [[gnu::noinline]] void solve(const Results& results, Counts& counts) {
    waiting.solve(Next{}, results, Model::leaves_to_exact ? uncounted : counts, rest);
  }
};

// One row alone.
template <class Model>
[[gnu::noinline]] inline long solve_row(const Model& model, const Rows& rows, long row,
                                        const Results& results, Counts& counts) {
  Group<double, Model> one;
  query_rows(rows, row, row + 1, one.queries[0]);
  one.rows[0][0] = row;
  if (one.queries[0].touching) {
    Rest<double, Model> rest;
    one.solve(model, results, counts, rest);
    rest.finish(results, counts);
  }
  return write_query(one.queries[0], row, row + 1, results, counts);
}

// Solve rows `begin` to `end`. Returns the first row whose poses or sizes are refused, or −1. Such
// rows get `colliding` false and `separation` NaN.
//
// A few rows that are left are solved one by one, which is faster than a group with idle lanes. With
// registers of two a pair alone is slower than a block of two with an idle lane.
template <class T, class Model>
[[gnu::noinline]] inline long solve_rows(const Model& model, const Rows& rows, long begin, long end,
                                         const Results& results, Counts& counts) {
  long refused = -1, first = begin;
  auto note = [&](long row) { refused = refused < 0 ? row : refused; };
  if constexpr (!is_scalar<T>) {
    Group<T, Model> group;
    Waiting<T, Model> waiting;
    Rest<T, Model> rest;
    constexpr int blocks = group.blocks, lanes = group.lanes;
    constexpr long few = width<T> <= 2 ? blocks - 1 : lanes <= 8 ? 2 : lanes / 4;
    for (; end - first > few; first += lanes) {
      long last = min(first + lanes, end);
      fetch_rows(results, first, last);
      int touching = 0;
      for (int g = 0; g < blocks; ++g) {
        long start = first + g * width<T>;
        query_rows(rows, min(start, last - 1), last, group.queries[g]);
        if (start >= last)
          group.queries[g].touching = Mask<T>{};
        else
          note(write_query(group.queries[g], start, last, results, counts));
        for (int i = 0; i < width<T>; ++i) group.rows[g][i] = start + i;
        touching += __builtin_popcount(bits(group.queries[g].touching));
      }
      if (touching == lanes || (touching && first == begin && last == end)) {
        group.solve(model, results, counts, rest);
      } else if (touching) {
        for (int g = 0; g < blocks; ++g)
          for (unsigned left = bits(group.queries[g].touching); left; left &= left - 1) {
            int i = __builtin_ctz(left);
            waiting.put(group.queries[g], i, group.rows[g][i], waiting.count);
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
