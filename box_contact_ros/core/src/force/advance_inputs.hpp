// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What the caller says of the bodies at the start of an advance.
#pragma once

#include <cstdint>

#include "../../include/box_contact/force.h"
#include "../lanes/target.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// What an advance is given of each body.
struct Given {
  const bc_pose* poses;
  const bc_velocity* velocities;
  const bc_wrench* outside;  // none: no wrenches
};

// The bodies of which something may be given otherwise than in the last advance.
struct Changed {
  bool is_known;  // false: all
  const int64_t* bodies;
  int64_t count;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
