// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs of many boxes are asked for, and which box of a pair is A: by lists, by groups and by
// bodies. A box is a number; guests, whose numbers are behind those of all boxes, meet everything.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace box_contact::detail {

struct BoxPair {
  BoxPair(int64_t a, int64_t b) : a(a), b(b) {}
  int64_t a, b;
};

struct Filter {
  std::vector<BoxPair> listed;
  std::vector<int32_t> group, body;  // of each box; a body below 0: the box is a part of none
  std::vector<int32_t> order;        // of each box: the first is A where both may be
  // (groups, groups), by the groups of two boxes. Bit 0: the first may be A. Bit 1: the other may.
  std::vector<uint8_t> allowed;
  size_t groups = 0;

  int64_t count() const { return int64_t(group.size()); }

  // Have `listed_side` know all pairs of `listed`.
  void sort_listed() {
    keys_.clear();
    for (const BoxPair& pair : listed) keys_.push_back(2 * key(pair.a, pair.b) + (pair.a > pair.b));
    std::sort(keys_.begin(), keys_.end());
  }
  // Which of two boxes is A of a listed pair: 1: the first, 2: the other, 0: it is not listed.
  uint8_t listed_side(int64_t first, int64_t other) const {
    uint64_t pair = key(first, other);
    auto found = std::lower_bound(keys_.begin(), keys_.end(), 2 * pair);
    if (found == keys_.end() || *found / 2 != pair) return 0;
    return (first > other) == bool(*found % 2) ? 1 : 2;
  }
  // Whether groups let a box meet any other.
  bool meets(int64_t box) const {
    const uint8_t* row = allowed.data() + groups * size_t(group[size_t(box)]);
    return std::any_of(row, row + groups, [](uint8_t sides) { return sides != 0; });
  }
  // Which of two boxes is A of a pair that is not listed: 1: the first, 2: the other, 0: they are no
  // pair that is asked for.
  uint8_t side(int64_t first, int64_t other) const {
    bool is_guest = first >= count(), other_is = other >= count();
    if (is_guest || other_is) return is_guest && !(other_is && other < first) ? 1 : 2;
    auto one = size_t(first), two = size_t(other);
    if (!groups || (body[one] >= 0 && body[one] == body[two]) || listed_side(first, other))
      return 0;
    uint8_t sides = allowed[groups * size_t(group[one]) + size_t(group[two])];
    return sides == 3 ? (order[one] < order[two] ? 1 : 2) : sides;
  }

  // The same number for (a, b) and (b, a).
  static uint64_t key(int64_t a, int64_t b) {
    return uint64_t(std::min(a, b)) << 32 | uint64_t(std::max(a, b));
  }

 private:
  std::vector<uint64_t> keys_;  // twice that of each listed pair, and 1 where A is the higher box
};

}  // namespace box_contact::detail
