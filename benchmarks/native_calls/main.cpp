// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Times of libbox_contact and of other engines, C++ against C++, in turn, in one process.
//
// native POSES PASSES: prints the time of each contact: see `time_each_contact`.
// native POSES ROUNDS CALLS ANSWERS NETWORKS: prints the instruction set, the names of all contestants, and a
// line for each contestant and round: nanoseconds a pair. ANSWERS gets what each contestant answers
// for the first CALLS pairs: float64, signed separations, a row for each contestant.
// NETWORKS: see `add_networks_avx2`. POSES has a count of int64, then poses of A and B (n, 7) and full extents of A and B (n, 3).
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "contestants.hpp"

int main(int count, char** arguments) {
  if (count != 3 && count != 6)
    fail("usage: native POSES PASSES | POSES ROUNDS CALLS ANSWERS NETWORKS");
  Poses poses(arguments[1]);
  if (count == 3) {
    time_each_contact(poses, std::strtoul(arguments[2], nullptr, 10));
    return 0;
  }
  size_t rounds = std::strtoul(arguments[2], nullptr, 10);
  size_t calls = std::min<size_t>(std::strtoul(arguments[3], nullptr, 10), poses.count());
  Contestants all;
  add_mujoco(poses, calls, all);
#ifdef WITH_COAL
  add_coal(poses, calls, all);
#endif
#ifdef WITH_BULLET
  add_bullet(poses, calls, all);
#endif
  add_ours(poses, calls, all);
  std::string set = bc_instruction_set();
#ifdef WITH_AVX2
  if (set == "avx2") add_networks_avx2(poses, calls, arguments[5], all);
#endif
#ifdef WITH_AVX512
  if (set == "avx512") add_networks_avx512(poses, calls, arguments[5], all);
#endif

  std::printf("%s\n", set.c_str());
  compare(all, poses, rounds, calls, arguments[4]);
  return kept == 0.5 ? 3 : 0;
}
