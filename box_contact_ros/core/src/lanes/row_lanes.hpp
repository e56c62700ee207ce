// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Rows of numbers in memory to lanes and back, by shuffles: a lane has a row.
#pragma once

#include "lanes.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Four numbers of a row.
using FourNumbers = Lanes<double, 4>;

// Whether lanes of T are shuffled in fours. Two lanes are put together number by number.
template <class T>
constexpr bool shuffles = width<T> == 4 || width<T> == 8;

// Transpose the 4 × 4 matrix in x, or the two of them in the halves of eight lanes.
template <class T>
BC_INLINE void transpose_fours(T (&x)[4]) {
  if constexpr (width<T> == 8) {
    T even = __builtin_shufflevector(x[0], x[1], 0, 8, 2, 10, 4, 12, 6, 14);
    T odd = __builtin_shufflevector(x[0], x[1], 1, 9, 3, 11, 5, 13, 7, 15);
    T last_even = __builtin_shufflevector(x[2], x[3], 0, 8, 2, 10, 4, 12, 6, 14);
    T last_odd = __builtin_shufflevector(x[2], x[3], 1, 9, 3, 11, 5, 13, 7, 15);
    x[0] = __builtin_shufflevector(even, last_even, 0, 1, 8, 9, 4, 5, 12, 13);
    x[1] = __builtin_shufflevector(odd, last_odd, 0, 1, 8, 9, 4, 5, 12, 13);
    x[2] = __builtin_shufflevector(even, last_even, 2, 3, 10, 11, 6, 7, 14, 15);
    x[3] = __builtin_shufflevector(odd, last_odd, 2, 3, 10, 11, 6, 7, 14, 15);
  } else {
    T even = __builtin_shufflevector(x[0], x[1], 0, 4, 2, 6);
    T odd = __builtin_shufflevector(x[0], x[1], 1, 5, 3, 7);
    T last_even = __builtin_shufflevector(x[2], x[3], 0, 4, 2, 6);
    T last_odd = __builtin_shufflevector(x[2], x[3], 1, 5, 3, 7);
    x[0] = __builtin_shufflevector(even, last_even, 0, 1, 4, 5);
    x[1] = __builtin_shufflevector(odd, last_odd, 0, 1, 4, 5);
    x[2] = __builtin_shufflevector(even, last_even, 2, 3, 6, 7);
    x[3] = __builtin_shufflevector(odd, last_odd, 2, 3, 6, 7);
  }
}

// The first `count` numbers of each row, three or four of them. `row_at(i)`: the address of that of lane i.
template <int count, class T, class Row>
BC_INLINE void load_rows(const Row& row_at, T (&x)[count]) {
  if constexpr (shuffles<T>) {
    auto row = [&](int i) {
      const double* at = row_at(i);
      FourNumbers four;
      if constexpr (count == 4) {
        std::memcpy(&four, at, sizeof four);
      } else {
        four = FourNumbers{at[0], at[1], at[2], at[count - 1]};
      }
      return four;
    };
    T all[4];
    for (int i = 0; i < 4; ++i) {
      if constexpr (width<T> == 8) {
        all[i] = __builtin_shufflevector(row(i), row(i + 4), 0, 1, 2, 3, 4, 5, 6, 7);
      } else {
        all[i] = row(i);
      }
    }
    transpose_fours(all);
    for (int k = 0; k < count; ++k) x[k] = all[k];
  } else {
    for (int k = 0; k < count; ++k)
      for (int i = 0; i < width<T>; ++i) set_lane(x[k], i, row_at(i)[k]);
  }
}

// Write up to four numbers to the addresses of the lanes whose bit is set.
template <int count, class T>
BC_INLINE void store_rows(double* const (&addresses)[width<T>], unsigned chosen,
                          const T (&x)[count]) {
  if constexpr (shuffles<T> && count >= 3) {
    T all[4] = {x[0], x[1], x[2], x[count - 1]};
    transpose_fours(all);
    for (int i = 0; i < 4; ++i) {
      if constexpr (width<T> == 8) {
        FourNumbers low = __builtin_shufflevector(all[i], all[i], 0, 1, 2, 3);
        FourNumbers high = __builtin_shufflevector(all[i], all[i], 4, 5, 6, 7);
        if (chosen >> i & 1) std::memcpy(addresses[i], &low, count * sizeof(double));
        if (chosen >> (i + 4) & 1) std::memcpy(addresses[i + 4], &high, count * sizeof(double));
      } else {
        if (chosen >> i & 1) std::memcpy(addresses[i], &all[i], count * sizeof(double));
      }
    }
  } else {
    for (int i = 0; i < width<T>; ++i)
      for (int k = 0; chosen >> i & 1 && k < count; ++k) addresses[i][k] = lane(x[k], i);
  }
}

}  // namespace box_contact::BOX_CONTACT_SET
