// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Contacts of one's own: pairs of boxes that are solved anew where an advance needs them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "asked_pairs.hpp"
#include "gaps.hpp"
#include "near_pairs.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Solves a pair alone; false: it is refused.
using SolvePair = bool (*)(const detail::PairNumbers&, bc_contact&);

class OwnContacts {
 public:
  // The boxes of the bodies; none: box k is body k, and nobody knows its size.
  const std::vector<bc_body_box>& boxes() const { return boxes_; }
  size_t count() const { return asked_.count(); }
  // Whether pairs are found anew at each advance, instead of asked for.
  bool finds_pairs() const { return finds_pairs_; }
  bool is_used() const { return finds_pairs_ || count() > 0; }

  // Where memory ends, all is as it was.
  void set_boxes(std::vector<bc_body_box> boxes, bool finds_pairs) {
    NearPairs near;
    if (finds_pairs) near.set_boxes(boxes);
    sizes_.reserve(boxes.size());
    poses_.reserve(boxes.size());
    is_placed_.reserve(boxes.size());
    near_ = std::move(near);
    boxes_ = std::move(boxes);
    finds_pairs_ = finds_pairs;
    sizes_.clear();
    for (const bc_body_box& box : boxes_) sizes_.push_back(box.box.size);
    poses_.resize(boxes_.size());
    is_placed_.resize(boxes_.size());
    forget();
  }
  void forget() {
    keys_.clear();
    is_any_new_ = false;
    resize(0);
  }

  // What a copy has no room for, so that an advance takes no memory.
  void make_room() {
    live_.reserve(count());
    placed_.reserve(2 * count());
  }

  // Whether these pairs are those of the last question, with the same columns.
  bool is_asked(const bc_patches& pairs) const {
    auto is_same = [](const double* column, const std::vector<double>& last, double otherwise) {
      return column ? std::equal(last.begin(), last.end(), column)
                    : std::count(last.begin(), last.end(), otherwise) == long(last.size());
    };
    return pairs.count > 0 && size_t(pairs.count) == count() && pairs.pairs &&
           std::equal(asked_.pairs.begin(), asked_.pairs.end(), pairs.pairs) &&
           is_same(pairs.friction, asked_.friction, no_friction) &&
           is_same(pairs.surface, asked_.surface, 0.0);
  }
  // Take the pairs of a question. Where bodies sleep, a pair is new until it was solved once, unless
  // `is_known(pair)` says that its patch sleeps. Returns false, and takes none, if a pair comes twice.
  template <class IsKnown>
  bool ask(const bc_patches& asked, bool is_any_asleep, const IsKnown& is_known) {
    auto n = size_t(asked.count);
    next_keys_.clear();
    for (size_t k = 0; k < n; ++k) {
      auto a = int32_t(asked.pairs[2 * k]), b = int32_t(asked.pairs[2 * k + 1]);
      next_keys_.push_back({std::minmax(a, b), k, false});
    }
    if (!std::is_sorted(next_keys_.begin(), next_keys_.end()))
      std::sort(next_keys_.begin(), next_keys_.end());
    auto same = [](const Key& p, const Key& q) { return p.pair == q.pair; };
    if (std::adjacent_find(next_keys_.begin(), next_keys_.end(), same) != next_keys_.end())
      return false;
    note_new(is_any_asleep, is_known);
    resize(n);
    keys_.swap(next_keys_);
    std::copy_n(asked.pairs, 2 * n, asked_.pairs.begin());
    auto copy = [](const double* from, std::vector<double>& to, double otherwise) {
      if (from)
        std::copy_n(from, to.size(), to.begin());
      else
        std::fill(to.begin(), to.end(), otherwise);
    };
    copy(asked.friction, asked_.friction, no_friction);
    copy(asked.surface, asked_.surface, 0.0);
    return true;
  }
  // Whether the pair of a patch is asked for, with the numbers of the patch. friction: where none is told.
  bool is_asked(const Patch& patch, const Surfaces& surfaces, double friction) const {
    auto key = std::lower_bound(keys_.begin(), keys_.end(), Key{patch.pair(), 0, false});
    if (key == keys_.end() || key->pair != patch.pair()) return false;
    size_t k = key->row;
    double sign = asked_.pairs[2 * k] < asked_.pairs[2 * k + 1] ? 1.0 : -1.0;
    Vec<double> other = patch.surface - sign * vector_at(&asked_.surface[3 * k]);
    return patch.friction == friction_of(surfaces, patch.pair(), asked_.friction[k], friction) &&
           dot(other, other) == 0.0;
  }

  // Choose which pairs are solved: all but those of which `is_quiet(box)` says that both boxes stay. The
  // revision of what sleeps tells whether they are chosen already.
  template <class IsQuiet>
  void choose(int64_t revision, bool is_any_asleep, const IsQuiet& is_quiet) {
    if (chosen_for_ == revision) return;
    chosen_for_ = revision;
    is_all_ = !is_any_asleep;
    if (is_all_) return;
    choose_none();
    for (const Key& key : keys_) {
      size_t k = key.row;
      auto a = size_t(asked_.pairs[2 * k]), b = size_t(asked_.pairs[2 * k + 1]);
      if (!key.is_new && is_quiet(a) && is_quiet(b)) continue;
      live_.add(asked_, k);
      note_placed(a, b);
    }
  }
  // Find the pairs that are solved: see NearPairs. `pose_of(body)` also knows where the others are.
  // Returns how many there are.
  template <class EachActive, class PoseOf>
  size_t find(double dt, int64_t revision, const Gaps& gaps, const std::vector<Body>& bodies,
              const EachActive& each_active, const PoseOf& pose_of) {
    auto place = [&](int32_t box, double longest) {
      const auto& [body, own] = boxes_[size_t(box)];
      const bc_pose& pose = poses_[size_t(box)] = in_common_frame(pose_of(size_t(body)), own.pose);
      double goes = gaps.within(longest).around(box);
      const double(&q)[4] = pose.quaternion;
      return detail::bounds_of({vector(pose.position), {q[0], q[1], q[2], q[3]}},
                               0.5 * vector(own.size.extent) + Vec<double>{goes, goes, goes});
    };
    is_all_ = false;
    if (near_.find(dt, revision, boxes_, bodies, each_active, place)) {
      choose_none();
      for (auto [a, b] : near_.pairs()) {
        live_.pairs.insert(live_.pairs.end(), {a, b});
        note_placed(size_t(a), size_t(b));
      }
      found_.resize(live_.count());
    }
    return live_.count();
  }
  // An advance was refused, so bodies are not where they were looked at.
  void cancel() { near_.forget(); }
  // All pairs were solved once.
  void settle() {
    if (!is_any_new_) return;
    for (Key& key : keys_) key.is_new = false;
    is_any_new_ = false;
    chosen_for_ = none_chosen;
  }

  // Solve the chosen pairs with the bodies at `poses`. `solve(rows, count, results)` answers rows, and returns
  // the first that is refused, or −1; so does this, of the rows of `answer()`.
  // A pair that is apart, but near by `gaps`, gets the patch that it has once it touches, and keeps its separation above zero.
  template <class Solve>
  long solve(const bc_pose* poses, const Gaps& gaps, const Solve& solve, SolvePair solve_pair) {
    auto place = [&](size_t box) {
      poses_[box] = in_common_frame(poses[boxes_[box].body], boxes_[box].box.pose);
    };
    if (is_all_)
      for (size_t k = 0; k < boxes_.size(); ++k) place(k);
    else if (!finds_pairs_)
      std::for_each(placed_.begin(), placed_.end(), place);
    const AskedPairs& live = chosen();
    if (live.count() == 0) return -1;
    auto* numbers = reinterpret_cast<const double*>(poses_.data());
    auto* sizes = reinterpret_cast<const double*>(sizes_.data());
    detail::Rows rows{numbers, numbers, sizes, sizes, 3, 3, live.pairs.data(), long(boxes_.size())};
    long refused = solve(rows, long(live.count()), found_.results(farthest(gaps)));
    if (refused < 0) refused = solve_near(gaps, solve_pair);
    return refused;
  }
  // Solve the pair of a patch anew, with its bodies at other places. A pair that is apart now keeps its
  // patch, which goes with the bodies.
  void solve_again(SolvePair solve, const bc_pose& body_a, const bc_pose& body_b,
                   const Placed& at_a, const Placed& at_b, bool is_lighter_b, Patch& patch) const {
    const bc_body_box &a = boxes_[size_t(patch.box_a)], &b = boxes_[size_t(patch.box_b)];
    bc_pose pose_a = in_common_frame(body_a, a.box.pose),
            pose_b = in_common_frame(body_b, b.box.pose);
    bc_contact found;
    detail::PairNumbers pair{pose_a.position, pose_b.position, a.box.size.extent,
                             b.box.size.extent};
    if (!solve(pair, found) || !found.colliding) return;
    Placed box_at_a = box_at(pose_a), box_at_b = box_at(pose_b);
    Patch placed = patch;
    placed.place(at_a, at_b, vector(found.normal), found.point, found.covariance[0], found.volume,
                 found.separation, (is_lighter_b ? box_at_b : box_at_a).axes);
    placed.end_at_rim(box_at_a, a.box.size, box_at_b, b.box.size);
    if (placed.has_area()) patch = placed;
  }

  // The row of an answer at a place by pair.
  size_t row(size_t place) const { return is_all_ ? keys_[place].row : place; }
  // What was solved last.
  bc_patches answer() const {
    const AskedPairs& live = chosen();
    return {sizeof(bc_patches),
            int64_t(live.count()),
            live.pairs.data(),
            found_.separation.data(),
            found_.normal.data(),
            found_.point.data(),
            found_.volume.data(),
            found_.covariance.data(),
            finds_pairs_ ? nullptr : live.friction.data(),
            finds_pairs_ ? nullptr : live.surface.data(),
            0.0,
            0.0};
  }

 private:
  // A pair, and where it is asked for.
  struct Key {
    BoxPair pair;
    size_t row;
    bool is_new;  // not solved yet, where something slept when it was asked for
    bool operator<(const Key& other) const { return pair < other.pair; }
  };
  void resize(size_t n) {
    asked_.resize(n);
    is_all_ = true;
    chosen_for_ = none_chosen;
    found_.resize(n);
    make_room();
  }
  const AskedPairs& chosen() const { return is_all_ ? asked_ : live_; }
  void choose_none() {
    placed_.clear();
    std::fill(is_placed_.begin(), is_placed_.end(), uint8_t(0));
    live_.resize(0);
  }
  void note_placed(size_t a, size_t b) {
    for (size_t box : {a, b}) {
      if (!is_placed_[box]) placed_.push_back(box);
      is_placed_[box] = 1;
    }
  }
  // No pair that is solved, and farther apart, is a constraint [m]: both boxes may go toward each other.
  double farthest(const Gaps& gaps) const {
    double most = 0.0;
    for (size_t k = 0, n = is_all_ ? boxes_.size() : placed_.size(); k < n; ++k)
      most = std::max(most, gaps.around(int32_t(is_all_ ? k : placed_[k])));
    return std::min(2.0 * most, length_max);
  }
  // Note which of the next keys are not among the last ones, or are new there.
  template <class IsKnown>
  void note_new(bool is_any_asleep, const IsKnown& is_known) {
    is_any_new_ = false;
    auto last = keys_.begin();
    for (Key& key : next_keys_) {
      if (!is_any_asleep) break;
      while (last != keys_.end() && last->pair < key.pair) ++last;
      bool was_asked = last != keys_.end() && last->pair == key.pair && !last->is_new;
      key.is_new = !was_asked && !is_known(key.pair);
      is_any_new_ = is_any_new_ || key.is_new;
    }
  }
  // Give pairs that are apart, but near, the patches that they have once they touch.
  long solve_near(const Gaps& gaps, SolvePair solve) {
    const AskedPairs& live = chosen();
    for (size_t k = 0; k < live.count(); ++k) {
      double apart = found_.separation[k];
      Vec<double> normal = vector_at(&found_.normal[3 * k]);
      if (!(apart > 0.0) || normal[0] != normal[0]) continue;  // in contact, or beyond the farthest
      auto a = size_t(live.pairs[2 * k]), b = size_t(live.pairs[2 * k + 1]);
      Vec<double> way;
      if (!gaps.is_near(int32_t(a), int32_t(b), normal, apart, way)) continue;
      bc_pose moved = poses_[b];
      for (int i = 0; i < 3; ++i) moved.position[i] += way[i];
      bc_contact found;
      detail::PairNumbers pair{poses_[a].position, moved.position, sizes_[a].extent,
                               sizes_[b].extent};
      if (!solve(pair, found)) return long(k);
      if (found.volume > 0.0) found_.set_patch(k, found);
    }
    return -1;
  }

  std::vector<bc_body_box> boxes_;
  std::vector<bc_size> sizes_;  // of the boxes
  std::vector<bc_pose> poses_;  // of the boxes, in the common frame
  AskedPairs asked_;
  bool is_any_new_ = false, finds_pairs_ = false;
  NearPairs near_;
  // Those that are solved, by pair, unless all are.
  static constexpr int64_t none_chosen = -1;
  int64_t chosen_for_ = none_chosen;
  bool is_all_ = true;
  AskedPairs live_;
  std::vector<size_t> placed_;  // their boxes
  std::vector<uint8_t> is_placed_;
  Columns found_;
  std::vector<Key> keys_, next_keys_;  // by pair
};

}  // namespace box_contact::BOX_CONTACT_SET::force
