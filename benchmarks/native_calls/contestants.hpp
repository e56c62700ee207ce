// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What a contestant of `native` is. Each library has one file, which adds its contestants.
// A report's page shows what lies between "// QUERY: NAME" and "// end of call".
#pragma once

#include <box_contact/box_contact.h>

#include <cstddef>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

constexpr double APART = std::numeric_limits<double>::infinity();

enum class Query { contact, distance };

// A pose and a size as other engines take them, made before anything is timed.
struct PlacedBox {
  double half[3];      // half extents [m]
  double position[3];  // [m]
  double matrix[9];    // of the rotation, row by row
};

struct Poses {
  std::vector<bc_pose> a, b;
  std::vector<bc_size> size_a, size_b;
  std::vector<bc_box> box_a, box_b;
  std::vector<PlacedBox> placed_a, placed_b;

  explicit Poses(const char* path);
  size_t count() const { return a.size(); }
};

struct Contestant {
  std::string name;
  size_t pairs;                             // of a round
  std::function<void(size_t first)> round;  // what is timed
  // What it answers for a pair, the signed separation or the distance [m], to be checked; not timed.
  std::function<double(size_t pair)> answer;
};

using Contestants = std::vector<Contestant>;

extern double kept;  // depends on every call, so that the compiler can leave none out

// Return a contestant that is called pair by pair. `call` returns any number that depends on its
// answer; `read` returns what is checked in the answer of the last call.
template <class Call, class Read>
Contestant single(const std::string& name, size_t calls, Call call, Read read) {
  return {name + ", single", calls,
          [=](size_t first) {
            for (size_t pair = first; pair < first + calls; ++pair) kept += call(pair);
          },
          [=](size_t pair) {
            call(pair);
            return read();
          }};
}

// Return a contestant that is called for all pairs at once, and leaves what is checked in `answers`.
template <class Call>
Contestant batched(const std::string& name, size_t pairs, Call call, const double* answers) {
  return {name + ", batch", pairs, call, [=](size_t pair) {
            if (pair == 0) call(0);
            return answers[pair];
          }};
}

// Writes what each contestant answers for the first `calls` pairs to a file: float64, a row for each.
// Prints the names of all, and a line for each contestant and round: nanoseconds a pair.
void compare(const Contestants& all, const Poses& poses, size_t rounds, size_t calls,
             const char* answers_path);

[[noreturn]] void fail(const std::string& what);

template <class Item>
std::vector<Item> read_items(std::FILE* file, size_t count) {
  std::vector<Item> items(count);
  if (std::fread(items.data(), sizeof(Item), count, file) != count) fail("a file ends early");
  return items;
}

// Each adds its contestants, with `calls` single calls a round. What they use is never freed.
void add_ours(Query query, const Poses& poses, size_t calls, Contestants& all);
void add_mujoco(Query query, const Poses& poses, size_t calls, Contestants& all);
void add_coal(Query query, const Poses& poses, size_t calls, Contestants& all);
void add_bullet(Query query, const Poses& poses, size_t calls, Contestants& all);
extern "C" void add_fcl(Query query, const Poses& poses, size_t calls, Contestants& all);
// Adds the networks of a file: for each the lengths of its name and of its numbers, int64, and both.
void add_networks_avx2(const Poses& poses, size_t calls, const char* path, Contestants& all);
void add_networks_avx512(const Poses& poses, size_t calls, const char* path, Contestants& all);

// Prints for each contact the time of a call of `exact` and of `mlp` [ns], the least of all passes.
void time_each_contact(const Poses& poses, size_t passes);
