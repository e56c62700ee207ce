// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What an advance changes before its end, as it was, for one that fails.
#pragma once

#include <utility>
#include <vector>

#include "clock.hpp"
#include "fineness.hpp"
#include "rest.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

class Rollback {
 public:
  void make_room(size_t bodies, size_t patches) {
    patches_.reserve(patches);
    fineness_.reserve(bodies);
    rest_.make_room(bodies, patches);
    loads_.reserve(patches);
  }
  // Keep what every advance changes.
  void keep(const Clock& clock, const std::vector<Fineness>& fineness) {
    clock_ = clock;
    fineness_ = fineness;
    are_patches_kept_ = is_rest_kept_ = false;
  }
  // Keep the patches, where an advance changes these.
  void keep_patches(const std::vector<Patch>& patches) {
    if (are_patches_kept_) return;
    patches_ = patches;
    are_patches_kept_ = true;
  }
  // Keep what rests, before any of it wakes, and patches and loads of what does not.
  void keep_rest(const Rest& rest, const std::vector<Patch>& patches,
                 const std::vector<Load>& loads) {
    keep_patches(patches);
    if (is_rest_kept_) return;
    rest_ = rest;
    loads_ = loads;
    is_rest_kept_ = true;
  }
  bool has_rest() const { return is_rest_kept_; }
  // Give back what was kept. Returns whether something had woken.
  bool restore(std::vector<Patch>& patches, Clock& clock, std::vector<Fineness>& fineness,
               Rest& rest, std::vector<Load>& loads) {
    if (are_patches_kept_) patches.swap(patches_);
    clock = clock_;
    fineness = fineness_;
    if (!is_rest_kept_) return false;
    std::swap(rest, rest_);
    rest.unmark();
    loads.swap(loads_);
    return true;
  }

 private:
  std::vector<Patch> patches_;
  Clock clock_;
  std::vector<Fineness> fineness_;
  Rest rest_;
  std::vector<Load> loads_;
  bool are_patches_kept_ = false, is_rest_kept_ = false;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
