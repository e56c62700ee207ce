// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to forces in C++17: one load, or a scene of bodies.
//
//   box_contact::HeldPatch law({mass, {ix, iy, iz}}, {200.0, 0.002, 0.001});   // Hz, s, s
//   law.hold(box_contact::collide(load, stack), load.pose);  // when an answer comes
//   box_contact::Wrench wrench = law.wrench(now, velocity);  // at every physics step
//
// force.h says what the law does, and docs/explanation/force.md how. Refused input throws
// std::invalid_argument that names field and value.
#ifndef BOX_CONTACT_FORCE_HPP
#define BOX_CONTACT_FORCE_HPP

#include <memory>

#include "box_contact.hpp"
#include "force.h"

namespace box_contact {

using Touch = bc_touch;        // a pair's contact, and the places of its bodies
using Velocity = bc_velocity;  // of the centre of mass [m/s], [rad/s], common frame
using Wrench = bc_wrench;      // force [N], and torque [N m] about the centre of mass, common frame

struct Body {
  double mass;        // [kg]; 0: no force moves it
  double inertia[3];  // about the box's own axes, through the centre of mass [kg m²]
  double centre[3] = {0.0, 0.0, 0.0};  // of mass, in the box's own frame [m]
  bool compound = false;               // of several boxes
};

struct Loop {
  double rate = 200.0;    // of questions [1/s]
  double latency = 0.0;   // from a question to the use of its answer [s]
  double step = 0.001;    // physics step [s]
  double friction = 0.5;  // Coulomb's μ
  double gravity = 9.81;  // [m/s²]
};

// Bodies that touch each other and boxes that are fixed. A copy has the same patches and friction.
class SceneLaw {
 public:
  SceneLaw(Span<const Body> bodies, const Loop& loop = Loop()) : count_(bodies.size()) {
    static_assert(sizeof(Body) == sizeof(bc_body), "Body is a bc_body with defaults");
    bc_loop plain{sizeof(bc_loop), loop.rate,     loop.latency,
                  loop.step,       loop.friction, loop.gravity};
    bc_law* made;
    check(bc_law_create(reinterpret_cast<const bc_body*>(bodies.data()),
                        std::int64_t(bodies.size()), &plain, &made));
    law_.reset(made);
  }
  SceneLaw(const SceneLaw& other) : count_(other.count_) {
    bc_law* made;
    check(bc_law_copy(other.law_.get(), &made));
    law_.reset(made);
  }
  SceneLaw(SceneLaw&&) = default;
  SceneLaw& operator=(SceneLaw other) {
    std::swap(law_, other.law_);
    count_ = other.count_;
    return *this;
  }

  // Hold these contacts, asked for at `poses`; others are forgotten.
  void hold(Span<const Touch> touches, Span<const Pose> poses) {
    check_count(poses.size());
    check(bc_law_hold(law_.get(), touches.data(), std::int64_t(touches.size()), poses.data()));
  }

  // The wrench on each body; once a physics step.
  void wrenches(Span<const Pose> poses, Span<const Velocity> velocities, Span<Wrench> found) {
    check_count(poses.size());
    check_count(velocities.size());
    check_count(found.size());
    check(bc_law_wrenches(law_.get(), poses.data(), velocities.data(), found.data()));
  }

  void reset() { bc_law_reset(law_.get()); }
  double frequency() const { return bc_law_frequency(law_.get()); }

 private:
  struct Destroy {
    void operator()(bc_law* law) const { bc_law_destroy(law); }
  };
  void check_count(std::size_t count) const {
    if (count != count_) detail::raise(BC_BAD_ARGUMENT, "a row is needed for each body");
  }
  static void check(bc_status status) {
    if (status != BC_OK) detail::raise(status, bc_error_text());
  }

  std::unique_ptr<bc_law, Destroy> law_;
  std::size_t count_;
};

// One load, and boxes that are fixed. The load is box A of its pairs, or box B where so said.
class HeldPatch {
 public:
  enum class Load { a, b };

  HeldPatch(const Body& load, const Loop& loop = Loop()) : law_(Span<const Body>(&load, 1), loop) {}

  void hold(const Contact& contact, const Pose& pose, std::int64_t pair = 0, Load load = Load::a) {
    bool is_a = load == Load::a;
    Touch touch{pair, is_a ? 0 : -1, is_a ? -1 : 0, contact, false};
    law_.hold({&touch, 1}, {&pose, 1});
  }
  // Contacts of several pairs; bodies 0 and −1.
  void hold(Span<const Touch> touches, const Pose& pose) { law_.hold(touches, {&pose, 1}); }

  Wrench wrench(const Pose& pose, const Velocity& velocity) {
    Wrench found;
    law_.wrenches({&pose, 1}, {&velocity, 1}, {&found, 1});
    return found;
  }

  void reset() { law_.reset(); }
  double frequency() const { return law_.frequency(); }

 private:
  SceneLaw law_;
};

}  // namespace box_contact

#endif
