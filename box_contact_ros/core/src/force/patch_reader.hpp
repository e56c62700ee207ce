// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// From answers to patches.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "patch.hpp"
#include "rigid_body.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// An answer to a question, with the poses, bodies and boxes of that question.
struct Answered {
  const bc_patches& answer;
  const bc_pose* poses;
  const std::vector<Body>& bodies;
  const std::vector<bc_body_box>& boxes;  // none: box k is body k, and nobody knows its size
  const Surfaces& surfaces;
  double friction;  // where neither the answer nor a box has one

  bool is_stale(int64_t k) const { return answer.separation[k] != answer.separation[k]; }
  // Whether something moves of the pair of row k, which touches, or has a stale contact. Boxes may have
  // been joined since the question: those of one body are no pair.
  bool is_patch(int64_t k) const {
    const int64_t* pair = answer.pairs + 2 * k;
    int32_t a = body_of(pair[0]), b = body_of(pair[1]);
    return a != b && (is_stale(k) || answer.volume[k] > 0.0) &&
           (bodies[size_t(a)].is_free() || bodies[size_t(b)].is_free());
  }
  int32_t body_of(int64_t box) const {
    return int32_t(boxes.empty() ? box : boxes[size_t(box)].body);
  }
  Placed place_box(int32_t box) const {
    if (boxes.empty()) return box_at(poses[box]);
    const bc_body_box& of = boxes[size_t(box)];
    return box_at(in_common_frame(poses[of.body], of.box.pose));
  }
};

// Read row k.
inline void read(const Answered& all, int64_t k, Patch& patch) {
  const bc_patches& answer = all.answer;
  auto a = int32_t(answer.pairs[2 * k]), b = int32_t(answer.pairs[2 * k + 1]);
  double sign = a < b ? 1.0 : -1.0;
  patch = {};
  patch.box_a = std::min(a, b);
  patch.box_b = std::max(a, b);
  patch.a = all.body_of(patch.box_a);
  patch.b = all.body_of(patch.box_b);
  patch.age = all.is_stale(k) ? -1.0 : 0.0;
  if (all.is_stale(k)) return;
  auto place = [&](int32_t body) {
    return placed_at(all.poses[body], all.bodies[size_t(body)].centre);
  };
  const Placed box_at_a = all.place_box(patch.box_a), box_at_b = all.place_box(patch.box_b);
  patch.place(place(patch.a), place(patch.b), sign * vector_at(answer.normal + 3 * k),
              answer.point + 3 * k, answer.covariance + 9 * k, answer.volume[k],
              answer.separation[k], (is_lighter_b(all.bodies, patch) ? box_at_b : box_at_a).axes);
  if (!all.boxes.empty())
    patch.end_at_rim(box_at_a, all.boxes[size_t(patch.box_a)].box.size, box_at_b,
                     all.boxes[size_t(patch.box_b)].box.size);
  patch.friction = friction_of(all.surfaces, patch.pair(),
                               answer.friction ? answer.friction[k] : no_friction, all.friction);
  patch.surface = surface_of(
      all.surfaces, patch.pair(),
      answer.surface ? sign * vector_at(answer.surface + 3 * k) : Vec<double>{0.0, 0.0, 0.0});
  patch.late = answer.age;
}

class PatchReader {
 public:
  void make_room(size_t patches) { rows_.reserve(patches); }
  // Read the rows that are patches, `row(place)` at each place. `each_chunk(count, work)` shares chunks of
  // work among threads. The age of a stale patch is below zero, and it knows nothing but its pair.
  template <class Row, class EachChunk>
  void read_rows(const Answered& all, const Row& row, std::vector<Patch>& patches,
                 const EachChunk& each_chunk) {
    rows_.clear();
    for (int64_t place = 0; place < all.answer.count; ++place)
      if (auto k = int64_t(row(size_t(place))); all.is_patch(k)) rows_.push_back(k);
    patches.resize(rows_.size());
    each_chunk(long((rows_.size() + rows_per_chunk - 1) / rows_per_chunk), [&](long, long chunk) {
      size_t first = size_t(chunk) * rows_per_chunk;
      for (size_t k = first; k < std::min(first + rows_per_chunk, rows_.size()); ++k)
        read(all, rows_[k], patches[k]);
    });
  }

 private:
  std::vector<int64_t> rows_;
};

// Hand on the impulses of the patches before, and keep the patches of stale pairs. Both are by pair.
// Returns whether there are the same pairs.
inline bool keep_impulses(const std::vector<Patch>& before, std::vector<Patch>& patches) {
  auto old = before.begin();
  auto kept = patches.begin();
  size_t known = 0;
  for (const Patch& patch : patches) {
    while (old != before.end() && old->pair() < patch.pair()) ++old;
    bool is_known = old != before.end() && old->pair() == patch.pair();
    bool is_stale = patch.age < 0.0;
    known += is_known;
    if (is_stale && !is_known) continue;
    if (is_stale)
      *kept = *old;
    else if (&*kept != &patch)
      *kept = patch;
    if (is_known) kept->keep(*old);
    ++kept;
  }
  patches.erase(kept, patches.end());
  return known == before.size() && known == patches.size();
}

}  // namespace box_contact::BOX_CONTACT_SET::force
