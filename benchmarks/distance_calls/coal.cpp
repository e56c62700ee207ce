// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Coal through its C++ interface: the distance of two boxes, with nearest points.
#include <coal/distance.h>
#include <coal/shape/geometric_shapes.h>

#include "../native_calls/contestants.hpp"

namespace {

struct Query {
  coal::Box box_a{1, 1, 1}, box_b{1, 1, 1};
  coal::ComputeDistance compute{&box_a, &box_b};
  coal::DistanceRequest request;
  coal::DistanceResult result;
  std::vector<coal::Transform3s> at_a, at_b;
  std::vector<coal::Vec3s> half_a, half_b;

  explicit Query(const Poses& poses) {
    auto add = [](const PlacedBox& box, std::vector<coal::Transform3s>& at,
                  std::vector<coal::Vec3s>& half) {
      coal::Matrix3s turn;
      for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) turn(row, column) = box.matrix[3 * row + column];
      at.emplace_back(turn, coal::Vec3s(box.position[0], box.position[1], box.position[2]));
      half.emplace_back(box.half[0], box.half[1], box.half[2]);
    };
    for (const PlacedBox& box : poses.placed_a) add(box, at_a, half_a);
    for (const PlacedBox& box : poses.placed_b) add(box, at_b, half_b);
    request.enable_signed_distance = false;  // of boxes apart it changes nothing
  }
};

}  // namespace

void add_coal(const Poses& poses, size_t calls, Contestants& all) {
  Query& q = *new Query(poses);
  auto distance = [&q](size_t i) {
    // call: Coal ComputeDistance
    q.box_a.halfSide = q.half_a[i];
    q.box_b.halfSide = q.half_b[i];
    q.result.clear();
    q.compute(q.at_a[i], q.at_b[i], q.request, q.result);
    // end of call
    return double(q.result.min_distance);
  };
  all.push_back(single("Coal ComputeDistance", calls, distance,
                       [&q] { return double(q.result.min_distance); }));
}
