// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs that are apart are constraints of a step all the same.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// How fast an outside wrench speeds a body up along a normal [m/s²].
inline double pull_along(const Vec<double>& normal, const bc_wrench& outside, double inverse_mass) {
  return std::fabs(dot(vector(outside.force), normal)) * inverse_mass;
}

// The gaps of a step `dt`.
class Gaps {
 public:
  Gaps(const std::vector<Body>& bodies, const std::vector<bc_body_box>& boxes, double dt,
       const bc_wrench* outside)
      : bodies_(bodies), boxes_(boxes), dt_(dt), outside_(outside) {}

  // No pair of a box that is farther apart is one for the sake of this box [m].
  double around(int32_t box) const {
    auto body = size_t(boxes_[size_t(box)].body);
    double pull =
        outside_ ? length(vector(outside_[body].force)) * bodies_[body].inverse_mass : 0.0;
    return gap_share * dt_ * dt_ * pull;
  }
  // Whether the boxes of a pair are a constraint in the step, though apart at its start: by no more than
  // what the outside wrenches would fall. A gap would else cost each box of a stack a step of free fall.
  bool is_near(int32_t box_a, int32_t box_b, const Vec<double>& normal, double apart) const {
    auto pull = [&](int32_t box) {
      auto body = size_t(boxes_[size_t(box)].body);
      return outside_ ? pull_along(normal, outside_[body], bodies_[body].inverse_mass) : 0.0;
    };
    return apart <= gap_share * dt_ * dt_ * std::max(pull(box_a), pull(box_b));
  }

 private:
  const std::vector<Body>& bodies_;
  const std::vector<bc_body_box>& boxes_;
  double dt_;
  const bc_wrench* outside_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
