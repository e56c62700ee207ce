// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Boxes that only pass each other by a rim have no patch.
//
// What rests is microns deep. So what lies flush with the top of a neighbour overlaps this by microns along the
// vertical, and by less sideways: SAT takes the side, and the sliver would press like a wall.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "patch_reader.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

class Rims {
 public:
  void set_bodies(size_t count) {
    sunk_.resize(3 * count);
    tier_.resize(3 * count);
  }
  // Drop patches of boxes that overlap along the normal of faces of both by no more than the lip: the tolerance of
  // faces, and how far either body has sunk along it. What is deeper than a part of the thinner box is no rim.
  void drop(const Answered& all, std::vector<Patch>& patches) {
    double highest = face_tolerance;  // no lip is higher [m]
    for (const Patch& patch : patches) highest += depth_of(patch);
    auto may_pass = [&](const Patch& patch) { return patch.age >= 0.0 && patch.beside <= highest; };
    if (std::none_of(patches.begin(), patches.end(), may_pass)) return;
    sink(all.bodies, patches);
    patches.erase(std::remove_if(patches.begin(), patches.end(),
                                 [&](const Patch& patch) {
                                   return may_pass(patch) && passes(all, patch);
                                 }),
                  patches.end());
  }

 private:
  // How deep the boxes of a patch are in each other, if they meet by more than a rim [m].
  static double depth_of(const Patch& patch) {
    bool meets = patch.age >= 0.0 && patch.beside > face_tolerance;
    return meets ? std::max(0.0, patch.overlap) : 0.0;
  }
  static size_t place(int32_t body, const Placed& at, const Vec<double>& direction) {
    return 3 * size_t(body) + size_t(axis_along(at.axes, direction));
  }
  // Depths add up from tier to tier, from what no force moves on.
  void sink(const std::vector<Body>& bodies, const std::vector<Patch>& patches) {
    for (const Patch& patch : patches)
      for (int32_t body : {patch.a, patch.b}) {
        std::fill_n(&sunk_[3 * size_t(body)], 3, 0.0);
        std::fill_n(&tier_[3 * size_t(body)], 3, bodies[size_t(body)].is_free() ? INT32_MAX : 0);
      }
    bool goes_on = true;
    for (int32_t tier = 1; goes_on; ++tier) {
      goes_on = false;
      for (const Patch& patch : patches) {
        double depth = depth_of(patch);
        if (depth == 0.0) continue;
        size_t a = place(patch.a, patch.asked_a, patch.normal),
               b = place(patch.b, patch.asked_b, patch.normal);
        for (auto [low, high] : {std::pair{a, b}, std::pair{b, a}}) {
          if (tier_[low] != tier - 1 || tier_[high] < tier) continue;
          tier_[high] = tier;
          sunk_[high] = std::max(sunk_[high], sunk_[low] + depth);
          goes_on = true;
        }
      }
    }
  }
  bool passes(const Answered& all, const Patch& patch) const {
    const bc_size &size_a = all.boxes[size_t(patch.box_a)].box.size,
                  &size_b = all.boxes[size_t(patch.box_b)].box.size;
    const Placed a = all.place_box(patch.box_a), b = all.place_box(patch.box_b);
    auto has_face = [](const Placed& box, const Vec<double>& normal) {
      return std::fabs(dot(column(box.axes, axis_along(box.axes, normal)), normal)) >= along_a_face;
    };
    bool passes = false;
    each_face_across(a, b, patch.normal, [&](const Vec<double>& face) {
      if (!has_face(a, face) || !has_face(b, face)) return;  // an edge on a face: they are not flush
      double thinner = std::min(extent_along(a, size_a, face), extent_along(b, size_b, face));
      double sunk = std::max(sunk_[place(patch.a, patch.asked_a, face)],
                             sunk_[place(patch.b, patch.asked_b, face)]);
      double lip = std::min(face_tolerance + sunk, deepest_part * thinner);
      passes = passes || overlap_along(a, size_a, b, size_b, face) <= lip;
    });
    return passes;
  }

  // Of each body, along its three axes: how far it has sunk [m], and by how many patches from what no force moves.
  std::vector<double> sunk_;
  std::vector<int32_t> tier_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
