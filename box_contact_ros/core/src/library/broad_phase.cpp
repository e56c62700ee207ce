// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of the broad phase.
#include "../broad_phase.hpp"

#include "../../include/box_contact/broad_phase.h"
#include "refusals.hpp"

namespace box_contact::detail {
namespace {

bool is_box(int64_t box, int64_t count) { return box >= 0 && box < count; }

// The body of each box: a number of its own, below 0, where it is a part of none.
std::vector<int32_t> read_bodies(const bc_boxes& boxes) {
  std::vector<int32_t> body;
  for (int32_t box = 0; box < int32_t(boxes.count); ++box)
    body.push_back(boxes.bodies && boxes.bodies[box] >= 0 ? boxes.bodies[box] : -1 - box);
  return body;
}

// Read half extents that are larger by half the margin: boxes overlap then, if they are apart by the
// margin at most.
bc_status read_half(const bc_size& size, double margin, int64_t box, Vec<double>& half) {
  const double* e = size.extent;
  if (!size_valid<double>(triple(Vec<double>{e[0], e[1], e[2]})))
    return fail(BC_BAD_SIZE, "sizes[%lld] (%g, %g, %g) is not within 1e-50 to 1e50 m",
                (long long)box, e[0], e[1], e[2]);
  for (int k = 0; k < 3; ++k) half[k] = 0.5 * e[k] + 0.5 * margin;
  return BC_OK;
}

// Which pairs `boxes` ask for, or the words of a refusal.
bc_status read_asked(const bc_boxes& boxes, const std::vector<int32_t>& body, Asked& asked) {
  for (int64_t k = 0; boxes.listed && k < boxes.listed_count; ++k) {
    int64_t a = boxes.listed[2 * k], b = boxes.listed[2 * k + 1];
    if (!is_box(a, boxes.count) || !is_box(b, boxes.count) || a == b)
      return fail(BC_BAD_ROWS, "listed[%lld] is (%lld, %lld), but there are %lld boxes",
                  (long long)k, (long long)a, (long long)b, (long long)boxes.count);
    if (body[size_t(a)] == body[size_t(b)])
      return fail(BC_BAD_ROWS, "listed[%lld] is (%lld, %lld), boxes of one body", (long long)k,
                  (long long)a, (long long)b);
    asked.listed.insert(asked.listed.end(), {a, b});
  }
  if (!boxes.groups) {
    asked.groups = boxes.listed ? 0 : 1;
    asked.group.assign(size_t(boxes.count), 0);
    asked.allowed.assign(size_t(asked.groups), 1);
    return BC_OK;
  }
  if (boxes.group_count < 1 || !boxes.allowed)
    return fail(BC_BAD_ARGUMENT, "groups need a group_count, and which of them meet");
  asked.groups = boxes.group_count;
  for (int64_t box = 0; box < boxes.count; ++box)
    if (!is_box(boxes.groups[box], boxes.group_count))
      return fail(BC_BAD_ROWS, "groups[%lld] is %d, but there are %d", (long long)box,
                  int(boxes.groups[box]), int(boxes.group_count));
  asked.group.assign(boxes.groups, boxes.groups + boxes.count);
  size_t all = size_t(asked.groups) * size_t(asked.groups);
  asked.allowed.assign(boxes.allowed, boxes.allowed + all);
  return BC_OK;
}

bc_status make(const bc_boxes& boxes, bc_broad_phase** made) {
  if (boxes.count < 0 || boxes.count > INT32_MAX)
    return fail(BC_BAD_ARGUMENT, "count %lld is that of no boxes", (long long)boxes.count);
  if (boxes.count && !boxes.sizes) return refuse_null("sizes");
  if (!(boxes.margin >= 0.0 && boxes.margin <= length_max))
    return fail(BC_BAD_ARGUMENT, "margin must lie within 0 and 1e50 m, not %g", boxes.margin);
  std::vector<Vec<double>> half(size_t(boxes.count));
  for (int64_t box = 0; box < boxes.count; ++box)
    if (bc_status status = read_half(boxes.sizes[box], boxes.margin, box, half[size_t(box)]))
      return status;
  std::vector<uint8_t> fixed(size_t(boxes.count), 0);
  if (boxes.fixed) fixed.assign(boxes.fixed, boxes.fixed + boxes.count);
  std::vector<int32_t> body = read_bodies(boxes);
  Asked asked;
  bc_status status = read_asked(boxes, body, asked);
  if (status == BC_OK)
    *made = reinterpret_cast<bc_broad_phase*>(new BroadPhase(
        std::move(half), boxes.margin, std::move(fixed), std::move(body), std::move(asked)));
  return status;
}

bc_status resize(BroadPhase& self, int64_t box, const bc_size& size) {
  if (!is_box(box, int64_t(self.count())) || self.is_fixed(box))
    return fail(BC_BAD_ROWS, "box %lld is fixed, or none of the %zu boxes", (long long)box,
                self.count());
  Vec<double> half{};
  bc_status status = read_half(size, self.margin, box, half);
  if (status == BC_OK) self.resize(box, half);
  return status;
}

bc_status take_fixed(BroadPhase& self, const BroadPhase& former, const int64_t* kept) {
  if (self.margin != former.margin)
    return fail(BC_BAD_ARGUMENT, "margin %g is not that of the former one, %g", self.margin,
                former.margin);
  for (size_t box = 0; box < self.count(); ++box)
    if (kept[box] >= 0 && !is_box(kept[box], int64_t(former.count())))
      return fail(BC_BAD_ROWS, "kept[%zu] is %lld, but there were %zu boxes", box,
                  (long long)kept[box], former.count());
  self.take_fixed(former, kept);
  return BC_OK;
}

// What a search that ended with `refused` found.
bc_status answer(const BroadPhase& self, const bc_pose* poses, int64_t refused, bc_near& near) {
  near = {sizeof(bc_near),
          reinterpret_cast<const int64_t*>(self.pairs().data()),
          int64_t(self.pairs().size()),
          reinterpret_cast<const int64_t*>(self.stale().data()),
          int64_t(self.stale().size()),
          refused};
  if (refused < 0) return BC_OK;
  char field[32];
  std::snprintf(field, sizeof field, "pose of box %lld", (long long)refused);
  return refuse_pose(field, poses[refused].position);
}

bc_status check_search(const BroadPhase& self, const bc_pose* poses, int64_t most,
                       const bc_near& near) {
  if (near.size != sizeof(bc_near)) return fail(BC_BAD_ABI, "near.size is unknown");
  if (self.count() && !poses) return refuse_null("poses");
  if (most < 0) return fail(BC_BAD_ARGUMENT, "most must be 0 or more, not %lld", (long long)most);
  return BC_OK;
}

bc_status check_changed(const int64_t* changed, int64_t count, int64_t boxes) {
  if (count < 0)
    return fail(BC_BAD_ARGUMENT, "count must be 0 or more, not %lld", (long long)count);
  if (!changed && count > 0) return refuse_null("changed");
  for (int64_t k = 0; k < count; ++k)
    if (!is_box(changed[k], boxes))
      return fail(BC_BAD_ROWS, "changed[%lld] is %lld, but there are %lld boxes", (long long)k,
                  (long long)changed[k], (long long)boxes);
  return BC_OK;
}

const double* numbers_of(const bc_pose* poses) { return reinterpret_cast<const double*>(poses); }
BroadPhase& phase_of(bc_broad_phase* broad_phase) {
  return *reinterpret_cast<BroadPhase*>(broad_phase);
}

}  // namespace
}  // namespace box_contact::detail

using namespace box_contact::detail;

extern "C" {

bc_status bc_broad_phase_create(const bc_boxes* boxes, bc_broad_phase** broad_phase) {
  return guarded([&] {
    if (!boxes || !broad_phase) return refuse_null(boxes ? "broad_phase" : "boxes");
    *broad_phase = nullptr;
    bc_boxes all{};
    if (!read(boxes, all)) return fail(BC_BAD_ABI, "boxes.size is unknown");
    return make(all, broad_phase);
  });
}

void bc_broad_phase_destroy(bc_broad_phase* broad_phase) {
  delete reinterpret_cast<BroadPhase*>(broad_phase);
}

bc_status bc_broad_phase_resize(bc_broad_phase* broad_phase, int64_t box, const bc_size* size) {
  return guarded([&] {
    if (!broad_phase || !size) return refuse_null(size ? "broad_phase" : "size");
    return resize(phase_of(broad_phase), box, *size);
  });
}

bc_status bc_broad_phase_take_fixed(bc_broad_phase* broad_phase, const bc_broad_phase* former,
                                    const int64_t* kept) {
  return guarded([&] {
    if (!broad_phase || !former || !kept)
      return refuse_null(!broad_phase ? "broad_phase" : former ? "kept" : "former");
    return take_fixed(phase_of(broad_phase), *reinterpret_cast<const BroadPhase*>(former), kept);
  });
}

bc_status bc_broad_phase_find(bc_broad_phase* broad_phase, const bc_pose* poses, int64_t most,
                              bc_near* near) {
  return guarded([&] {
    if (!broad_phase || !near) return refuse_null(near ? "broad_phase" : "near");
    BroadPhase& self = phase_of(broad_phase);
    if (bc_status status = check_search(self, poses, most, *near)) return status;
    return answer(self, poses, self.find(numbers_of(poses), most), *near);
  });
}

bc_status bc_broad_phase_find_changed(bc_broad_phase* broad_phase, const bc_pose* poses,
                                      const int64_t* changed, int64_t count, int64_t most,
                                      bc_near* near) {
  return guarded([&] {
    if (!broad_phase || !near) return refuse_null(near ? "broad_phase" : "near");
    BroadPhase& self = phase_of(broad_phase);
    bc_status status = check_search(self, poses, most, *near);
    if (!status) status = check_changed(changed, count, int64_t(self.count()));
    if (status) return status;
    return answer(self, poses, self.find_changed(numbers_of(poses), changed, count, most), *near);
  });
}

}  // extern "C"
