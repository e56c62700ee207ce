// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Times of distances by libbox_contact and by other engines, C++ against C++, in turn, in one process.
//
// distance POSES ROUNDS CALLS ANSWERS: prints the instruction set, and what `compare` prints.
#include <dlfcn.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "../native_calls/contestants.hpp"

#ifdef WITH_FCL
// FCL and Coal bring other versions of Eigen and OctoMap. Linked into one program they end it by a double
// free.
void add_fcl(const Poses& poses, size_t calls, Contestants& all) {
  void* library = dlopen("libfcl_calls.so", RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
  void* add = library ? dlsym(library, "add_fcl") : nullptr;
  if (!add) fail(dlerror());
  reinterpret_cast<decltype(&add_fcl)>(add)(poses, calls, all);
}
#endif

int main(int count, char** arguments) {
  if (count != 5) fail("usage: distance POSES ROUNDS CALLS ANSWERS");
  Poses poses(arguments[1]);
  size_t rounds = std::strtoul(arguments[2], nullptr, 10);
  size_t calls = std::min<size_t>(std::strtoul(arguments[3], nullptr, 10), poses.count());
  Contestants all;
  add_ours(poses, calls, all);
  add_mujoco(poses, calls, all);
#ifdef WITH_COAL
  add_coal(poses, calls, all);
#endif
#ifdef WITH_FCL
  add_fcl(poses, calls, all);
#endif
#ifdef WITH_BULLET
  add_bullet(poses, calls, all);
#endif
  std::printf("%s\n", bc_instruction_set());
  compare(all, poses, rounds, calls, arguments[4]);
  return kept == 0.5 ? 3 : 0;
}
