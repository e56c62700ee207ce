// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From contacts to wrenches: an elastic foundation over each patch, with friction that remembers.
//
// The foundation has the modulus κ [N/m³]. The overlap has volume V, centroid c, area A and
// covariance C. They and the motion of the bodies since the question give the resultant:
//
//     1. Pressure   P = κ·V' + b·v_c              along −n at c, on body A
//     2. Rocking    κ·A·C_t·(n × (θ + ρ·ψ)) × n   θ: the turn since then; the damper has this form
//     3. Friction   k_t·u + c_t·slip at c         u: an anchor that follows the slip
//        Torsion    k_t·r·φ + c_t·r·spin about n  φ: the anchor's turn
//
// Friction f and torsion m, each divided by its limit under μ·P, stay within f² + m² + a·f²·m² ≤ 1.
// The more square the patch is, the larger is a.
//
// ψ is the turn of late: ψ' = θ' − ψ / `lean_time`. It acts as a spring and a damper in line,
// parallel to the spring of θ. It takes energy out of the slow sway of stacks. A plain damper that
// did so would be stiffer than the step allows.
//
// V' = V + A·δ: δ is how much deeper the bodies are by now. v_c is the closing speed at c.
//
// κ = Ω² / w. Here w is the largest eigenvalue of M⁻¹K of the bodies on a foundation of modulus 1. So
// no oscillation is faster than Ω. docs/explanation/force.md derives all of this.
//
// Nothing but + − · / √ is computed, so all instruction sets give the same bits.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "constants.hpp"
#include "stiffness.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

using detail::LawConstants;

// The patch of a pair, as it was asked for, and what its friction remembers.
struct Patch {
  int64_t pair;
  int a, b;  // places of the bodies; −1: fixed in the common frame
  Vec<double> normal, point;
  double volume;
  PatchShape shape;
  Placed asked_a, asked_b;
  double modulus;  // κ
  double shear;    // modulus of the tangential springs
  double mass;     // that resists at the point along the normal [kg]

  bool is_anchored = false;
  Vec<double> anchor{};           // u [m], in the tangent plane
  double anchor_turn = 0.0;       // φ [rad]
  Vec<double> lean{};             // ψ [rad]
  double anchor_stiffness = 0.0;  // k_t when they were last changed [N/m]
  double carried_force = 0.0;     // the pressing force, averaged over `carried_time` [N]
};

// What two bodies do at a patch, seen from B.
struct Relative {
  Vec<double> point;        // of the patch, by now
  double deeper;            // than when it was asked for [m]
  Vec<double> turned;       // θ, since it was asked for
  Vec<double> slid, spun;   // since the last evaluation [m], [rad]
  Vec<double> carrier;      // turn of what the anchor is fixed to, since the last evaluation
  Vec<double> speed, spin;  // [m/s], [rad/s]
};

class PatchLaw {
 public:
  PatchLaw(std::vector<Body> bodies, const LawConstants& constants)
      : bodies_(std::move(bodies)),
        law_(constants),
        places_(bodies_.size()),
        last_(bodies_.size()),
        normal_(bodies_.size()),
        shear_(bodies_.size()) {}

  const std::vector<Body>& bodies() const { return bodies_; }
  const LawConstants& constants() const { return law_; }

  void reset() {
    patches_.clear();
    has_last_ = false;
  }

  // Take the contacts that are in force from now on, and the poses of all bodies when they were
  // asked for. Pairs that are missing, or apart, are forgotten; a stale pair keeps its patch.
  void hold(const bc_touch* touches, int64_t count, const bc_pose* poses) {
    place(poses);
    next_.clear();
    for (int64_t k = 0; k < count; ++k) {
      const bc_touch& touch = touches[k];
      if (touch.stale) {
        if (const Patch* old = held(touch.pair)) next_.push_back(*old);
      } else if (touch.contact.volume > 0.0) {
        next_.push_back(patch_of(touch));
      }
    }
    std::sort(next_.begin(), next_.end(),
              [](const Patch& one, const Patch& other) { return one.pair < other.pair; });
    find_moduli();
    patches_.swap(next_);
  }

  // The wrenches on all bodies at these poses and motions. Call it once a physics step: friction
  // follows the way from one call to the next.
  void wrenches(const bc_pose* poses, const bc_velocity* velocities, bc_wrench* found) {
    place(poses);
    std::fill_n(found, bodies_.size(), bc_wrench{});
    for (Patch& patch : patches_) {
      Relative relative = relative_at(patch, velocities);
      Vec<double> force, torque;
      if (!wrench_of(patch, relative, force, torque)) continue;
      for (auto [body, sign] : {std::pair{patch.a, 1.0}, {patch.b, -1.0}})
        if (body >= 0)
          add(found[body], sign, places_[body].position, relative.point, force, torque);
    }
    last_.swap(places_);
    has_last_ = true;
  }

  // The patch of a pair, or nullptr.
  const Patch* held(int64_t pair) const {
    auto found = std::lower_bound(patches_.begin(), patches_.end(), pair,
                                  [](const Patch& patch, int64_t id) { return patch.pair < id; });
    return found != patches_.end() && found->pair == pair ? &*found : nullptr;
  }

 private:
  void place(const bc_pose* poses) {
    for (size_t k = 0; k < bodies_.size(); ++k) places_[k] = placed_at(poses[k], bodies_[k].centre);
  }
  bool is_free(int body) const { return body >= 0 && bodies_[body].is_free(); }

  Patch patch_of(const bc_touch& touch) const {
    const Patch* old = held(touch.pair);
    Patch patch = old ? *old : Patch{};
    patch.pair = touch.pair;
    patch.a = touch.a;
    patch.b = touch.b;
    patch.normal = vector(touch.contact.normal);
    patch.point = vector(touch.contact.point);
    patch.volume = touch.contact.volume;
    patch.shape = shape_of(touch.contact);
    if (!old) patch.modulus = infinity;
    double resisting = 0.0;
    for (int body : {patch.a, patch.b})
      if (is_free(body))
        resisting += inverse_mass_at(bodies_[body], places_[body], patch.point, patch.normal);
    patch.mass = 1.0 / resisting;
    if (patch.a >= 0) patch.asked_a = places_[patch.a];
    if (patch.b >= 0) patch.asked_b = places_[patch.b];
    return patch;
  }

  // κ of each new patch: what the loop bears by the softer of its bodies. It falls at once to that,
  // which takes energy away, and rises slowly.
  void find_moduli() {
    std::fill(normal_.begin(), normal_.end(), Stiffness{});
    std::fill(shear_.begin(), shear_.end(), Stiffness{});
    for (const Patch& patch : next_) {
      double factor = is_free(patch.a) && is_free(patch.b) ? 2.0 : 1.0;
      for (int body : {patch.a, patch.b})
        if (is_free(body))
          add_patch(bodies_[body], places_[body], patch.normal, patch.point, patch.shape, factor,
                    normal_[body], shear_[body]);
    }
    fastest_.assign(2 * bodies_.size(), -1.0);
    for (Patch& patch : next_) {
      double across = 0.0, along = 0.0;
      for (int body : {patch.a, patch.b}) {
        if (!is_free(body)) continue;
        double& normal = fastest_[2 * body];
        double& shear = fastest_[2 * body + 1];
        if (normal < 0.0) {
          normal = normal_[body].largest_eigenvalue();
          shear = shear_[body].largest_eigenvalue();
        }
        across = std::max(across, normal);
        along = std::max(along, shear);
      }
      double borne = law_.frequency * law_.frequency / across;
      if (patch.modulus < borne)
        patch.modulus += law_.rise * std::max(0.0, detail::steady_share * borne - patch.modulus);
      patch.modulus = std::min(patch.modulus, borne);
      patch.shear = patch.modulus * detail::tangential_share * across / along;
    }
  }

  Relative relative_at(const Patch& patch, const bc_velocity* velocities) const {
    Vec<double> zero{0.0, 0.0, 0.0};
    Relative found{patch.point, 0.0, zero, zero, zero, zero, zero, zero};
    bool both = is_free(patch.a) && is_free(patch.b);
    for (int side = 0; side < 2; ++side) {
      int body = side == 0 ? patch.a : patch.b;
      if (body < 0) continue;
      const Placed& asked = side == 0 ? patch.asked_a : patch.asked_b;
      double sign = side == 0 ? 1.0 : -1.0;
      Vec<double> way = carried(asked, places_[body], patch.point) - patch.point;
      found.deeper += sign * dot(way, patch.normal);
      found.turned = found.turned + sign * turn(asked, places_[body]);
      // The patch goes with the body that no force moves, or with the mean of two that are free.
      if (!is_free(body) || both) found.point = found.point + (both ? 0.5 : 1.0) * way;
    }
    for (int side = 0; side < 2; ++side) {
      int body = side == 0 ? patch.a : patch.b;
      if (body < 0) continue;
      double sign = side == 0 ? 1.0 : -1.0;
      const bc_velocity& velocity = velocities[body];
      Vec<double> angular = vector(velocity.angular);
      Vec<double> arm = found.point - places_[body].position;
      found.speed = found.speed + sign * (vector(velocity.linear) + cross(angular, arm));
      found.spin = found.spin + sign * angular;
      if (!has_last_) continue;
      Vec<double> was = carried(places_[body], last_[body], found.point);
      Vec<double> turned = turn(last_[body], places_[body]);
      found.slid = found.slid + sign * (found.point - was);
      found.spun = found.spun + sign * turned;
      if (!is_free(body) || both) found.carrier = found.carrier + (both ? 0.5 : 1.0) * turned;
    }
    return found;
  }

  // Force at the patch's point and torque about it, on body A. Returns false if no force acts.
  bool wrench_of(Patch& patch, const Relative& relative, Vec<double>& force, Vec<double>& torque) {
    const Vec<double>& n = patch.normal;
    const PatchShape& shape = patch.shape;
    double gravity = law_.gravity;
    double volume = patch.volume + shape.area * relative.deeper, depth = volume / shape.area;
    double closing = dot(relative.speed, n);
    // The damper is whole from a shallow depth on: b = (2·ζ/Ω)·κ·A. λ is b by the elastic force.
    double least = detail::whole_damper_depth * gravity / (law_.frequency * law_.frequency);
    double damping = 2.0 * law_.damping_ratio / (law_.frequency * std::max(depth, least));
    double elastic = patch.modulus * volume, share = 1.0 + damping * closing;
    double push = volume > 0.0 ? elastic * share : 0.0;
    // No more than what stops the body while the wrench acts, and lets it go back slower than it
    // would have fallen in.
    double back = detail::recoil * std::sqrt(2.0 * gravity * std::max(0.0, depth));
    double limit = patch.mass * ((closing + back) / law_.step) +
                   std::max(patch.mass * gravity, patch.carried_force);
    double cut = push > 0.0 && push > limit ? std::max(0.0, limit) / push : 1.0;
    push *= cut;
    patch.carried_force += (std::max(0.0, push) - patch.carried_force) *
                           std::min(1.0, law_.step / detail::carried_time);
    double stiffness = patch.shear * shape.area;
    if (!(push > 0.0)) {
      patch.anchor = {0.0, 0.0, 0.0};
      patch.anchor_turn = 0.0;
      patch.lean = {0.0, 0.0, 0.0};
      patch.anchor_stiffness = stiffness;
      patch.is_anchored = true;
      return false;
    }
    follow(patch, relative, stiffness);
    Vec<double> slip = relative.speed - closing * n;
    double about;
    Vec<double> grip = friction(patch, slip, dot(relative.spin, n), law_.friction * push, about);
    force = -(push * n) - grip;
    Vec<double> damped = rocking(shape, n, damping * cross(n, relative.spin), share);
    lean(patch, relative, depth);
    Vec<double> tilted =
        rocking(shape, n, cross(n, relative.turned + law_.lean * patch.lean), depth);
    torque = -(about * n) - cut * (elastic * damped + patch.modulus * shape.area * tilted);
    return true;
  }

  // Follow the turn of late. The spring gives way at a share of the pressure.
  void lean(Patch& patch, const Relative& relative, double depth) const {
    patch.lean = (1.0 - law_.forget) * patch.lean + relative.spun;
    double at_rim = law_.lean * rim(patch.shape, cross(patch.normal, patch.lean));
    double most = detail::lean_yield * std::max(0.0, depth);
    if (at_rim > most) patch.lean = (most / at_rim) * patch.lean;
  }

  // Move the anchor by the way that A's point under the patch has gone since the last evaluation.
  static void follow(Patch& patch, const Relative& relative, double stiffness) {
    const Vec<double>& n = patch.normal;
    Vec<double> u = patch.anchor + cross(relative.carrier, patch.anchor);
    if (patch.is_anchored) {
      // Into the plane of today, with its length kept: a corner that rolls onto its face keeps hold.
      double before = length(u);
      u = u - dot(u, n) * n;
      double now = length(u);
      if (now > 0.1 * before) u = (before / now) * u;
      u = u + relative.slid - dot(relative.slid, n) * n;
      patch.anchor_turn += dot(relative.spun, n);
      // A spring that becomes stiffer must not gain energy.
      if (stiffness > patch.anchor_stiffness) {
        double softer = patch.anchor_stiffness / stiffness;
        u = softer * u;
        patch.anchor_turn *= softer;
      }
    }
    patch.anchor = u;
    patch.anchor_stiffness = stiffness;
    patch.is_anchored = true;
  }

  // Friction (3,) [N] against the slip and, in `about`, the torsion [N m] against the spin.
  Vec<double> friction(Patch& patch, const Vec<double>& slip, double spin, double limit,
                       double& about) const {
    double stiffness = patch.anchor_stiffness, radius = patch.shape.radius;
    Vec<double> force = stiffness * patch.anchor;
    double torsion = stiffness * radius * patch.anchor_turn;  // by the radius [N]
    // First the springs alone, which give way; then with their dampers.
    auto over = [&] {
      double slide = dot(force, force), turn = torsion * torsion, both = slide + turn;
      double dent = 4.0 * patch.shape.dent * slide * turn;
      return std::sqrt(0.5 * (both + std::sqrt(both * both + dent))) / limit;
    };
    if (double beyond = over(); beyond > 1.0) {
      patch.anchor = (1.0 / beyond) * patch.anchor;
      patch.anchor_turn /= beyond;
      force = (1.0 / beyond) * force;
      torsion /= beyond;
    }
    double damper = 2.0 * law_.tangential_damping_ratio * stiffness /
                    (law_.frequency * std::sqrt(detail::tangential_share));
    force = force + damper * slip;
    torsion += damper * radius * spin;
    if (double beyond = over(); beyond > 1.0) {
      force = (1.0 / beyond) * force;
      torsion /= beyond;
    }
    about = radius * torsion;
    return force;
  }

  // The moment by a pressure that changes over the patch by `slope`·x, x from the centroid. Where
  // that exceeds `least` at the rim, √3 standard deviations away, pressures would be negative: it is
  // cut to that.
  static Vec<double> rocking(const PatchShape& shape, const Vec<double>& n,
                             const Vec<double>& slope, double least) {
    double at_rim = rim(shape, slope);
    double kept = at_rim > least ? std::max(0.0, least) / at_rim : 1.0;
    return kept * cross(shape.covariance * slope, n);
  }

  static double rim(const PatchShape& shape, const Vec<double>& slope) {
    return std::sqrt(3.0 * std::max(0.0, dot(slope, shape.covariance * slope)));
  }

  // Add a force at `point`, and a torque about it.
  static void add(bc_wrench& sum, double sign, const Vec<double>& centre, const Vec<double>& point,
                  const Vec<double>& force, const Vec<double>& torque) {
    Vec<double> about = torque + cross(point - centre, force);
    for (int k = 0; k < 3; ++k) {
      sum.force[k] += sign * force[k];
      sum.torque[k] += sign * about[k];
    }
  }

  std::vector<Body> bodies_;
  LawConstants law_;
  std::vector<Patch> patches_, next_;  // by pair
  std::vector<Placed> places_, last_;  // now, and at the last evaluation
  bool has_last_ = false;
  std::vector<Stiffness> normal_, shear_;
  std::vector<double> fastest_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
