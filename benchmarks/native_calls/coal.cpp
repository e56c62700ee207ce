// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Coal through its C++ interface: its deepest point, its contact patch, and its distance with nearest
// points.
#include <coal/collision.h>
#include <coal/contact_patch.h>
#include <coal/distance.h>
#include <coal/shape/geometric_shapes.h>

#include "contestants.hpp"

namespace {

struct Pairs {
  coal::Box box_a{1, 1, 1}, box_b{1, 1, 1};
  coal::ComputeCollision collide{&box_a, &box_b};
  coal::ComputeContactPatch compute_patch{&box_a, &box_b};
  coal::CollisionRequest request;
  coal::CollisionResult result;
  coal::ContactPatchRequest patch_request;
  coal::ContactPatchResult patch;
  coal::ComputeDistance compute_distance{&box_a, &box_b};
  coal::DistanceRequest distance_request;
  coal::DistanceResult distance;
  std::vector<coal::Transform3s> at_a, at_b;
  std::vector<coal::Vec3s> half_a, half_b;

  explicit Pairs(const Poses& poses) {
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
    distance_request.enable_signed_distance = false;  // of boxes apart it changes nothing
  }
  double separation() const {
    return result.numContacts() ? result.getContact(0).penetration_depth : APART;
  }
};

void add_contacts(Pairs& q, size_t calls, Contestants& all) {
  auto read = [&q] { return q.separation(); };
  auto collide = [&q](size_t i) {
    // contact: Coal ComputeCollision
    q.box_a.halfSide = q.half_a[i];
    q.box_b.halfSide = q.half_b[i];
    q.result.clear();
    q.collide(q.at_a[i], q.at_b[i], q.request, q.result);
    // end of call
    return double(q.result.numContacts());
  };
  all.push_back(single("Coal ComputeCollision", calls, collide, read));
  auto patch = [&q](size_t i) {
    // contact: Coal ComputeContactPatch
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

void add_distance(Pairs& q, size_t calls, Contestants& all) {
  auto distance = [&q](size_t i) {
    // distance: Coal ComputeDistance
    q.box_a.halfSide = q.half_a[i];
    q.box_b.halfSide = q.half_b[i];
    q.distance.clear();
    q.compute_distance(q.at_a[i], q.at_b[i], q.distance_request, q.distance);
    // end of call
    return double(q.distance.min_distance);
  };
  all.push_back(single("Coal ComputeDistance", calls, distance,
                       [&q] { return double(q.distance.min_distance); }));
}

}  // namespace

void add_coal(Query query, const Poses& poses, size_t calls, Contestants& all) {
  Pairs& pairs = *new Pairs(poses);
  (query == Query::contact ? add_contacts : add_distance)(pairs, calls, all);
}
