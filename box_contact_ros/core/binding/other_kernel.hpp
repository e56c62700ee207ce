// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The kernel of another extension, which `PairSolver` takes in the place of a model's name.
#pragma once

#include "../src/library/kernel.hpp"

namespace box_contact::binding {

// Name of the capsules that hold one.
constexpr const char* kernel_capsule = "box_contact.kernel";

struct OtherKernel {
  detail::Kernel kernel;  // all its models and moments are one
  // Whether the kernel can read a network. Only such networks reach it.
  bool (*reads)(const detail::NetworkNumbers&);
};

}  // namespace box_contact::binding
