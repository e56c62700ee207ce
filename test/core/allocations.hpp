// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Counts what a test program allocates, the library it is linked with included, and ends memory after a number.
#pragma once

#include <climits>
#include <cstdlib>
#include <new>

static long allocations = 0, allocations_allowed = LONG_MAX;

void* operator new(std::size_t size) {
  if (allocations >= allocations_allowed) throw std::bad_alloc();
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  if (allocations >= allocations_allowed) throw std::bad_alloc();
  ++allocations;
  auto unit = std::size_t(alignment);
  if (void* memory = std::aligned_alloc(unit, (size + unit - 1) / unit * unit)) return memory;
  throw std::bad_alloc();
}
// Inlined alone, they look to GCC like a free() of what no malloc() gave.
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
