// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What is wrong with a pose, in words: the library and the header-only solver refuse alike.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>

#include "poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Writes field and value of a pose x y z qx qy qz qw that `pose_valid` refuses.
inline void explain_refusal(const char* field, const double* p, char* words, std::size_t room) {
  bool is_far = false, is_finite = true;
  for (int k = 0; k < 3; ++k) is_far |= !(std::fabs(p[k]) <= length_max);
  for (int k = 3; k < 7; ++k) is_finite &= __builtin_isfinite(p[k]);
  if (is_far)
    std::snprintf(words, room, "%s position (%g, %g, %g) is not finite, or exceeds 1e50 m", field,
                  p[0], p[1], p[2]);
  else
    std::snprintf(words, room, "%s quaternion (%g, %g, %g, %g) %s", field, p[3], p[4], p[5], p[6],
                  is_finite ? "has no length within 1e-100 to 1e100" : "is not finite");
}

}  // namespace box_contact::BOX_CONTACT_SET
