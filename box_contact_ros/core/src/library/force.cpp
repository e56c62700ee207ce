// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of the force law.
#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include "../force/patch_law.hpp"
#include "refusals.hpp"

namespace box_contact::detail {
namespace {

using force::Body;
using force::PatchLaw;

// Of a load at rest [m]. Beyond it the rate or a time is in another unit, as a period for a rate.
constexpr double deepest_rest = 1.0;

struct Law {
  PatchLaw law;
  std::vector<int64_t> pairs;  // of the contacts that are being checked
};

Law& law_of(bc_law* law) { return *reinterpret_cast<Law*>(law); }
const Law& law_of(const bc_law* law) { return *reinterpret_cast<const Law*>(law); }

const double* numbers(const bc_pose& pose) { return reinterpret_cast<const double*>(&pose); }

bool is_positive(double number) { return number > 0.0 && number <= largest_number; }
bool is_finite(const double* numbers, int count) {
  for (int k = 0; k < count; ++k)
    if (!(std::fabs(numbers[k]) <= largest_number)) return false;
  return true;
}

bc_status read_body(const bc_body& given, int64_t place, std::vector<Body>& bodies) {
  bool moves = given.mass != 0.0;
  if (moves && !is_positive(given.mass))
    return fail(BC_BAD_ARGUMENT, "mass of body %lld must be positive, or 0, not %g",
                (long long)place, given.mass);
  Body body{
      moves ? 1.0 / given.mass : 0.0, {0.0, 0.0, 0.0}, force::vector(given.centre), given.compound};
  for (int k = 0; k < 3; ++k) {
    if (moves && !is_positive(given.inertia[k]))
      return fail(BC_BAD_ARGUMENT, "inertia of body %lld must be positive, not %g",
                  (long long)place, given.inertia[k]);
    if (moves) body.inverse_inertia[k] = 1.0 / given.inertia[k];
  }
  if (!is_finite(given.centre, 3))
    return fail(BC_BAD_ARGUMENT, "centre of body %lld is not finite", (long long)place);
  bodies.push_back(body);
  return BC_OK;
}

bc_status check_loop(const bc_loop& loop) {
  struct Number {
    const char* name;
    double value;
    bool may_be_zero;
  } const numbers[] = {{"rate", loop.rate, false},
                       {"latency", loop.latency, true},
                       {"step", loop.step, false},
                       {"friction", loop.friction, true},
                       {"gravity", loop.gravity, true}};
  for (const Number& number : numbers)
    if (!is_positive(number.value) && !(number.may_be_zero && number.value == 0.0))
      return fail(BC_BAD_ARGUMENT, "%s must be %s, not %g", number.name,
                  number.may_be_zero ? "0 or more" : "positive", number.value);
  return BC_OK;
}

// Whether the normal can be meant for a body. A plane across the normal bounds the body's box. The
// contact is at most a depth behind that plane, and the centre of mass is not beyond it.
bool is_outward(const bc_contact& contact, const Body& body, const bc_pose& pose, double sign) {
  force::Placed placed = force::placed_at(pose, body.centre);
  double outward =
      dot(force::vector(contact.point) - placed.position, force::vector(contact.normal));
  // Half a depth more, for models whose point is not exact.
  return body.compound || sign * outward >= 1.5 * contact.separation;
}

bc_status check_touch(const bc_touch& touch, const std::vector<Body>& bodies,
                      const bc_pose* poses) {
  const bc_contact& contact = touch.contact;
  auto pair = (long long)touch.pair;
  int64_t count = int64_t(bodies.size());
  for (int32_t body : {touch.a, touch.b})
    if (body < -1 || body >= count)
      return fail(BC_BAD_ARGUMENT, "pair %lld: there is no body %d", pair, int(body));
  auto is_free = [&](int32_t body) { return body >= 0 && bodies[size_t(body)].is_free(); };
  if (touch.a >= 0 && touch.a == touch.b)
    return fail(BC_BAD_ARGUMENT, "pair %lld: both boxes are body %d", pair, int(touch.a));
  if (!is_free(touch.a) && !is_free(touch.b))
    return fail(BC_BAD_ARGUMENT, "pair %lld: no force moves either of its two bodies", pair);
  if (touch.stale || contact.volume == 0.0) return BC_OK;
  if (!is_positive(contact.volume) || !is_finite(contact.covariance[0], 9))
    return fail(BC_BAD_ARGUMENT,
                "pair %lld: the contact has no patch (volume %g), and the law needs volume and "
                "covariance: ask for both, of model mlp or exact",
                pair, contact.volume);
  if (!is_finite(contact.normal, 3) || !is_finite(contact.point, 3) ||
      !is_finite(&contact.separation, 1))
    return fail(BC_BAD_ARGUMENT, "pair %lld: normal or point is not finite", pair);
  for (auto [body, sign, side] : {std::tuple{touch.a, 1.0, 'A'}, {touch.b, -1.0, 'B'}})
    if (body >= 0 && !is_outward(contact, bodies[size_t(body)], poses[body], sign))
      return fail(
          BC_BAD_ARGUMENT,
          "pair %lld: the normal points %s body %d, which is box %c: say that it is box %c "
          "(load='%c' for one load; else exchange a and b), or ask for the contact with the boxes "
          "in the other order",
          pair, side == 'A' ? "into" : "out of", int(body), side, side == 'A' ? 'B' : 'A',
          side == 'A' ? 'b' : 'a');
  return BC_OK;
}

bc_status check_touches(Law& self, const bc_touch* touches, int64_t count, const bc_pose* poses) {
  const std::vector<Body>& bodies = self.law.bodies();
  for (size_t k = 0; k < bodies.size(); ++k)
    if (!pose_is_valid(numbers(poses[k]))) return refuse_pose("a body's", numbers(poses[k]));
  self.pairs.clear();
  for (int64_t k = 0; k < count; ++k) {
    if (bc_status status = check_touch(touches[k], bodies, poses)) return status;
    self.pairs.push_back(touches[k].pair);
  }
  std::sort(self.pairs.begin(), self.pairs.end());
  auto twice = std::adjacent_find(self.pairs.begin(), self.pairs.end());
  if (twice != self.pairs.end())
    return fail(BC_BAD_ARGUMENT, "pair %lld comes twice", (long long)*twice);
  return BC_OK;
}

}  // namespace
}  // namespace box_contact::detail

using namespace box_contact::detail;

extern "C" {

bc_status bc_law_create(const bc_body* bodies, int64_t count, const bc_loop* loop, bc_law** law) {
  return guarded([&] {
    if (!law) return refuse_null("law");
    *law = nullptr;
    if (!bodies) return refuse_null("bodies");
    bc_loop all = BC_DEFAULT_LOOP;
    if (loop && !read(loop, all)) return fail(BC_BAD_ABI, "loop.size is unknown");
    if (count < 1) return fail(BC_BAD_ARGUMENT, "count must be 1 or more");
    if (bc_status status = check_loop(all)) return status;
    LawConstants constants = constants_for(all);
    double rest = all.gravity / (constants.frequency * constants.frequency);
    if (rest > deepest_rest)
      return fail(BC_BAD_ARGUMENT,
                  "with rate %g 1/s, latency %g s and step %g s a load would rest %g m deep",
                  all.rate, all.latency, all.step, rest);
    std::vector<Body> read;
    for (int64_t place = 0; place < count; ++place)
      if (bc_status status = read_body(bodies[place], place, read)) return status;
    *law = reinterpret_cast<bc_law*>(new Law{{std::move(read), constants}, {}});
    return BC_OK;
  });
}

bc_status bc_law_copy(const bc_law* law, bc_law** copy) {
  return guarded([&] {
    if (!copy) return refuse_null("copy");
    *copy = nullptr;
    if (!law) return refuse_null("law");
    *copy = reinterpret_cast<bc_law*>(new Law(law_of(law)));
    return BC_OK;
  });
}

void bc_law_destroy(bc_law* law) { delete reinterpret_cast<Law*>(law); }

void bc_law_reset(bc_law* law) {
  if (law) law_of(law).law.reset();
}

double bc_law_frequency(const bc_law* law) {
  return law ? law_of(law).law.constants().frequency : 0.0;
}

bc_status bc_law_hold(bc_law* law, const bc_touch* touches, int64_t count, const bc_pose* poses) {
  return guarded([&] {
    if (!law || !poses || (!touches && count > 0))
      return refuse_null(!law ? "law" : !poses ? "poses" : "touches");
    if (count < 0) return fail(BC_BAD_ARGUMENT, "count is below zero");
    if (bc_status status = check_touches(law_of(law), touches, count, poses)) return status;
    law_of(law).law.hold(touches, count, poses);
    return BC_OK;
  });
}

bc_status bc_law_wrenches(bc_law* law, const bc_pose* poses, const bc_velocity* velocities,
                          bc_wrench* wrenches) {
  return guarded([&] {
    if (!law || !poses || !velocities || !wrenches)
      return refuse_null(!law ? "law" : !poses ? "poses" : !velocities ? "velocities" : "wrenches");
    size_t bodies = law_of(law).law.bodies().size();
    for (size_t k = 0; k < bodies; ++k) {
      if (!pose_is_valid(numbers(poses[k]))) return refuse_pose("a body's", numbers(poses[k]));
      if (!is_finite(velocities[k].linear, 3) || !is_finite(velocities[k].angular, 3))
        return fail(BC_BAD_ARGUMENT, "velocity of body %zu is not finite", k);
    }
    law_of(law).law.wrenches(poses, velocities, wrenches);
    return BC_OK;
  });
}

}  // extern "C"
