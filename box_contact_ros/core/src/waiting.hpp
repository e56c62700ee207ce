// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Waiting for another thread.
#pragma once

namespace box_contact::detail {

// A thread looks so many times before it gives its core away: some 50 µs, as long as another takes to wake.
constexpr int looks = 2000;

// Whether a condition holds within a moment.
template <class Condition>
bool holds_soon(const Condition& holds) {
  for (int k = 0; k < looks; ++k) {
    if (holds()) return true;
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
  }
  return holds();
}

}  // namespace box_contact::detail
