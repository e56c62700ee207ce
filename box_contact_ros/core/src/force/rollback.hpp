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
  void keep(const std::vector<Patch>& patches, const Clock& clock,
            const std::vector<Fineness>& fineness) {
    patches_ = patches;
    clock_ = clock;
    fineness_ = fineness;
    is_rest_kept_ = false;
  }
  // Keep what rests, before any of it wakes, and the loads of what does not.
  void keep_rest(const Rest& rest, const std::vector<Load>& loads) {
    if (is_rest_kept_) return;
    rest_ = rest;
    loads_ = loads;
    is_rest_kept_ = true;
  }
  // Give all back. Returns whether something had woken.
  bool restore(std::vector<Patch>& patches, Clock& clock, std::vector<Fineness>& fineness,
               Rest& rest, std::vector<Load>& loads) {
    patches.swap(patches_);
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
  bool is_rest_kept_ = false;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
