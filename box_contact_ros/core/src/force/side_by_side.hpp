// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Blocks side by side, in the lanes of an instruction set. Each has the bits that it has alone.
#pragma once

#include "../lanes/row_lanes.hpp"
#include "one_by_one.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Blocks side by side. Lanes that are not filled repeat the first one, and are not written.
template <class T>
struct alignas(64) Group : Rows<T> {
  using Type = T;
  static constexpr int lanes = width<T>;

  int32_t a[lanes], b[lanes], block[lanes];
  Island* island[lanes];
  unsigned filled;                // a bit for each lane
  unsigned is_free_a, is_free_b;  // the same, of those that forces move
  Mat<T> inverse_inertia_a, inverse_inertia_b;

  // Copy what the scaling of an impact takes of a block.
  void copy_to(int i, bool is_pushing, Rows<double>& block) {
    auto copy = [&](const Vec<T>& from, Vec<double>& to) {
      for (int k = 0; k < 3; ++k) to[k] = lane(from[k], i);
    };
    const NormalRows<T>& rows = rows_of<T>(*this, is_pushing);
    copy(this->arm_a, block.arm_a);
    copy(this->arm_b, block.arm_b);
    copy(this->carried, block.carried);
    copy(this->normal_impulses, block.normal_impulses);
    copy(rows.softness, rows_of(block, is_pushing).softness);
    copy(rows.bias, rows_of(block, is_pushing).bias);
  }
};

// Rows of numbers in memory to structs of lanes, and back.
template <class T, template <class> class Struct, class RowAt>
BC_INLINE void read_rows(const RowAt& row_at, Struct<T>& to) {
  constexpr int count = sizeof(Struct<double>) / sizeof(double);
  static_assert(sizeof to == count * sizeof(T) && count >= 4);
  auto* numbers = reinterpret_cast<T*>(&to);
  auto load = [&](int k) __attribute__((always_inline)) {
    load_rows([&](int i) { return reinterpret_cast<const double*>(row_at(i)) + k; },
              reinterpret_cast<T(&)[4]>(numbers[k]));
  };
  for (int k = 0; k + 4 <= count; k += 4) load(k);
  if constexpr (count % 4 != 0) load(count - 4);
}
template <class T, template <class> class Struct, class RowAt>
BC_INLINE void write_rows(const RowAt& row_at, unsigned chosen, const Struct<T>& from) {
  constexpr int count = sizeof(Struct<double>) / sizeof(double);
  auto* numbers = reinterpret_cast<const T*>(&from);
  auto store = [&](int k) __attribute__((always_inline)) {
    double* rows[width<T>];
    for (int i = 0; i < width<T>; ++i) rows[i] = reinterpret_cast<double*>(row_at(i)) + k;
    store_rows<4, T>(rows, chosen, reinterpret_cast<const T(&)[4]>(numbers[k]));
  };
  for (int k = 0; k + 4 <= count; k += 4) store(k);
  if constexpr (count % 4 != 0) store(count - 4);
}

template <class T>
using Lane = const int32_t (&)[width<T>];

template <class T>
BC_INLINE Speeds<T> speeds_of(const Moving* moving, Lane<T> bodies) {
  Speeds<T> speeds;
  read_rows<T>([&](int i) { return static_cast<const Speeds<double>*>(moving + bodies[i]); },
               speeds);
  return speeds;
}
template <class T>
BC_INLINE void write_speeds(Moving* moving, Lane<T> bodies, unsigned chosen,
                            const Speeds<T>& speeds) {
  write_rows<T>([&](int i) { return static_cast<Speeds<double>*>(moving + bodies[i]); }, chosen,
                speeds);
}
template <class T>
BC_INLINE Where<T> where(const Moving* moving, Lane<T> bodies) {
  Where<T> at;
  read_rows<T>([&](int i) { return static_cast<const Where<double>*>(moving + bodies[i]); }, at);
  return at;
}
template <class T>
BC_INLINE Sums<T> sums_of(const Moving* moving, Lane<T> bodies) {
  Sums<T> sums;
  read_rows<T>([&](int i) { return static_cast<const Sums<double>*>(moving + bodies[i]); }, sums);
  return sums;
}

// The bodies of a group, where they are now.
template <class T>
struct Bodies {
  Where<T> at_a, at_b;
  Side<T> a, b;

  BC_INLINE Bodies(const Moving* moving, Group<T>& group)
      : at_a(where<T>(moving, group.a)),
        at_b(where<T>(moving, group.b)),
        a{speeds_of<T>(moving, group.a), group.inverse_inertia_a},
        b{speeds_of<T>(moving, group.b), group.inverse_inertia_b} {
    group.inverse_inertia_a = at_a.inverse_inertia;
    group.inverse_inertia_b = at_b.inverse_inertia;
  }
};

// The same as for a block alone, each.
template <class T>
[[gnu::noinline]] inline void load(const Work& work, Group<T>& group) {
  const Block* blocks = work.blocks;
  read_rows<T>([&](int i) { return static_cast<const Asked<double>*>(blocks + group.block[i]); },
               static_cast<Asked<T>&>(group));
  read_rows<T>([&](int i) { return static_cast<const Kept<double>*>(blocks + group.block[i]); },
               static_cast<Kept<T>&>(group));
  read_rows<T>([&](int i) { return static_cast<const Reached<double>*>(blocks + group.block[i]); },
               static_cast<Reached<T>&>(group));
}

template <class T>
[[gnu::noinline]] inline void prepare(const Work& work, Group<T>& group) {
  auto [at_a, at_b, a, b] = Bodies<T>(work.moving, group);
  auto rotated = [&] {
    Vec<T> all{};
    for (int i = 0; i < width<T>; ++i) {
      auto one = rotation_since(work.patches[work.blocks[group.block[i]].patch],
                                work.moving[group.a[i]], work.moving[group.b[i]]);
      for (int k = 0; k < 3; ++k) set_lane(all[k], i, one[k]);
    }
    return all;
  };
  prepare<T>(work.steps, a, b, at_a, at_b, rotated, group);
}

template <class T>
[[gnu::noinline]] inline void warm_start(const Work& work, Group<T>& group) {
  Side<T> a{speeds_of<T>(work.moving, group.a), group.inverse_inertia_a};
  Side<T> b{speeds_of<T>(work.moving, group.b), group.inverse_inertia_b};
  warm_start<T>(work.steps, group, a, b);
  write_speeds<T>(work.moving, group.a, group.is_free_a, a);
  write_speeds<T>(work.moving, group.b, group.is_free_b, b);
}

template <class T>
[[gnu::noinline]] inline void follow(const Work& work, Group<T>& group) {
  auto [at_a, at_b, a, b] = Bodies<T>(work.moving, group);
  follow<T>(a, b, at_a, at_b, work.steps.length, group);
}

template <class T>
[[gnu::noinline]] inline bool solve(const Work& work, const Iteration& at, Group<T>& group) {
  int iteration = at.number;
  if (iteration > 1) {  // most groups of islands at rest end here
    double last = 0.0;
    for (int i = 0; i < width<T>; ++i)
      last = max<double>(
          last, max(work.moving[group.a[i]].last_change, work.moving[group.b[i]].last_change));
    if (last < iteration - 1) return false;
  }
  Side<T> a{speeds_of<T>(work.moving, group.a), group.inverse_inertia_a};
  Side<T> b{speeds_of<T>(work.moving, group.b), group.inverse_inertia_b};
  Mask<T> due = max(a.last_change, b.last_change) >= double(iteration - 1);
  T closing = solve_normal<T>(group, rows_of<T>(group, at.is_pushing), due, a, b);
  T slipping = solve_friction<T>(group, due, a, b);
  unsigned solved = bits(due) & group.filled;
  T change = max(slipping, closing), least = splat<T>(at.is_beyond ? impact_change : least_change);
  if (any(change > impact_change))
    for (int i = 0; i < width<T>; ++i) {
      Island& island = *group.island[i];
      if ((solved >> i & 1) && lane(closing, i) > island.impact) island.is_struck = true;
      if (at.is_beyond) set_lane(least, i, island.impact);
    }
  Mask<T> calm = change <= least;
  T now = splat<T>(iteration);
  a.last_change = select<T>(calm, a.last_change, now);
  b.last_change = select<T>(calm, b.last_change, now);
  write_speeds<T>(work.moving, group.a, solved & group.is_free_a, a);
  write_speeds<T>(work.moving, group.b, solved & group.is_free_b, b);
  return (solved & ~bits(calm)) != 0;
}

// Move the bodies at some places: those of the lanes that are filled.
template <class T>
[[gnu::noinline]] inline void move(const Work& work, Lane<T> places, unsigned filled) {
  Moving* moving = work.moving;
  Speeds<T> speeds = speeds_of<T>(moving, places);
  Where<T> at{};
  read_rows<T>([&](int i) { return &moving[places[i]].placed; }, at.placed);
  T quaternion[4];
  Vec<T> inverse_inertia;
  load_rows([&](int i) { return moving[places[i]].quaternion; }, quaternion);
  load_rows([&](int i) { return work.bodies[moving[places[i]].body].inverse_inertia.v; },
            inverse_inertia.v);
  move<T>(inverse_inertia, work.steps.length, quaternion, speeds, at);
  write_speeds<T>(moving, places, filled, speeds);
  write_rows<T>([&](int i) { return static_cast<Where<double>*>(moving + places[i]); }, filled, at);
  double* quaternions[width<T>];
  for (int i = 0; i < width<T>; ++i) quaternions[i] = moving[places[i]].quaternion;
  store_rows<4, T>(quaternions, filled, quaternion);
  for (int i = 0; i < width<T>; ++i) {
    Moving& moved = moving[places[i]];
    moved.pushed = {moved.linear, moved.angular};
  }
}

template <class T>
[[gnu::noinline]] inline void count(const Work& work, Group<T>& group) {
  Sums<T> a = sums_of<T>(work.moving, group.a), b = sums_of<T>(work.moving, group.b);
  count<T>(group, a, b);
  write_rows<T>([&](int i) { return static_cast<Sums<double>*>(work.moving + group.a[i]); },
                group.is_free_a, a);
  write_rows<T>([&](int i) { return static_cast<Sums<double>*>(work.moving + group.b[i]); },
                group.is_free_b, b);
}

template <class T>
[[gnu::noinline]] inline void end(const Work& work, const Group<T>& group) {
  Block* blocks = work.blocks;
  write_rows<T>([&](int i) { return static_cast<Kept<double>*>(blocks + group.block[i]); },
                group.filled, static_cast<const Kept<T>&>(group));
  write_rows<T>([&](int i) { return static_cast<Reached<double>*>(blocks + group.block[i]); },
                group.filled, static_cast<const Reached<T>&>(group));
}

}  // namespace box_contact::BOX_CONTACT_SET::force
