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
  // the first that is refused, or −1; so does this.
  template <class Solve>
  long solve(const bc_pose* poses, const Solve& solve) {
    for (size_t k = 0; k < boxes_.size(); ++k)
      poses_[k] = in_common_frame(poses[boxes_[k].body], boxes_[k].box.pose);
    auto* numbers = reinterpret_cast<const double*>(poses_.data());
    auto* sizes = reinterpret_cast<const double*>(sizes_.data());
    detail::Rows rows{numbers, numbers, sizes, sizes, 3, 3, pairs_.data(), long(boxes_.size())};
    detail::Results results{nullptr,        separation_.data(), normal_.data(), point_.data(),
                            volume_.data(), covariance_.data(), nullptr,        0.0};
    return solve(rows, long(count()), results);
  }
  // What was solved last.
  bc_patches answer() const {
    return {sizeof(bc_patches),
            int64_t(count()),
            pairs_.data(),
            separation_.data(),
            normal_.data(),
            point_.data(),
            volume_.data(),
            covariance_.data(),
            friction_.data(),
            surface_.data(),
            stiffness_.data(),
            0.0,
            0.0};
  }

 private:
  void resize(size_t n) {
    pairs_.resize(2 * n);
    for (auto* column : {&friction_, &stiffness_, &separation_, &volume_}) column->resize(n);
    for (auto* column : {&surface_, &normal_, &point_}) column->resize(3 * n);
    covariance_.resize(9 * n);
  }

  std::vector<bc_body_box> boxes_;
  std::vector<bc_size> sizes_;  // of the boxes
  std::vector<bc_pose> poses_;  // of the boxes, in the common frame
  std::vector<int64_t> pairs_;  // (n, 2)
  std::vector<double> friction_, surface_, stiffness_;
  std::vector<double> separation_, normal_, point_, volume_, covariance_;
  std::vector<BoxPair> keys_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
