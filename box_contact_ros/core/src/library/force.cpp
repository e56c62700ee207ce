// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of forces.
#include <utility>
#include <vector>

#include "batch.hpp"
#include "force_arguments.hpp"

namespace box_contact::detail {
namespace {

// What a handle stands for.
struct Handled {
  PatchForces forces;
  Threads threads{};
};
Handled& handled(bc_patch_forces* forces) { return *reinterpret_cast<Handled*>(forces); }
PatchForces& forces_of(bc_patch_forces* forces) { return handled(forces).forces; }
const PatchForces& forces_of(const bc_patch_forces* forces) {
  return reinterpret_cast<const Handled*>(forces)->forces;
}
bc_patch_forces* handle(Handled* forces) { return reinterpret_cast<bc_patch_forces*>(forces); }

bc_status explain(PatchForces::HoldResult result) {
  switch (result) {
    case PatchForces::HoldResult::pair_twice:
      return fail(BC_BAD_ARGUMENT, "pairs: a pair of boxes comes twice");
    case PatchForces::HoldResult::no_patch:
      return fail(BC_BAD_ARGUMENT, "covariance: a patch has no area, or volume / area no number");
    case PatchForces::HoldResult::all:
      break;
  }
  return BC_OK;
}

bool solve_exactly(const PairNumbers& pair, bc_contact& contact) {
  return solve_pair({chosen_kernel(), Model::exact, nullptr}, pair, BC_COVARIANCE, 0.0, contact);
}

// A surface with what is told of it.
force::Surface changed(force::Surface surface, const double* velocity, const double* friction) {
  if (velocity) surface.velocity = vector_at(velocity);
  if (friction) surface.friction = *friction == *friction ? *friction : force::no_friction;
  return surface;
}

// Solve the contacts of one's own, and read them.
bc_status solve_own(Handled& all, double dt, const Given& given) {
  const Kernel* kernel = chosen_kernel();
  if (!kernel) return fail(BC_BAD_ENVIRONMENT, "BOX_CONTACT_INSTRUCTION_SET is unknown");
  auto solve = [&](const Rows& rows, long count, const Results& results) {
    return solve_rows({kernel, Model::exact, nullptr}, rows, count, results, all.forces.threads(),
                      &all.threads);
  };
  PatchForces::HoldResult result;
  long refused = all.forces.solve_own(dt, given, solve, solve_exactly, all.threads, result);
  if (const int64_t* pair = refused >= 0 ? all.forces.own_pair(refused) : nullptr)
    return fail(BC_BAD_POSE, "pairs: box %lld or box %lld is beyond 1e50 m", (long long)pair[0],
                (long long)pair[1]);
  return explain(result);
}

// Cancels an advance that is refused, or for which there is no memory.
struct Advancing {
  PatchForces& self;
  bool is_done = false;

  ~Advancing() {
    if (!is_done) self.cancel();
  }
};

bc_status advance(bc_patch_forces* forces, double dt, const Given& given, const Changed& changed,
                  const bc_motion* motion) {
  if (!forces || !motion) return refuse_null(forces ? "motion" : "forces");
  PatchForces& self = forces_of(forces);
  if (!self.bodies().empty() && !(given.poses && given.velocities))
    return refuse_null(given.poses ? "velocities" : "poses");
  bc_motion all{};
  if (!read(motion, all)) return fail(BC_BAD_ABI, "motion.size is unknown");
  if (bc_status status = check_step(dt)) return status;
  if (bc_status status = check_changed(changed, self.bodies().size())) return status;
  Advancing advancing{self};
  self.begin(given, changed, all);
  bc_status status = check_given(self, given);
  if (status) return status;
  const Given step = self.started(dt, given);
  status = solve_own(handled(forces), dt, step);
  if (!status && self.is_waking()) status = check_given(self, given);
  if (status) return status;
  int64_t lost = self.advance(dt, step, all, solve_exactly, handled(forces).threads);
  advancing.is_done = lost < 0;
  if (advancing.is_done) return BC_OK;
  return fail(
      BC_BAD_ARGUMENT,
      "bodies[%lld]: in a step of %g s its numbers leave the range of float64; try a shorter "
      "step, or a larger mass and inertia",
      (long long)lost, dt);
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
    if (bc_status status = check_options(all)) return status;
    std::vector<Body> read;
    if (bc_status status = read_bodies(bodies, count, read)) return status;
    const Kernel* kernel = chosen_kernel();
    *forces = handle(new Handled{PatchForces(
        std::move(read), {all.substeps, all.threads, all.friction, all.most_depth, all.rest != 0},
        kernel ? &kernel->side : nullptr)});
    return BC_OK;
  });
}

bc_status bc_patch_forces_copy(const bc_patch_forces* forces, bc_patch_forces** copy) {
  return guarded([&] {
    if (!copy) return refuse_null("copy");
    *copy = nullptr;
    if (!forces) return refuse_null("forces");
    *copy = handle(new Handled{forces_of(forces).copy()});
    return BC_OK;
  });
}

void bc_patch_forces_destroy(bc_patch_forces* forces) { delete reinterpret_cast<Handled*>(forces); }

int64_t bc_patch_forces_bodies(const bc_patch_forces* forces) {
  return forces ? int64_t(forces_of(forces).bodies().size()) : 0;
}

bc_status bc_patch_forces_set_bodies(bc_patch_forces* forces, const bc_body* bodies,
                                     int64_t count) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    std::vector<Body> read;
    if (bc_status status = read_bodies(bodies, count, read)) return status;
    for (const bc_body_box& box : forces_of(forces).boxes())
      if (box.body >= count)
        return fail(BC_BAD_ARGUMENT,
                    "bodies: a box is of body %lld, so there must be more than %lld",
                    (long long)box.body, (long long)count);
    forces_of(forces).set_bodies(std::move(read));
    return BC_OK;
  });
}

bc_status bc_patch_forces_set_boxes(bc_patch_forces* forces, const bc_body_box* boxes,
                                    int64_t count, int find_pairs) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    std::vector<bc_body_box> read;
    size_t bodies = forces_of(forces).bodies().size();
    if (bc_status status = read_boxes(boxes, count, bodies, read)) return status;
    forces_of(forces).set_boxes(std::move(read), find_pairs != 0);
    return BC_OK;
  });
}

bc_status bc_patch_forces_set_surface(bc_patch_forces* forces, int64_t box, const double* velocity,
                                      const double* friction) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    PatchForces& self = forces_of(forces);
    if (box < 0 || box >= self.box_count())
      return fail(BC_BAD_ARGUMENT, "box: there is no box %lld", (long long)box);
    if (velocity && !are_within(velocity, 3, speed_max))
      return fail(BC_BAD_ARGUMENT, "velocity (%g, %g, %g) is not finite, or beyond %g",
                  velocity[0], velocity[1], velocity[2], speed_max);
    if (friction && *friction == *friction && !is_amount(*friction))
      return fail(BC_BAD_ARGUMENT, "friction must be within 0 and 1e50, or NaN, not %g", *friction);
    self.set_surface(box, changed(self.surfaces()[size_t(box)], velocity, friction));
    return BC_OK;
  });
}

bc_status bc_patch_forces_forget(bc_patch_forces* forces, const int64_t* bodies, int64_t count) {
  return guarded([&] {
    if (!forces || (!bodies && count > 0)) return refuse_null(forces ? "bodies" : "forces");
    auto known = int64_t(forces_of(forces).bodies().size());
    for (int64_t k = 0; k < count; ++k)
      if (bodies[k] < 0 || bodies[k] >= known)
        return fail(BC_BAD_ARGUMENT, "bodies[%lld]: there is no body %lld", (long long)k,
                    (long long)bodies[k]);
    forces_of(forces).forget(bodies, count);
    return BC_OK;
  });
}

void bc_patch_forces_reset(bc_patch_forces* forces) {
  if (forces) forces_of(forces).reset();
}

bc_status bc_patch_forces_hold(bc_patch_forces* forces, const bc_patches* answer,
                               const bc_pose* poses) {
  return guarded([&] {
    if (!forces || !answer) return refuse_null(forces ? "answer" : "forces");
    bc_patches all{};
    if (!read(answer, all)) return fail(BC_BAD_ABI, "answer.size is unknown");
    PatchForces& self = forces_of(forces);
    if (self.finds_pairs())
      return fail(BC_BAD_ARGUMENT,
                  "hold: the forces find their pairs themselves; to hold an answer or pairs, set boxes "
                  "without find_pairs first");
    if (all.separation && !poses && !self.bodies().empty()) return refuse_null("poses");
    if (!all.separation && self.holds(all)) return BC_OK;
    if (bc_status status = check_answer(all, self, poses)) return status;
    return explain(all.separation ? self.hold(all, poses, handled(forces).threads)
                                  : self.hold(all));
  });
}

bc_status bc_patch_forces_ahead(const bc_patch_forces* forces, double dt, const bc_pose* poses,
                                const bc_velocity* velocities, bc_pose* ahead) {
  return guarded([&] {
    if (!forces) return refuse_null("forces");
    const PatchForces& self = forces_of(forces);
    size_t count = self.bodies().size();
    if (count > 0 && !(poses && velocities && ahead))
      return refuse_null(!poses ? "poses" : !velocities ? "velocities" : "ahead");
    if (bc_status status = check_step(dt)) return status;
    if (bc_status status = check_poses(count, poses)) return status;
    for (size_t k = 0; k < count; ++k)
      if (bc_status status = check_velocity(k, velocities[k])) return status;
    self.write_ahead(dt, poses, velocities, ahead);
    return BC_OK;
  });
}

bc_status bc_patch_forces_advance(bc_patch_forces* forces, double dt, const bc_pose* poses,
                                  const bc_velocity* velocities, const bc_wrench* outside,
                                  const bc_motion* motion) {
  return guarded([&] {
    return advance(forces, dt, {poses, velocities, outside}, {false, nullptr, 0}, motion);
  });
}

bc_status bc_patch_forces_advance_changed(bc_patch_forces* forces, double dt, const bc_pose* poses,
                                          const bc_velocity* velocities, const bc_wrench* outside,
                                          const int64_t* changed, int64_t count,
                                          const bc_motion* motion) {
  return guarded([&] {
    return advance(forces, dt, {poses, velocities, outside}, {true, changed, count}, motion);
  });
}

int64_t bc_patch_forces_loads(const bc_patch_forces* forces, bc_load* loads, int64_t capacity) {
  if (!forces) return 0;
  const PatchForces& self = forces_of(forces);
  auto count = int64_t(self.load_count());
  if (!loads || capacity < count) return count;
  bc_status status = guarded([&] {
    self.write_loads(loads);
    return BC_OK;
  });
  return status == BC_OK ? count : 0;
}

}  // extern "C"
