// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

#pragma once

#include <cstdint>
#include <vector>

#include "../lanes/target.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Write the places below `count` in the order of their numbers, which are below `numbers`; equal ones stay in
// turn. `starts`: where each number begins in `order`, and the last ends.
template <class NumberOf>
void counting_sort(size_t count, size_t numbers, const NumberOf& number_of,
                   std::vector<int32_t>& starts, int32_t* order) {
  starts.assign(numbers + 1, 0);
  for (size_t k = 0; k < count; ++k) ++starts[size_t(number_of(k))];
  int32_t sum = 0;
  for (int32_t& start : starts) start = sum += start;
  for (size_t k = count; k-- > 0;) order[--starts[size_t(number_of(k))]] = int32_t(k);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
