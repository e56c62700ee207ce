// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Contacts of one's own: pairs of boxes that are solved anew where an advance needs them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../kernel.hpp"
#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Solves a pair alone; false: it is refused.
using SolvePair = bool (*)(const detail::PairNumbers&, bc_contact&);

class OwnContacts {
 public:
  // The boxes of the bodies; none: box k is body k, and nobody knows its size.
  const std::vector<bc_body_box>& boxes() const { return boxes_; }
  size_t count() const { return friction_.size(); }

  void set_boxes(std::vector<bc_body_box> boxes) {
    boxes_ = std::move(boxes);
    sizes_.clear();
    for (const bc_body_box& box : boxes_) sizes_.push_back(box.box.size);
    poses_.resize(boxes_.size());
    forget();
  }
  void forget() { resize(0); }

  // Take the pairs of a question. Returns false, and changes nothing, if a pair comes twice.
  bool ask(const bc_patches& asked, double friction) {
    keys_.clear();
    for (int64_t k = 0; k < asked.count; ++k) {
      auto a = int32_t(asked.pairs[2 * k]), b = int32_t(asked.pairs[2 * k + 1]);
      keys_.push_back(std::minmax(a, b));
    }
    std::sort(keys_.begin(), keys_.end());
    if (std::adjacent_find(keys_.begin(), keys_.end()) != keys_.end()) return false;
    auto n = size_t(asked.count);
    resize(n);
    std::copy_n(asked.pairs, 2 * n, pairs_.begin());
    auto copy = [](const double* from, std::vector<double>& to, double otherwise) {
      if (from)
        std::copy_n(from, to.size(), to.begin());
      else
        std::fill(to.begin(), to.end(), otherwise);
    };
    copy(asked.friction, friction_, friction);
    copy(asked.surface, surface_, 0.0);
    copy(asked.stiffness, stiffness_, 0.0);
    return true;
  }

  // Solve all pairs with the bodies at `poses`. `solve(rows, count, results)` answers rows, and returns
  // the first that is refused, or −1; so does this. A pair apart by no more than `farthest` [m] for which
  // `is_near(a, b, normal, apart)` gets the patch that it has once it touches, and keeps its separation
  // above zero.
  template <class Solve, class IsNear>
  long solve(const bc_pose* poses, double farthest, const Solve& solve, const IsNear& is_near) {
    for (size_t k = 0; k < boxes_.size(); ++k)
      poses_[k] = in_common_frame(poses[boxes_[k].body], boxes_[k].box.pose);
    auto* numbers = reinterpret_cast<const double*>(poses_.data());
    auto* sizes = reinterpret_cast<const double*>(sizes_.data());
    detail::Rows rows{numbers, numbers, sizes, sizes, 3, 3, pairs_.data(), long(boxes_.size())};
    long refused = solve(rows, long(count()), found_.results(farthest));
    return refused >= 0 ? refused : solve_near(solve, is_near);
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
    Patch placed = patch;
    placed.place(at_a, at_b, vector(found.normal), found.point, found.covariance[0], found.volume,
                 found.separation,
                 [&] { return rotation_matrix((is_lighter_b ? pose_b : pose_a).quaternion); });
    placed.end_at_rim(pose_a, a.box.size, pose_b, b.box.size);
    if (placed.has_area()) patch = placed;
  }

  // What was solved last.
  bc_patches answer() const {
    return {sizeof(bc_patches),
            int64_t(count()),
            pairs_.data(),
            found_.separation.data(),
            found_.normal.data(),
            found_.point.data(),
            found_.volume.data(),
            found_.covariance.data(),
            friction_.data(),
            surface_.data(),
            stiffness_.data(),
            0.0,
            0.0};
  }

 private:
  // Answers to rows.
  struct Columns {
    std::vector<double> separation, normal, point, volume, covariance;

    void resize(size_t n) {
      separation.resize(n);
      volume.resize(n);
      for (auto* column : {&normal, &point}) column->resize(3 * n);
      covariance.resize(9 * n);
    }
    detail::Results results(double margin) {
      return {nullptr,       separation.data(), normal.data(), point.data(),
              volume.data(), covariance.data(), nullptr,       margin};
    }
    // Take the patch of another row; the separation stays.
    void take_patch(size_t row, const Columns& other, size_t from) {
      volume[row] = other.volume[from];
      std::copy_n(&other.normal[3 * from], 3, &normal[3 * row]);
      std::copy_n(&other.point[3 * from], 3, &point[3 * row]);
      std::copy_n(&other.covariance[9 * from], 9, &covariance[9 * row]);
    }
  };
  // Pairs that are a little apart, moved together along the normal.
  struct Near {
    std::vector<size_t> row;
    std::vector<bc_pose> pose_a, pose_b;
    std::vector<bc_size> size_a, size_b;
    Columns found;

    void reserve(size_t n) {
      row.reserve(n);
      for (auto* poses : {&pose_a, &pose_b}) poses->reserve(n);
      for (auto* sizes : {&size_a, &size_b}) sizes->reserve(n);
      found.resize(n);
    }
    void clear() {
      row.clear();
      for (auto* poses : {&pose_a, &pose_b}) poses->clear();
      for (auto* sizes : {&size_a, &size_b}) sizes->clear();
    }
    void add(size_t k, const bc_pose& a, bc_pose b, const bc_size& of_a, const bc_size& of_b,
             const Vec<double>& way) {
      for (int i = 0; i < 3; ++i) b.position[i] += way[i];
      row.push_back(k);
      pose_a.push_back(a);
      pose_b.push_back(b);
      size_a.push_back(of_a);
      size_b.push_back(of_b);
    }
  };

  void resize(size_t n) {
    pairs_.resize(2 * n);
    for (auto* column : {&friction_, &stiffness_}) column->resize(n);
    surface_.resize(3 * n);
    found_.resize(n);
    near_.reserve(n);
  }
  template <class Solve, class IsNear>
  long solve_near(const Solve& solve, const IsNear& is_near) {
    near_.clear();
    for (size_t k = 0; k < count(); ++k) {
      double apart = found_.separation[k];
      Vec<double> normal = vector_at(&found_.normal[3 * k]);
      if (!(apart > 0.0) || normal[0] != normal[0]) continue;  // in contact, or beyond the farthest
      auto a = size_t(pairs_[2 * k]), b = size_t(pairs_[2 * k + 1]);
      if (is_near(int32_t(a), int32_t(b), normal, apart))
        near_.add(k, poses_[a], poses_[b], sizes_[a], sizes_[b], -apart * normal);
    }
    if (near_.row.empty()) return -1;
    auto numbers = [](const auto& rows) { return reinterpret_cast<const double*>(rows.data()); };
    auto n = long(near_.row.size());
    detail::Rows rows{numbers(near_.pose_a),
                      numbers(near_.pose_b),
                      numbers(near_.size_a),
                      numbers(near_.size_b),
                      3,
                      3,
                      nullptr,
                      n};
    long refused = solve(rows, n, near_.found.results(0.0));
    if (refused >= 0) return long(near_.row[size_t(refused)]);
    for (size_t i = 0; i < near_.row.size(); ++i)
      if (near_.found.volume[i] > 0.0) found_.take_patch(near_.row[i], near_.found, i);
    return -1;
  }

  std::vector<bc_body_box> boxes_;
  std::vector<bc_size> sizes_;  // of the boxes
  std::vector<bc_pose> poses_;  // of the boxes, in the common frame
  std::vector<int64_t> pairs_;  // (n, 2)
  std::vector<double> friction_, surface_, stiffness_;
  Columns found_;
  Near near_;
  std::vector<BoxPair> keys_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
