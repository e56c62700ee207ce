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
  double friction;                        // where the answer has none

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
};

// So many patches are read, or bodies placed, at a time: some 10 to 50 µs of work for a thread.
constexpr size_t read_per_chunk = 256;

// Reads patches, and places each body and box once.
class PatchReader {
 public:
  void make_room(size_t bodies, size_t boxes, size_t patches) {
    bodies_at_.make_room(bodies);
    boxes_at_.make_room(boxes);
    rows_.reserve(patches);
  }
  // Read the rows that are patches, `row(turn)` for each turn. `each_chunk(count, work)` shares chunks of
  // work among threads. The age of a stale patch is below zero, and it knows nothing but its pair.
  template <class Row, class EachChunk>
  void read(const Answered& all, size_t box_count, const Row& row, std::vector<Patch>& patches,
            const EachChunk& each_chunk) {
    bodies_at_.forget(all.bodies.size());
    boxes_at_.forget(box_count);
    rows_.clear();
    for (int64_t turn = 0; turn < all.answer.count; ++turn) {
      auto k = int64_t(row(size_t(turn)));
      if (!all.is_patch(k)) continue;
      rows_.push_back(k);
      if (all.is_stale(k)) continue;
      for (int end = 0; end < 2; ++end) {
        auto box = int32_t(all.answer.pairs[2 * k + end]);
        bodies_at_.ask(size_t(all.body_of(box)));
        boxes_at_.ask(size_t(box));
      }
    }
    in_chunks(std::max(bodies_at_.count(), boxes_at_.count()), each_chunk,
              [&](size_t first, size_t last) { place(all, first, last); });
    patches.resize(rows_.size());
    in_chunks(rows_.size(), each_chunk, [&](size_t first, size_t last) {
      for (size_t turn = first; turn < std::min(last, rows_.size()); ++turn)
        read(all, rows_[turn], patches[turn]);
    });
  }

 private:
  template <class EachChunk, class Work>
  static void in_chunks(size_t count, const EachChunk& each_chunk, const Work& work) {
    each_chunk(long((count + read_per_chunk - 1) / read_per_chunk), [&](long, long chunk) {
      size_t first = size_t(chunk) * read_per_chunk;
      work(first, first + read_per_chunk);
    });
  }
  void place(const Answered& all, size_t first, size_t last) {
    bodies_at_.find(first, last,
                    [&](size_t k) { return placed_at(all.poses[k], all.bodies[k].centre); });
    boxes_at_.find(first, last, [&](size_t k) {
      if (all.boxes.empty()) return box_at(all.poses[k]);
      const bc_body_box& box = all.boxes[k];
      return box_at(in_common_frame(all.poses[box.body], box.box.pose));
    });
  }
  void read(const Answered& all, int64_t k, Patch& patch) const {
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
    const Placed &box_at_a = boxes_at_[size_t(patch.box_a)],
                 &box_at_b = boxes_at_[size_t(patch.box_b)];
    patch.place(bodies_at_[size_t(patch.a)], bodies_at_[size_t(patch.b)],
                sign * vector_at(answer.normal + 3 * k), answer.point + 3 * k,
                answer.covariance + 9 * k, answer.volume[k], answer.separation[k],
                (is_lighter_b(all.bodies, patch) ? box_at_b : box_at_a).axes);
    if (!all.boxes.empty())
      patch.end_at_rim(box_at_a, all.boxes[size_t(patch.box_a)].box.size, box_at_b,
                       all.boxes[size_t(patch.box_b)].box.size);
    patch.friction = answer.friction ? answer.friction[k] : all.friction;
    patch.stiffness = answer.stiffness ? answer.stiffness[k] : 0.0;
    if (answer.surface) patch.surface = sign * vector_at(answer.surface + 3 * k);
    patch.late = answer.age;
  }

  PlacedOnce bodies_at_, boxes_at_;
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
