// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of forces.
#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

#include "../force/patch_forces.hpp"
#include "refusals.hpp"

namespace box_contact::detail {
namespace {

using force::Body;
using force::PatchForces;

PatchForces& forces_of(bc_patch_forces* forces) { return *reinterpret_cast<PatchForces*>(forces); }
const PatchForces& forces_of(const bc_patch_forces* forces) {
  return *reinterpret_cast<const PatchForces*>(forces);
}
bc_patch_forces* handle(PatchForces* forces) { return reinterpret_cast<bc_patch_forces*>(forces); }

bool is_positive(double number) { return number > 0.0 && number <= largest_number; }
bool is_finite(const double* numbers, int64_t count) {
  return std::all_of(numbers, numbers + count,
                     [](double number) { return std::fabs(number) <= largest_number; });
}
// Rows of numbers of 0 or more, or no rows.
bool is_amount(const double* numbers, int64_t k) {
  return !numbers || numbers[k] == 0.0 || is_positive(numbers[k]);
}

bc_status read_bodies(const bc_body* given, int64_t count, std::vector<Body>& bodies) {
  if (!given && count > 0) return refuse_null("bodies");
  if (count < 0 || count > INT32_MAX) return fail(BC_BAD_ARGUMENT, "count is no number of bodies");
  bodies.reserve(size_t(count));
  for (int64_t k = 0; k < count; ++k) {
    bool moves = given[k].mass != 0.0;
    if (moves && !is_positive(given[k].mass))
      return fail(BC_BAD_ARGUMENT, "mass of body %lld must be positive, or 0, not %g", (long long)k,
                  given[k].mass);
    if (!is_finite(given[k].centre, 3))
      return fail(BC_BAD_ARGUMENT, "centre of body %lld is not finite", (long long)k);
    Body body{moves ? 1.0 / given[k].mass : 0.0, {0.0, 0.0, 0.0}, force::vector(given[k].centre)};
    for (int i = 0; i < 3 && moves; ++i) {
      if (!is_positive(given[k].inertia[i]))
        return fail(BC_BAD_ARGUMENT, "inertia of body %lld must be positive, not %g", (long long)k,
                    given[k].inertia[i]);
      body.inverse_inertia[i] = 1.0 / given[k].inertia[i];
    }
    bodies.push_back(body);
  }
  return BC_OK;
}

constexpr int64_t state_format = 0x3246504342;  // "BCPF2"

int64_t state_size(const PatchForces& forces) {
  size_t size = 0;
  PatchForces::visit_state(
      forces, [&size](const auto* values, size_t count) { size += count * sizeof *values; });
  return int64_t(size);
}

bc_status check_poses(size_t count, const bc_pose* poses) {
  for (size_t k = 0; k < count; ++k) {
    auto* numbers = reinterpret_cast<const double*>(poses + k);
    if (!pose_is_valid(numbers)) return refuse_pose("a body's", numbers);
  }
  return BC_OK;
}

bc_status check_row(const bc_patches& answer, int64_t k, int64_t count) {
  auto pair = (long long)k;
  const int64_t* bodies = answer.pairs + 2 * k;
  for (int side = 0; side < 2; ++side)
    if (bodies[side] < 0 || bodies[side] >= count)
      return fail(BC_BAD_ARGUMENT, "pairs[%lld]: there is no body %lld", pair,
                  (long long)bodies[side]);
  if (bodies[0] == bodies[1])
    return fail(BC_BAD_ARGUMENT, "pairs[%lld]: both boxes are body %lld", pair,
                (long long)bodies[0]);
  if (!is_amount(answer.friction, k) || !is_amount(answer.stiffness, k) ||
      (answer.surface && !is_finite(answer.surface + 3 * k, 3)))
    return fail(BC_BAD_ARGUMENT,
                "pairs[%lld]: friction and stiffness must be 0 or more, and surface finite", pair);
  if (answer.separation[k] != answer.separation[k] || answer.volume[k] == 0.0) return BC_OK;
  if (!is_positive(answer.volume[k]) || !is_finite(answer.covariance + 9 * k, 9) ||
      !is_finite(answer.normal + 3 * k, 3) || !is_finite(answer.point + 3 * k, 3))
    return fail(BC_BAD_ARGUMENT,
                "pairs[%lld]: the contact has no patch (volume %g): volume and covariance are "
                "needed, as models mlp and exact give them",
                pair, answer.volume[k]);
  return BC_OK;
}

}  // namespace
}  // namespace box_contact::detail

using namespace box_contact::detail;

extern "C" {

bc_status bc_patch_forces_create(const bc_body* bodies, int64_t count,
                                 const bc_force_options* options, bc_patch_forces** forces) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    *forces = nullptr;
    bc_force_options all = BC_DEFAULT_FORCE_OPTIONS;
    if (options && !read(options, all)) return fail(BC_BAD_ABI, "options.size is unknown");
    if (all.iterations < 1 || all.relaxations < 0)
      return fail(BC_BAD_ARGUMENT, "iterations must be 1 or more, and relaxations 0 or more");
    if (!is_amount(&all.friction, 0))
      return fail(BC_BAD_ARGUMENT, "friction must be 0 or more, not %g", all.friction);
    std::vector<Body> read;
    if (bc_status status = read_bodies(bodies, count, read)) return status;
    *forces = handle(
        new PatchForces(std::move(read), {all.iterations, all.relaxations, all.friction}));
    return BC_OK;
  });
}

bc_status bc_patch_forces_copy(const bc_patch_forces* forces, bc_patch_forces** copy) {
  return guarded([&] {
    if (!copy) return refuse_null("copy");
    *copy = nullptr;
    if (!forces) return refuse_null("forces");
    *copy = handle(new PatchForces(forces_of(forces)));
    return BC_OK;
  });
}

void bc_patch_forces_destroy(bc_patch_forces* forces) {
  delete reinterpret_cast<PatchForces*>(forces);
}

int64_t bc_patch_forces_bodies(const bc_patch_forces* forces) {
  return forces ? int64_t(forces_of(forces).bodies().size()) : 0;
}

bc_status bc_patch_forces_set_bodies(bc_patch_forces* forces, const bc_body* bodies,
                                     int64_t count) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    std::vector<Body> read;
    if (bc_status status = read_bodies(bodies, count, read)) return status;
    forces_of(forces).set_bodies(std::move(read));
    return BC_OK;
  });
}

bc_status bc_patch_forces_forget(bc_patch_forces* forces, int64_t body) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    if (body < 0 || size_t(body) >= forces_of(forces).bodies().size())
      return fail(BC_BAD_ARGUMENT, "there is no body %lld", (long long)body);
    forces_of(forces).forget(int32_t(body));
    return BC_OK;
  });
}

void bc_patch_forces_reset(bc_patch_forces* forces) {
  if (forces) forces_of(forces).reset();
}

bc_status bc_patch_forces_hold(bc_patch_forces* forces, const bc_patches* answer,
                               const bc_pose* poses) {
  return guarded([&] {
    if (!forces || !answer || !poses)
      return refuse_null(!forces ? "forces" : !answer ? "answer" : "poses");
    bc_patches all{};
    if (!read(answer, all)) return fail(BC_BAD_ABI, "answer.size is unknown");
    if (all.count < 0) return fail(BC_BAD_ARGUMENT, "count is below zero");
    if (!is_amount(&all.age, 0) || !is_amount(&all.period, 0))
      return fail(BC_BAD_ARGUMENT, "age and period must be 0 or more, not %g and %g", all.age,
                  all.period);
    if (all.count > 0 && !(all.pairs && all.separation && all.normal && all.point && all.volume &&
                           all.covariance))
      return refuse_null("an array of the answer");
    size_t bodies = forces_of(forces).bodies().size();
    if (bc_status status = check_poses(bodies, poses)) return status;
    for (int64_t k = 0; k < all.count; ++k)
      if (bc_status status = check_row(all, k, int64_t(bodies))) return status;
    if (!forces_of(forces).hold(all, poses))
      return fail(BC_BAD_ARGUMENT, "a pair of bodies comes twice");
    return BC_OK;
  });
}

bc_status bc_patch_forces_step(bc_patch_forces* forces, double dt, const bc_pose* poses,
                               const bc_velocity* velocities, const bc_wrench* outside,
                               bc_velocity* after, bc_wrench* wrenches) {
  return guarded([&] {
    if (!forces || !poses || !velocities)
      return refuse_null(!forces ? "forces" : !poses ? "poses" : "velocities");
    if (!is_positive(dt)) return fail(BC_BAD_ARGUMENT, "dt must be positive, not %g", dt);
    size_t bodies = forces_of(forces).bodies().size();
    if (bc_status status = check_poses(bodies, poses)) return status;
    for (size_t k = 0; k < bodies; ++k) {
      if (!is_finite(velocities[k].linear, 3) || !is_finite(velocities[k].angular, 3))
        return fail(BC_BAD_ARGUMENT, "velocity of body %zu is not finite", k);
      if (outside && (!is_finite(outside[k].force, 3) || !is_finite(outside[k].torque, 3)))
        return fail(BC_BAD_ARGUMENT, "wrench of body %zu is not finite", k);
    }
    forces_of(forces).step(dt, poses, velocities, outside, after, wrenches);
    return BC_OK;
  });
}

int64_t bc_patch_forces_save(const bc_patch_forces* forces, void* bytes, int64_t capacity) {
  if (!forces) return 0;
  const PatchForces& self = forces_of(forces);
  const int64_t head[] = {state_format, int64_t(self.bodies().size()), int64_t(self.patch_count())};
  auto size = int64_t(sizeof head) + state_size(self);
  if (!bytes || capacity < size) return size;
  auto* at = static_cast<char*>(bytes);
  std::memcpy(at, head, sizeof head);
  at += sizeof head;
  PatchForces::visit_state(self, [&at](const auto* values, size_t count) {
    static_assert(std::is_trivially_copyable_v<std::remove_pointer_t<decltype(values)>>);
    if (count > 0) std::memcpy(at, values, count * sizeof *values);
    at += count * sizeof *values;
  });
  return size;
}

bc_status bc_patch_forces_load(const void* bytes, int64_t count, bc_patch_forces** forces) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    *forces = nullptr;
    if (!bytes) return refuse_null("bytes");
    int64_t head[3] = {};
    auto* at = static_cast<const char*>(bytes);
    if (count >= int64_t(sizeof head)) std::memcpy(head, at, sizeof head);
    at += sizeof head;
    // Each body and each patch takes bytes, so no more of them than bytes are made room for.
    bool fits = head[0] == state_format && 0 <= head[1] && head[1] <= count && 0 <= head[2] &&
                head[2] <= count;
    PatchForces loaded({}, {1, 0, 0.0});
    if (fits) loaded.make_room(size_t(head[1]), size_t(head[2]));
    if (!fits || int64_t(sizeof head) + state_size(loaded) != count)
      return fail(BC_BAD_ARGUMENT, "the bytes are no state of this version");
    PatchForces::visit_state(loaded, [&at](auto* values, size_t rows) {
      if (rows > 0) std::memcpy(static_cast<void*>(values), at, rows * sizeof *values);
      at += rows * sizeof *values;
    });
    if (!loaded.is_sound()) return fail(BC_BAD_ARGUMENT, "the bytes are damaged");
    *forces = handle(new PatchForces(std::move(loaded)));
    return BC_OK;
  });
}

}  // extern "C"
