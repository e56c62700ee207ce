// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A container is lifted off a stack in a yard of 5,000, goes over others and is let down: one way is too
// low, the other is free. It prints:
//
//   at 14.0 m: within 0.5 m of box 8 at 1.01
//   at 14.0 m: within 0.5 m of box 13 at 1.26
//   at 14.0 m: within 0.5 m of box 18 at 1.51
//   at 15.0 m: free, 0.562 m from box 8
#include <cstdio>
#include <vector>

#include "box_contact/index.hpp"

using namespace box_contact;

const Size container{12.192, 2.438, 2.591};  // [m]

Pose level(double x, double y, double z) { return {{x, y, z}, {0, 0, 0, 1}}; }

int main() {
  // 50 rows of 20 stacks of five tiers; in the first row, every fourth stack has four.
  std::vector<Pose> poses;
  for (int row = 0; row < 50; ++row)
    for (int stack = 0; stack < 20; ++stack)
      for (int tier = 0; tier < (row == 0 && stack % 4 == 0 ? 4 : 5); ++tier)
        poses.push_back(level(14.0 * row, 3.0 * stack, 2.591 * (tier + 0.5)));
  const std::vector<Size> sizes(poses.size(), container);
  const Index yard(sizes, poses);

  for (double top : {14.0, 15.0}) {
    const double rest = 2.591 * 4.5;
    const std::vector<Pose> places{level(0, 0, rest), level(0, 0, top), level(0, 12, top),
                                   level(0, 12, rest + 0.6)};
    Way way{Span<const Size>(&container, 1), places};
    way.clearance = 0.5;
    Path path(yard, way);
    while (!path.advance(1000)) {
      // Here a simulator answers others.
    }
    for (const Meeting& impact : path.impacts())
      std::printf("at %.1f m: within 0.5 m of box %d at %.2f\n", top, int(impact.b),
                  impact.approach.time);
    if (path.impacts().size() == 0)
      std::printf("at %.1f m: free, %.3f m from box %d\n", top,
                  path.least()->approach.nearest.distance, int(path.least()->b));
  }
}
