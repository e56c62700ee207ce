// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The force law's constants, and what a loop's rate and latency make of them.
//
// docs/explanation/force.md derives them. docs/contributing/decisions/patch-law.md describes the
// experiment of each.
#pragma once

#include <algorithm>
#include <cmath>

#include "../../include/box_contact/force.h"

namespace box_contact::detail {

// Ω·T of a held patch [1], T the latency and half a period. It is stable up to 3 to 4.
constexpr double patch_delay_limit = 2.0;
// Ω·step of a held patch [1], step the time between two evaluations.
constexpr double step_limit = 0.45;
constexpr double damping_ratio = 1.2;
// How many times as large as for Ω the dampers may be [1]. With 4, a load that is
// pressed in at 50 Hz and 5 ms comes up with a time constant of 70 ms.
constexpr double damping_growth_limit = 4.0;
// Rocking is resisted by all of the turn, and so many times [1] more stiffly by the turn of the
// last `lean_time` [s]. Ω·step limits both together. The second gives way at this share of the
// pressure [1], or a body that falls onto its face would be thrown back.
constexpr double lean_time = 0.05, lean_limit = 10.0, lean_step_limit = 0.8, lean_yield = 0.15;
// Share of the depth at rest from which on the damper is whole [1].
constexpr double whole_damper_depth = 0.02;
// Share of the speed √(2·g·depth), which gravity would stop at the surface, at which a load may be
// pushed back [1].
constexpr double recoil = 0.7;
// Time [s] over which the force that a contact has carried is averaged.
constexpr double carried_time = 0.1;
// Share of Ω² that the tangential springs take [1].
constexpr double tangential_share = 0.1;
constexpr double tangential_damping_ratio = 1.0;
// The modulus falls at once to what the loop bears, and rises with this time constant [s] ...
constexpr double rise_time = 0.5;
// ... up to this share of it [1], so that at rest it is constant.
constexpr double steady_share = 0.98;

struct LawConstants {
  double frequency;  // Ω [1/s]: no oscillation on a patch is faster
  double damping_ratio, tangential_damping_ratio;
  double step;  // h [s]: from one evaluation to the next
  double rise;  // share of what a modulus lacks that it gains per answer [1]
  double friction, gravity;
  double lean;    // stiffness against the turn of late, by that against all of it [1]
  double forget;  // share of the turn of late that is forgotten per evaluation [1]
};

inline LawConstants constants_for(const bc_loop& loop) {
  double period = 1.0 / loop.rate, late = 0.5 * period + loop.latency;
  double frequency = std::min(patch_delay_limit / late, step_limit / loop.step);
  double unit = frequency * loop.step, leaning = lean_step_limit / unit;
  // Slow modes of a stack decay by ζ·ω²/Ω: dampers are as large as the step allows.
  double larger = std::min(damping_growth_limit, step_limit / unit);
  return {frequency,
          larger * damping_ratio,
          larger * tangential_damping_ratio,
          loop.step,
          std::min(1.0, period / rise_time),
          loop.friction,
          loop.gravity,
          std::min(lean_limit, leaning * leaning - 1.0),
          std::min(1.0, loop.step / lean_time)};
}

}  // namespace box_contact::detail
