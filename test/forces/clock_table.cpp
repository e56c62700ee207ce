// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Runs the clock of forces: reads rows of `substeps latency period steps dt...`, and writes for the last
// step of each the count and length of its sub-steps, the window, and what of a window before it is given
// again and kept. A latency below 0: contacts are one's own.
#include <cstdio>

#include "force/clock.hpp"

using box_contact::BOX_CONTACT_SET::force::Clock;
using box_contact::BOX_CONTACT_SET::force::SubSteps;

int main() {
  int substeps, steps;
  double late, period;
  while (std::scanf("%d %lf %lf %d", &substeps, &late, &period, &steps) == 4) {
    Clock clock;
    if (late < 0.0)
      clock.answer_each_step();
    else
      clock.answer(late, period);
    SubSteps now{};
    double before = 0.0;
    for (double dt; steps > 0 && std::scanf("%lf", &dt) == 1; --steps) {
      before = now.window;
      now = clock.begin(dt, substeps);
      clock.end(dt);
    }
    std::printf("%d %.17g %.17g %d %.17g %.17g %.17g\n", now.count, now.length, now.window, now.rounds,
                now.again(before), now.kept(before), now.overdue);
  }
}
