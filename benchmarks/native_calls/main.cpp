// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Times of libbox_contact and of other engines, C++ against C++, in turn, in one process.
//
// native contact POSES ROUNDS CALLS ANSWERS NETWORKS
// native distance POSES ROUNDS CALLS ANSWERS: prints the instruction set, and what `compare` prints.
// NETWORKS: see `add_networks_avx2`.
// native each POSES PASSES: prints the time of each contact: see `time_each_contact`.
#include <dlfcn.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "contestants.hpp"

#ifdef WITH_FCL
// FCL and Coal bring other versions of Eigen and OctoMap. Linked into one program they end it by a double
// free.
void add_fcl(Query query, const Poses& poses, size_t calls, Contestants& all) {
  void* library = dlopen("libfcl_calls.so", RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
  void* add = library ? dlsym(library, "add_fcl") : nullptr;
  if (!add) fail(dlerror());
  reinterpret_cast<decltype(&add_fcl)>(add)(query, poses, calls, all);
}
#endif

int main(int count, char** arguments) {
  std::string asked = count > 1 ? arguments[1] : "";
  if (asked == "each" && count == 4) {
    time_each_contact(Poses(arguments[2]), std::strtoul(arguments[3], nullptr, 10));
    return 0;
  }
  if (!(asked == "contact" && count == 7) && !(asked == "distance" && count == 6))
    fail(
        "usage: native contact POSES ROUNDS CALLS ANSWERS NETWORKS | distance POSES ROUNDS CALLS "
        "ANSWERS | "
        "each POSES PASSES");
  Query query = asked == "contact" ? Query::contact : Query::distance;
  Poses poses(arguments[2]);
  size_t rounds = std::strtoul(arguments[3], nullptr, 10);
  size_t calls = std::min<size_t>(std::strtoul(arguments[4], nullptr, 10), poses.count());
  std::string set = bc_instruction_set();
  Contestants all;
  add_ours(query, poses, calls, all);
#ifdef WITH_AVX2
  if (set == "avx2") add_networks_avx2(poses, calls, arguments[6], all);
#endif
#ifdef WITH_AVX512
  if (set == "avx512") add_networks_avx512(poses, calls, arguments[6], all);
#endif
  add_mujoco(query, poses, calls, all);
#ifdef WITH_COAL
  add_coal(query, poses, calls, all);
#endif
#ifdef WITH_FCL
  add_fcl(query, poses, calls, all);
#endif
#ifdef WITH_BULLET
  add_bullet(query, poses, calls, all);
#endif
  std::printf("%s\n", set.c_str());
  compare(all, poses, rounds, calls, arguments[5]);
  return kept == 0.5 ? 3 : 0;
}
