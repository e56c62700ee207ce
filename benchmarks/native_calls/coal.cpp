// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Coal through its C++ interface: its deepest point, and its contact patch.
#include <coal/collision.h>
#include <coal/contact_patch.h>
#include <coal/shape/geometric_shapes.h>

#include "contestants.hpp"

namespace {

struct Query {
  coal::Box box_a{1, 1, 1}, box_b{1, 1, 1};
  coal::ComputeCollision collide{&box_a, &box_b};
  coal::ComputeContactPatch compute_patch{&box_a, &box_b};
  coal::CollisionRequest request;
  coal::CollisionResult result;
  coal::ContactPatchRequest patch_request;
  coal::ContactPatchResult patch;
  std::vector<coal::Transform3s> at_a, at_b;
  std::vector<coal::Vec3s> half_a, half_b;

  Query(const Poses& poses) {
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
    request.enable_contact = true;
  }
  double separation() const {
    return result.numContacts() ? result.getContact(0).penetration_depth : APART;
  }
};

}  // namespace

void add_coal(const Poses& poses, size_t calls, Contestants& all) {
  Query& q = *new Query(poses);
  auto read = [&q] { return q.separation(); };
  auto collide = [&q](size_t i) {
    // call: Coal ComputeCollision
    q.box_a.halfSide = q.half_a[i];
    q.box_b.halfSide = q.half_b[i];
    q.result.clear();
    q.collide(q.at_a[i], q.at_b[i], q.request, q.result);
    // end of call
    return double(q.result.numContacts());
  };
  all.push_back(single("Coal ComputeCollision", calls, collide, read));
  auto patch = [&q](size_t i) {
    // call: Coal ComputeContactPatch
    q.box_a.halfSide = q.half_a[i];
    q.box_b.halfSide = q.half_b[i];
    q.result.clear();
    q.collide(q.at_a[i], q.at_b[i], q.request, q.result);
    q.patch.clear();
    q.compute_patch(q.at_a[i], q.at_b[i], q.result, q.patch_request, q.patch);
    // end of call
    return double(q.patch.numContactPatches());
  };
  all.push_back(single("Coal ComputeContactPatch", calls, patch, read));
}
