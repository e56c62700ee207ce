// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to forces in C++17, by sequential impulses.
//
//   box_contact::PatchForces forces(bodies);
//   forces.set_boxes(boxes, true);                          // it finds their pairs
//   forces.advance(0.001, poses, velocities, weights);      // at every physics step
//
// force.h describes the arguments, and docs/explanation/force.md the method. Refused input throws
// std::invalid_argument that names field and value.
#ifndef BOX_CONTACT_FORCE_HPP
#define BOX_CONTACT_FORCE_HPP

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "box_contact.hpp"
#include "force.h"

namespace box_contact {

using Velocity = bc_velocity;  // of the centre of mass [m/s], [rad/s], common frame
using Wrench = bc_wrench;      // force [N], and torque [N m] about the centre of mass, common frame
using Load = bc_load;          // what the contact of two boxes carried
using BodyBox = bc_body_box;   // a body, and a box in its frame

// An answer: pairs of boxes, and what `collide` gave for them. Without `results`, contacts are one's
// own: `PatchForces` solves the pairs at the start of each advance.
struct Patches {
  Span<const std::int64_t> pairs;  // two boxes a row
  Results results;                 // separation, normal, point, volume and covariance
  Span<const double> friction{};   // Coulomb's μ of each pair; none: the lesser of both boxes
  Span<const double> surface{};    // velocity of B's surface relative to A's, three numbers a row [m/s]
  double age = 0.0;                // since the answer was asked for [s]
  double period = 0.0;             // from one question to the next [s]; 0: by the last answers

  explicit Patches(Span<const std::int64_t> boxes, const Results& found = {})
      : pairs(boxes), results(found) {}
  Patches(const Rows& rows, const Results& found) : Patches(pairs_of(rows), found) {}

 private:
  static Span<const std::int64_t> pairs_of(const Rows& rows) {
    if (!rows.pairs) detail::raise(BC_BAD_ARGUMENT, "rows must have pairs, which name the bodies");
    return *rows.pairs;
  }
};

struct Body {
  double mass;        // [kg]; 0: no force moves it
  double inertia[3];  // about the body's own axes, through the centre of mass [kg m²]
  double centre[3] = {0.0, 0.0, 0.0};  // of mass, in the body's own frame [m]

  // The body of a box of one density; of mass 0, one that no force moves.
  static Body of_box(const Size& size, double mass) {
    double x = size.extent[0], y = size.extent[1], z = size.extent[2], share = mass / 12.0;
    return {mass, {share * (y * y + z * z), share * (z * z + x * x), share * (x * x + y * y)}};
  }
};

// The forces of patches on all bodies. A copy has the same patches and impulses.
class PatchForces {
 public:
  struct Options {
    int substeps = 4;       // equal parts of the longest step lately, more if 5 ms are exceeded
    int threads = 1;        // at most
    double friction = 0.5;  // Coulomb's μ of boxes without their own
    double most_depth = 1e-3;  // of what rests [m], where a load is large for the lighter body
    bool rest = true;          // whether what rests is laid down
  };

  explicit PatchForces(Span<const Body> bodies) : PatchForces(bodies, Options()) {}
  PatchForces(Span<const Body> bodies, const Options& options) {
    bc_force_options plain{sizeof(bc_force_options), options.substeps,   options.threads,
                           options.friction,         options.most_depth, options.rest};
    bc_patch_forces* made;
    detail::check(bc_patch_forces_create(plain_of(bodies), std::int64_t(bodies.size()), &plain, &made));
    forces_.reset(made);
  }
  PatchForces(const PatchForces& other) {
    bc_patch_forces* made;
    detail::check(bc_patch_forces_copy(other.forces_.get(), &made));
    forces_.reset(made);
  }
  PatchForces(PatchForces&&) = default;
  PatchForces& operator=(PatchForces other) {
    std::swap(forces_, other.forces_);
    return *this;
  }

  // Change masses, add bodies at the end, or drop bodies there with their patches.
  // A body that has boxes is not dropped: set_boxes without them first.
  void set_bodies(Span<const Body> bodies) {
    detail::check(bc_patch_forces_set_bodies(forces_.get(), plain_of(bodies), std::int64_t(bodies.size())));
  }
  // Forget the patches of bodies, which were put elsewhere.
  void forget(Span<const std::int64_t> bodies) {
    detail::check(bc_patch_forces_forget(forces_.get(), bodies.data(), std::int64_t(bodies.size())));
  }
  void reset() { bc_patch_forces_reset(forces_.get()); }

  // Say which boxes the bodies have: pairs are then of boxes, and poses of bodies. find_pairs: each advance
  // finds the pairs that touch, and nothing is to be held.
  void set_boxes(Span<const BodyBox> boxes, bool find_pairs = false) {
    detail::check(bc_patch_forces_set_boxes(forces_.get(), boxes.data(), std::int64_t(boxes.size()),
                                            find_pairs));
  }

  // Set the velocity of a box's surface beside that of its body, as of a belt, in the common frame [m/s], and
  // perhaps its friction: a pair has the lesser of both boxes. They last until they are set again.
  void set_surface(std::int64_t box, const double (&velocity)[3]) {
    detail::check(bc_patch_forces_set_surface(forces_.get(), box, velocity, nullptr));
  }
  void set_surface(std::int64_t box, const double (&velocity)[3], double friction) {
    detail::check(bc_patch_forces_set_surface(forces_.get(), box, velocity, &friction));
  }

  // Take an answer, asked for at `poses`; pairs that are left out are forgotten. Contacts of one's own
  // need set_boxes, and no poses.
  void hold(const Patches& answer, Span<const Pose> poses = {}) {
    const Results& found = answer.results;
    if (found.separation) check_count(poses.size());
    if (answer.pairs.size() % 2) detail::raise(BC_BAD_ARGUMENT, "pairs must be two indices a row");
    const std::size_t count = answer.pairs.size() / 2;
    check_column(answer.friction, count);
    check_column(answer.surface, 3 * count);
    const bc_patches plain{sizeof(bc_patches),      std::int64_t(count), answer.pairs.data(),
                           found.separation,        found.normal,        found.point,
                           found.volume,            found.covariance,    answer.friction.data(),
                           answer.surface.data(),   answer.age,          answer.period};
    detail::check(bc_patch_forces_hold(forces_.get(), &plain, poses.data()));
  }

  // Write the poses at which to take the wrenches of ropes and springs for the next advance.
  void ahead(double dt, Span<const Pose> poses, Span<const Velocity> velocities,
             Span<Pose> found) const {
    check_rows(poses, velocities, {});
    check_count(found.size());
    detail::check(bc_patch_forces_ahead(forces_.get(), dt, poses.data(), velocities.data(), found.data()));
  }
  // Move the bodies for `dt` [s]; `outside` are all wrenches but those of contacts, or none. `awake`: a
  // row for each body, 0 for those at rest; or none.
  void advance(double dt, Span<Pose> poses, Span<Velocity> velocities, Span<const Wrench> outside = {},
               Span<unsigned char> awake = {}) {
    if (awake.size()) check_count(awake.size());
    advance(dt, poses, velocities, outside,
            {sizeof(bc_motion), poses.data(), velocities.data(), nullptr, awake.data()});
  }
  // The same, where of the bodies at rest only those of `changed` may be given otherwise than at the end
  // of the last advance: the other bodies at rest take next to no time.
  void advance_changed(Span<const std::int64_t> changed, double dt, Span<Pose> poses,
                       Span<Velocity> velocities, Span<const Wrench> outside = {},
                       Span<unsigned char> awake = {}) {
    if (awake.size()) check_count(awake.size());
    check_rows(poses, velocities, outside);
    const bc_motion motion{sizeof(bc_motion), poses.data(), velocities.data(), nullptr, awake.data()};
    detail::check(bc_patch_forces_advance_changed(forces_.get(), dt, poses.data(), velocities.data(),
                                                  outside.data(), changed.data(),
                                                  std::int64_t(changed.size()), &motion));
  }
  // The mean wrenches of contacts, for a simulator that moves the bodies by itself.
  void wrenches(double dt, Span<const Pose> poses, Span<const Velocity> velocities,
                Span<const Wrench> outside, Span<Wrench> found) {
    check_count(found.size());
    advance(dt, poses, velocities, outside, {sizeof(bc_motion), nullptr, nullptr, found.data(), nullptr});
  }

  // What each pair carried, by the lower and the higher box: the mean of the last advance. No row
  // if bodies or boxes were changed, or patches forgotten, since.
  std::vector<Load> loads() const {
    std::vector<Load> found(loads(Span<Load>()));
    found.resize(loads(found));
    return found;
  }
  // Write them to rows, and return how many there are; with fewer rows, none is written. It allocates no memory
  // once as many were written.
  std::size_t loads(Span<Load> found) const {
    return std::size_t(
        bc_patch_forces_loads(forces_.get(), found.data(), std::int64_t(found.size())));
  }

 private:
  struct Destroy {
    void operator()(bc_patch_forces* forces) const { bc_patch_forces_destroy(forces); }
  };
  static const bc_body* plain_of(Span<const Body> bodies) {
    static_assert(sizeof(Body) == sizeof(bc_body), "Body is a bc_body with defaults");
    return reinterpret_cast<const bc_body*>(bodies.data());
  }
  void check_count(std::size_t count) const {
    if (std::int64_t(count) != bc_patch_forces_bodies(forces_.get()))
      detail::raise(BC_BAD_ARGUMENT, "a row is needed for each body");
  }
  void check_rows(Span<const Pose> poses, Span<const Velocity> velocities,
                  Span<const Wrench> outside) const {
    check_count(poses.size());
    check_count(velocities.size());
    if (outside.size()) check_count(outside.size());
  }
  static void check_column(Span<const double> column, std::size_t count) {
    if (column.size() && column.size() != count)
      detail::raise(BC_BAD_ARGUMENT, "a number is needed for each pair");
  }
  void advance(double dt, Span<const Pose> poses, Span<const Velocity> velocities,
               Span<const Wrench> outside, const bc_motion& motion) {
    check_rows(poses, velocities, outside);
    detail::check(bc_patch_forces_advance(forces_.get(), dt, poses.data(), velocities.data(),
                                          outside.data(), &motion));
  }

  std::unique_ptr<bc_patch_forces, Destroy> forces_;
};

}  // namespace box_contact

#endif
