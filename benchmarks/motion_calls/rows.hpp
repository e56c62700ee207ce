// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Motions as the report writes them, and how a call is timed.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

using Clock = std::chrono::steady_clock;

struct Row {
  double start_a[7], end_a[7], start_b[7], end_b[7], size_a[3], size_b[3], centre_a[3], centre_b[3];
  double clearance;
};

[[noreturn]] inline void fail(const char* why) {
  std::fprintf(stderr, "motion: %s\n", why);
  std::exit(1);
}

// The least time of some calls [ns], less the clock's own.
template <class Call>
double nanoseconds(Call call) {
  double least = 1e300, own = 1e300;
  for (int k = 0; k < 5; ++k) {
    auto first = Clock::now(), second = Clock::now();
    call();
    auto third = Clock::now();
    own = std::min(own, std::chrono::duration<double, std::nano>(second - first).count());
    least = std::min(least, std::chrono::duration<double, std::nano>(third - second).count());
  }
  return least - own;
}
