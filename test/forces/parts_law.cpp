// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Cuts islands into parts, and plays their threads: whichever part may go on does so by chance. Each body
// must see its blocks in turn, round after round, and no group may have a body twice. Prints a line for each
// island: its name, its parts, and how many turns were wrong.
#include <cstdio>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "force/parts.hpp"

using namespace box_contact::BOX_CONTACT_SET::force;

namespace {

constexpr int lanes = 4, rounds = 3, plays = 20;

struct Bodies {
  std::vector<Moving> moving;
  std::vector<Block> blocks;
  std::vector<bc_pose> poses;

  void add_body(double x, double y, double z, bool is_free = true) {
    Moving body{};
    body.body = int32_t(moving.size());
    body.inverse_mass = is_free ? 1.0 : 0.0;
    moving.push_back(body);
    poses.push_back({{x, y, z}, {0.0, 0.0, 0.0, 1.0}});
  }
  void add_block(int a, int b) {
    Block block{};
    block.a = a;
    block.b = b;
    blocks.push_back(block);
  }
};

Bodies slab() {
  Bodies found;
  constexpr int nx = 12, ny = 8, nz = 4;
  found.add_body(0.0, 0.0, -1.0, false);
  for (int k = 0; k < nx * ny * nz; ++k)
    found.add_body(k % nx, k / nx % ny, k / (nx * ny));
  for (int k = 0; k < nx * ny; ++k) found.add_block(0, k + 1);
  for (int k = 0; k < nx * ny * nz; ++k) {
    if (k % nx + 1 < nx) found.add_block(k + 1, k + 2);
    if (k / nx % ny + 1 < ny) found.add_block(k + 1, k + nx + 1);
    if (k + nx * ny < nx * ny * nz) found.add_block(k + 1, k + nx * ny + 1);
  }
  return found;
}
Bodies chance(unsigned seed) {
  Bodies found;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(0.0, 10.0);
  constexpr int count = 400;
  for (int k = 0; k < count; ++k)
    found.add_body(place(random), place(random), place(random), k % 17 != 0);
  std::set<std::pair<int, int>> pairs;
  while (pairs.size() < 900) {
    int a = int(random() % count), b = int(random() % count);
    if (a < b && (a % 17 != 0 || b % 17 != 0)) pairs.insert({a, b});
  }
  for (auto [a, b] : pairs) found.add_block(a, b);
  return found;
}
Bodies tower() {
  Bodies found;
  for (int k = 0; k < 600; ++k) found.add_body(0.0, 0.0, k);
  for (int k = 0; k + 1 < 600; ++k) found.add_block(k, k + 1);
  return found;
}
Bodies star() {
  Bodies found;
  for (int k = 0; k < 600; ++k) found.add_body(k, 0.0, 0.0);
  for (int k = 1; k < 600; ++k) found.add_block(0, k);
  return found;
}

// Play the parts, and count the turns that are wrong.
int play(const Bodies& all, const Parts& parts, unsigned seed) {
  std::mt19937 random(seed);
  size_t count = parts.all.size();
  std::vector<std::vector<int>> in_group(parts.turns.size());
  for (size_t k = 0; k < all.blocks.size(); ++k)
    in_group[size_t(all.blocks[k].side) / lanes].push_back(int(k));
  struct At {
    int round;
    size_t group;
  };
  std::vector<At> at(count);
  for (size_t part = 0; part < count; ++part) at[part] = {0, parts.all[part].group};
  auto has_reached = [&](size_t part, int round, int32_t level) {
    if (at[part].round != round) return at[part].round > round;
    return parts.turns[at[part].group].level >= level;
  };
  auto may_go_on = [&](size_t part) {
    const GroupTurn& turn = parts.turns[at[part].group];
    for (size_t other = 0; other < count; ++other) {
      if (turn.parts >> other & 1 && !has_reached(other, at[part].round, turn.after)) return false;
      if (turn.parts_last >> other & 1 && !has_reached(other, at[part].round - 1, turn.after_last))
        return false;
    }
    return true;
  };
  int wrong = 0;
  std::vector<std::pair<int, int>> last(all.moving.size(), {-1, -1});  // round and block
  for (;;) {
    std::vector<size_t> ready;
    bool is_over = true;
    for (size_t part = 0; part < count; ++part) {
      if (at[part].round == rounds) continue;
      is_over = false;
      if (may_go_on(part)) ready.push_back(part);
    }
    if (is_over) break;
    if (ready.empty()) return -1;  // all wait for each other
    At& now = at[ready[random() % ready.size()]];
    std::set<int> bodies;
    for (int k : in_group[now.group])
      for (int body : {all.blocks[size_t(k)].a, all.blocks[size_t(k)].b}) {
        if (all.moving[size_t(body)].inverse_mass == 0.0) continue;
        std::pair<int, int> turn{now.round, k};
        wrong += !(last[size_t(body)] < turn) || !bodies.insert(body).second;
        last[size_t(body)] = turn;
      }
    size_t part = size_t(&now - at.data());
    if (++now.group == parts.all[part].group_end) now = {now.round + 1, parts.all[part].group};
  }
  for (const Block& block : all.blocks)
    for (int body : {block.a, block.b})
      wrong += all.moving[size_t(body)].inverse_mass > 0.0 && last[size_t(body)].first != rounds - 1;
  return wrong;
}

void judge(const std::string& name, Bodies all, size_t threads) {
  Parts parts;
  parts.make_room(all.moving.size(), all.blocks.size());
  parts.begin(all.moving.size(), all.blocks.size());
  Island island{};
  island.body_end = all.moving.size();
  island.block_end = all.blocks.size();
  int wrong = 0;
  if (parts.cut(island, threads, all.poses.data(), lanes, 0, all.moving, all.blocks))
    for (unsigned seed = 0; seed < plays && wrong == 0; ++seed) wrong = play(all, parts, seed);
  std::printf("%s %zu %d\n", name.c_str(), parts.all.size(), wrong);
}

}  // namespace

int main() {
  for (size_t threads : {2, 3, 5}) judge("slab", slab(), threads);
  for (unsigned seed = 0; seed < 5; ++seed) judge("chance", chance(seed), 3);
  judge("tower", tower(), 2);
  judge("star", star(), 2);
}
