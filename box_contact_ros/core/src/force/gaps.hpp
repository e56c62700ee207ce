// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Which pairs that are apart are constraints of a step all the same.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "body_step.hpp"
#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// How fast an outside wrench speeds a body up along a normal [m/s²].
inline double pull_along(const Vec<double>& normal, const bc_wrench& outside, double inverse_mass) {
  return std::fabs(dot(vector(outside.force), normal)) * inverse_mass;
}

// The gaps of a step `dt`: what closes within it, by outside wrenches and by the velocities at its start.
class Gaps {
 public:
  Gaps(const std::vector<Body>& bodies, const std::vector<bc_body_box>& boxes, double dt,
       const Given& given, const std::vector<bc_velocity>& carriers)
      : bodies_(bodies), boxes_(boxes), dt_(dt), given_(given), carriers_(carriers) {}

  // Those of another step.
  Gaps within(double dt) const { return {bodies_, boxes_, dt, given_, carriers_}; }
  // No pair of a box that is farther apart is one for the sake of this box [m].
  double around(int32_t box) const {
    auto body = body_of(box);
    double pull =
        given_.outside ? length(vector(given_.outside[body].force)) * bodies_[body].inverse_mass : 0.0;
    return falls(pull) + dt_ * (length(vector(velocity_of(body).linear)) + turning(box));
  }
  // Whether the boxes of a pair are a constraint in the step, though apart at its start. A gap would else
  // cost each box of a stack a step of free fall, and what is fast would be deep in the other, or beyond it.
  // way: on which B goes beside A until they touch [m].
  bool is_near(int32_t box_a, int32_t box_b, const Vec<double>& normal, double apart,
               Vec<double>& way) const {
    size_t a = body_of(box_a), b = body_of(box_b);
    auto pull = [&](size_t body) {
      return given_.outside
                 ? pull_along(normal, given_.outside[body], bodies_[body].inverse_mass)
                 : 0.0;
    };
    way = -apart * normal;
    double fall = falls(std::max(pull(a), pull(b)));
    if (apart <= fall) return true;
    Vec<double> beside = vector(velocity_of(b).linear) - vector(velocity_of(a).linear);
    double closing = -dot(beside, normal);
    if (closing > 0.0) way += std::min(dt_, apart / closing) * (beside + closing * normal);
    return apart <= fall + dt_ * std::max(0.0, closing + turning(box_a) + turning(box_b));
  }

 private:
  const bc_velocity& velocity_of(size_t body) const {
    return bodies_[body].is_free() ? given_.velocities[body] : carriers_[body];
  }
  size_t body_of(int32_t box) const { return size_t(boxes_[size_t(box)].body); }
  double falls(double pull) const { return gap_share * dt_ * dt_ * pull; }
  // How fast a point of a box is at most by the turning of its body [m/s].
  double turning(int32_t box) const {
    const bc_box& of = boxes_[size_t(box)].box;
    auto body = body_of(box);
    double spin = length(vector(velocity_of(body).angular));
    if (spin == 0.0) return 0.0;
    return spin * (length(vector(of.pose.position) - bodies_[body].centre) +
                   0.5 * length(vector(of.size.extent)));
  }

  const std::vector<Body>& bodies_;
  const std::vector<bc_body_box>& boxes_;
  double dt_;
  const Given& given_;
  const std::vector<bc_velocity>& carriers_;  // velocities of the bodies that no force moves
};

}  // namespace box_contact::BOX_CONTACT_SET::force
