// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// FCL through its C++ interface: the distance of two boxes by libccd, with nearest points. The program
// loads this file as a library.
#include <fcl/geometry/shape/box.h>
#include <fcl/narrowphase/distance.h>

#include "contestants.hpp"

namespace {

struct Pairs {
  fcl::Boxd box_a{1, 1, 1}, box_b{1, 1, 1};
  fcl::DistanceRequestd request{true};
  fcl::DistanceResultd result;
  std::vector<fcl::Transform3d> at_a, at_b;
  std::vector<fcl::Vector3d> size_a, size_b;

  explicit Pairs(const Poses& poses) {
    auto add = [](const PlacedBox& box, std::vector<fcl::Transform3d>& at,
                  std::vector<fcl::Vector3d>& size) {
      fcl::Transform3d pose = fcl::Transform3d::Identity();
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
          pose.linear()(row, column) = box.matrix[3 * row + column];
        pose.translation()[row] = box.position[row];
      }
      at.push_back(pose);
      size.emplace_back(2 * box.half[0], 2 * box.half[1], 2 * box.half[2]);
    };
    for (const PlacedBox& box : poses.placed_a) add(box, at_a, size_a);
    for (const PlacedBox& box : poses.placed_b) add(box, at_b, size_b);
  }
};

}  // namespace

void add_fcl(Query query, const Poses& poses, size_t calls, Contestants& all) {
  if (query != Query::distance) return;
  Pairs& q = *new Pairs(poses);
  auto distance = [&q](size_t i) {
    // distance: FCL distance
    q.box_a.side = q.size_a[i];
    q.box_b.side = q.size_b[i];
    q.result.clear();
    fcl::distance(&q.box_a, q.at_a[i], &q.box_b, q.at_b[i], q.request, q.result);
    // end of call
    return q.result.min_distance;
  };
  all.push_back(single("FCL distance", calls, distance, [&q] { return q.result.min_distance; }));
}
