// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What the C interface of forces is given: read, or refused with the field, the row and the number.
#pragma once

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include "../force/patch_forces.hpp"
#include "force_limits.hpp"
#include "refusals.hpp"

namespace box_contact::detail {

using force::Body;
using BOX_CONTACT_SET::box_at;
using force::Changed;
using force::extent_along;
using force::Given;
using force::PatchForces;

// Refuse rows of which one has a number that is not within the limit.
inline bc_status check_within(const char* field, size_t row, const double* numbers, int64_t count,
                              double limit) {
  if (are_within(numbers, count, limit)) return BC_OK;
  const double* worst = std::find_if_not(
      numbers, numbers + count, [limit](double number) { return std::fabs(number) <= limit; });
  return fail(BC_BAD_ARGUMENT, "%s[%zu] has %g, which is not finite, or beyond %g", field, row,
              *worst, limit);
}

inline bc_status read_body(const bc_body& given, size_t k, Body& body) {
  const double *inertia = given.inertia, mass = given.mass;
  bool moves = mass != 0.0;
  if (moves && !is_mass(mass))
    return fail(BC_BAD_ARGUMENT, "mass of body %zu must be 0, or within 1e-50 to 1e50 kg, not %g",
                k, mass);
  for (int i = 0; i < 3; ++i)
    if (!is_mass(inertia[i]) && (moves || inertia[i] != 0.0))
      return fail(BC_BAD_ARGUMENT,
                  "inertia of body %zu must be within 1e-50 to 1e50 kg m², not (%g, %g, %g)", k,
                  inertia[0], inertia[1], inertia[2]);
  Vec<double> moments = vector(given.inertia);
  if (!is_inertia(moments))
    return fail(BC_BAD_ARGUMENT,
                "inertia of body %zu (%g, %g, %g) has a moment that exceeds the sum of the others",
                k, inertia[0], inertia[1], inertia[2]);
  Vec<double> ones{1.0, 1.0, 1.0}, zeros{0.0, 0.0, 0.0};
  body = {moves ? 1.0 / mass : 0.0, moves ? ones / moments : zeros, vector(given.centre)};
  return check_within("centre", k, given.centre, 3, length_max);
}

inline bc_status read_bodies(const bc_body* given, int64_t count, std::vector<Body>& bodies) {
  if (!given && count > 0) return refuse_null("bodies");
  if (count < 0 || count > INT32_MAX)
    return fail(BC_BAD_ARGUMENT, "count must be that of bodies, below 2^31, not %lld",
                (long long)count);
  bodies.resize(size_t(count));
  for (size_t k = 0; k < bodies.size(); ++k)
    if (bc_status status = read_body(given[k], k, bodies[k])) return status;
  return BC_OK;
}

inline bc_status check_pose(size_t k, const bc_pose& pose) {
  const double* numbers = pose.position;
  if (pose_is_valid(numbers)) return BC_OK;
  char field[32];
  std::snprintf(field, sizeof field, "poses[%zu]", k);
  return refuse_pose(field, numbers);
}
inline bc_status check_poses(size_t count, const bc_pose* poses) {
  for (size_t k = 0; k < count; ++k)
    if (bc_status status = check_pose(k, poses[k])) return status;
  return BC_OK;
}

inline bc_status check_patch(const bc_patches& answer, size_t k) {
  const double *normal = answer.normal + 3 * k, *c = answer.covariance + 9 * k;
  double volume = answer.volume[k];
  if (!(volume > 0.0 && volume <= largest_number) || c[0] != c[0])
    return fail(BC_BAD_ARGUMENT,
                "pairs[%zu]: the contact has no patch (volume %g): volume and covariance are "
                "needed, as models mlp and exact give them",
                k, volume);
  if (bc_status status = check_within("point", k, answer.point + 3 * k, 3, length_max))
    return status;
  if (!is_unit(vector_at(normal)))
    return fail(BC_BAD_ARGUMENT, "normal[%zu] (%g, %g, %g) has the length %g, not 1", k, normal[0],
                normal[1], normal[2], length(vector_at(normal)));
  if (!is_covariance(c))
    return fail(BC_BAD_ARGUMENT,
                "covariance[%zu] (%g, %g, %g; %g, %g, %g; %g, %g, %g) is not symmetric, or has an "
                "eigenvalue below 0",
                k, c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]);
  return BC_OK;
}

// Refuse a normal from box b to box a: along it the boxes would lie in each other more than twice as deep as
// against it.
inline bc_status check_side(const bc_patches& answer, size_t k, const PatchForces& self,
                            const bc_pose* poses) {
  const int64_t* pair = answer.pairs + 2 * k;
  const Vec<double> normal = vector_at(answer.normal + 3 * k);
  double way = 0.0, both = 0.0;  // from a to b, and half of both boxes, along the normal [m]
  for (int side = 0; side < 2; ++side) {
    const bc_body_box& of = self.boxes()[size_t(pair[side])];
    const auto box = box_at(force::in_common_frame(poses[of.body], of.box.pose));
    way += (side == 0 ? -1.0 : 1.0) * dot(box.position, normal);
    both += 0.5 * extent_along(box, of.box.size, normal);
  }
  if (both - way <= 2.0 * (both + way)) return BC_OK;
  return fail(BC_BAD_ARGUMENT,
              "pairs[%zu] is (%lld, %lld), but normal[%zu] (%g, %g, %g) leads from box %lld to box "
              "%lld: the contact may be of the pair (%lld, %lld)",
              k, (long long)pair[0], (long long)pair[1], k, normal[0], normal[1], normal[2],
              (long long)pair[1], (long long)pair[0], (long long)pair[1], (long long)pair[0]);
}

inline bc_status check_row(const bc_patches& answer, size_t k, const PatchForces& self,
                           const bc_pose* poses) {
  const int64_t* boxes = answer.pairs + 2 * k;
  for (int side = 0; side < 2; ++side)
    if (boxes[side] < 0 || boxes[side] >= self.box_count())
      return fail(BC_BAD_ARGUMENT, "pairs[%zu] is (%lld, %lld): there is no box %lld", k,
                  (long long)boxes[0], (long long)boxes[1], (long long)boxes[side]);
  bool is_late = answer.separation && boxes[0] != boxes[1];  // they may have been joined since
  if (self.body_of(boxes[0]) == self.body_of(boxes[1]) && !is_late)
    return fail(BC_BAD_ARGUMENT, "pairs[%zu]: both boxes are of body %lld", k,
                (long long)self.body_of(boxes[0]));
  if (answer.friction && !is_amount(answer.friction[k]))
    return fail(BC_BAD_ARGUMENT, "friction[%zu] must be within 0 and 1e50, not %g", k,
                answer.friction[k]);
  if (answer.surface)
    if (bc_status status =
            check_within("surface_velocity", k, answer.surface + 3 * k, 3, speed_max))
      return status;
  if (!answer.separation) return BC_OK;
  bool is_left_out = answer.separation[k] != answer.separation[k] || answer.volume[k] == 0.0;
  if (is_left_out) return BC_OK;
  if (bc_status status = check_patch(answer, k)) return status;
  return self.boxes().empty() ? BC_OK : check_side(answer, k, self, poses);
}

inline bc_status check_options(const bc_force_options& all) {
  if (all.substeps < 1 || all.substeps > substeps_max)
    return fail(BC_BAD_ARGUMENT, "substeps must be within 1 and %d, not %d", substeps_max,
                all.substeps);
  if (all.threads < 1 || all.threads > threads_max)
    return fail(BC_BAD_ARGUMENT, "threads must be within 1 and %d, not %d", threads_max,
                all.threads);
  if (!(all.most_depth > 0.0 && all.most_depth <= length_max))
    return fail(BC_BAD_ARGUMENT, "most_depth must be above 0 and at most 1e50 m, not %g",
                all.most_depth);
  if (!is_amount(all.friction))
    return fail(BC_BAD_ARGUMENT, "friction must be within 0 and 1e50, not %g", all.friction);
  return BC_OK;
}

inline bc_status check_answer(const bc_patches& all, const PatchForces& self,
                              const bc_pose* poses) {
  if (all.count < 0)
    return fail(BC_BAD_ARGUMENT, "count must be 0 or more, not %lld", (long long)all.count);
  if (!is_amount(all.age))
    return fail(BC_BAD_ARGUMENT, "age must be within 0 and 1e50 s, not %g", all.age);
  if (!is_amount(all.period))
    return fail(BC_BAD_ARGUMENT, "period must be within 0 and 1e50 s, not %g", all.period);
  bool is_answer = all.separation && all.normal && all.point && all.volume && all.covariance;
  if (all.count > 0 && !(all.pairs && (is_answer || !all.separation)))
    return refuse_null("an array of the answer");
  if (all.count > 0 && !all.separation && self.boxes().empty())
    return fail(BC_BAD_ARGUMENT, "contacts are needed, or sizes: set_boxes gives these");
  if (all.separation)
    if (bc_status status = check_poses(self.bodies().size(), poses)) return status;
  for (size_t k = 0; k < size_t(all.count); ++k)
    if (bc_status status = check_row(all, k, self, poses)) return status;
  return BC_OK;
}

inline bc_status read_boxes(const bc_body_box* given, int64_t count, size_t bodies,
                            std::vector<bc_body_box>& boxes) {
  if (!given && count > 0) return refuse_null("boxes");
  if (count < 0 || count > INT32_MAX)
    return fail(BC_BAD_ARGUMENT, "count must be that of boxes, below 2^31, not %lld",
                (long long)count);
  boxes.assign(given, given + count);
  for (size_t k = 0; k < boxes.size(); ++k) {
    const bc_box& box = boxes[k].box;
    const double *pose = box.pose.position, *size = box.size.extent;
    char field[32];
    std::snprintf(field, sizeof field, "poses[%zu]", k);
    if (boxes[k].body < 0 || size_t(boxes[k].body) >= bodies)
      return fail(BC_BAD_ARGUMENT, "body[%zu]: there is no body %lld", k, (long long)boxes[k].body);
    if (!pose_is_valid(pose)) return refuse_pose(field, pose);
    if (!size_valid<double>(triple(vector_at(size))))
      return fail(BC_BAD_SIZE, "sizes[%zu] (%g, %g, %g) is not within 1e-50 to 1e50 m", k, size[0],
                  size[1], size[2]);
  }
  return BC_OK;
}

inline bc_status check_step(double dt) {
  if (dt >= step_min && dt < step_limit) return BC_OK;
  return fail(BC_BAD_ARGUMENT, "dt must be at least 1e-50 s and below 1 s, not %g", dt);
}
inline bc_status check_changed(const Changed& changed, size_t bodies) {
  if (changed.count < 0)
    return fail(BC_BAD_ARGUMENT, "count must be 0 or more, not %lld", (long long)changed.count);
  if (!changed.bodies && changed.count > 0) return refuse_null("changed");
  for (int64_t k = 0; k < changed.count; ++k)
    if (changed.bodies[k] < 0 || size_t(changed.bodies[k]) >= bodies)
      return fail(BC_BAD_ARGUMENT, "changed[%lld]: there is no body %lld", (long long)k,
                  (long long)changed.bodies[k]);
  return BC_OK;
}
inline bc_status check_velocity(size_t k, const bc_velocity& velocity) {
  return check_within("velocities", k, reinterpret_cast<const double*>(&velocity), 6, speed_max);
}
// What is given as it was when a body was laid down was checked then.
inline bc_status check_given(const PatchForces& self, const Given& given) {
  auto* loads = reinterpret_cast<const double*>(given.outside);
  bc_status status = BC_OK;
  self.each_read([&](size_t k) {
    if (!status) status = check_pose(k, given.poses[k]);
    if (!status) status = check_velocity(k, given.velocities[k]);
    if (!status && loads)
      status = check_within("wrenches", k, loads + 6 * k, 6, wrench_max);
  });
  return status;
}

}  // namespace box_contact::detail
