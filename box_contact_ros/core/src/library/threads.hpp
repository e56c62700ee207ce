// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Work in as many threads as are asked for.
#pragma once

#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace box_contact::detail {

// More threads than this are refused: a number that no machine's cores ask for is a mistake.
constexpr int threads_max = 1024;

// Call `work(thread, chunk)` for each chunk. A thread takes the next chunk until none is left: one that
// starts late costs little. A single thread is the caller's, and takes no memory.
template <class Work>
void in_threads(long threads, long chunks, const Work& work) {
  std::atomic<long> next{0};
  auto take = [&](long thread) {
    for (long chunk = next++; chunk < chunks; chunk = next++) work(thread, chunk);
  };
  std::vector<std::thread> others;
  try {
    others.reserve(size_t(threads - 1));
    for (long thread = 1; thread < threads; ++thread) others.emplace_back(take, thread);
  } catch (const std::exception&) {
    // No more threads, or no memory for them: those that run take all chunks.
  }
  take(0);
  for (std::thread& other : others) other.join();
}

}  // namespace box_contact::detail
