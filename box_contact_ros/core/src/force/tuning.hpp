// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The numbers of the forces that trials chose, and not theory or rounding. What was tried has its figures in
// docs/contributing/decisions/patch-law.md.
#pragma once

#include <cstddef>

#include "../lanes/target.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// --- steps ---
// Longest sub-step, unless answers are late [s]: in four of 0.1 s a stack of eight would sink by 42 mm.
constexpr double sub_step_limit = 0.005;
// Steps are remembered for this time [s], and so many of them, as frames of several steps repeat.
constexpr double steps_time = 0.5;
constexpr int steps_count = 32;
// The longest step shrinks by this factor a step, once those since are shorter by more [1]: no jump.
constexpr double step_shrinkage = 1.25;
// Of the impulses of a window, the most that a step begins with [1]: in 1 ns, what iterations leave is any force.
constexpr double most_again = 2.0;

// --- pushing out ---
// Angular frequency of a soft constraint times the window [1]: a box rests 0.4·g·window² deep.
constexpr double soft_frequency = 1.57;
// Its damping ratio [1]: an overlap shrinks by an eighth a sub-step.
constexpr double soft_damping_ratio = 5.0;
// The same where answers are late.
constexpr double slow_damping_ratio = 2.0;
// Fastest pushing out [m/s]: speeds add up in a stack, and relaxation leaves some.
constexpr double push_out_limit = 0.1;

// --- late answers ---
// Angular frequency times half a period and the latency [1]: stiffer patches vibrate.
constexpr double late_frequency = 2.5;
// Fastest pushing out [m/s]: late patches bear nothing that is as hard.
constexpr double late_push_out_limit = 1.0;
// An answer that is older than so many periods [1] pushes nothing out.
constexpr double overdue_periods = 3.0;
// A period that is not told is the least of so many intervals: some answers get lost.
constexpr int intervals_kept = 8;

// --- iterations of a sub-step ---
// That push overlaps out, and that remove this speed again, at most.
constexpr int iterations = 4, relaxations = 2;
// A smaller change of a patch's speeds does not make its neighbours be solved again [m/s].
constexpr double least_change = 1e-8;
// Pressing and rocking change by more than what solves a block, by up to this factor (Young, 1954) [1].
constexpr double most_over_relaxation = 1.3;
// But not where no rim is faster than this [m/s]: what rests stays solved.
constexpr double least_over_relaxed = 1e-6;

// Friction acts at the mean centre of what pressed in this time [s]: in piles that of one sub-step shakes.
constexpr double pressure_time = 0.05;
// With late answers it is so many periods [1], as what one answer finds pressed shakes rubble.
constexpr double pressure_periods = 30.0;

// --- impacts ---
// An impact goes on while an iteration changes a closing speed by more than this [m/s], and at most so often.
constexpr double impact_change = 0.01;
constexpr int impact_iterations = 40;
// In an island that had patches, also by more than this acceleration times the sub-step [m/s²]: what rolls in a
// pile is no impact.
constexpr double impact_acceleration = 40.0;
// After so many iterations all that presses in the island is scaled, by a factor or an inverse beyond this [1].
constexpr int scaled_every = 8;
constexpr double least_factor = 2.0;

// --- sway ---
// A stack sways while its bodies pass each other at a speed in this range; it begins at the middle one [m/s].
constexpr double least_sway = 1e-7, begun_sway = 1e-4, most_sway = 0.1;
// It then takes so many times the iterations, and as many more after each such time [s], up to so many.
constexpr int more_rounds = 3, most_rounds = 12;
constexpr double sway_time = 0.5;

// --- heavy on light ---
// A load is heavy if it would move its bodies apart by more than this [m/s²]: towers of 30 alike are not.
constexpr double least_push = 600.0;
// From this ratio of masses on, sub-steps are at once as fine as needed [1]; of bodies alike, in proportion.
constexpr double uneven_masses = 10.0;
// The part of the depth that is wanted which is aimed at [1]: depths of a stack add up.
constexpr double aimed_depth = 0.36;
// The part of the thinner box, along the normal, that a patch may be deep [1].
constexpr double deepest_part = 0.1;
// A factor grows where this share more is needed [1], as each change moves what rests, and by as much more.
constexpr double growth = 1.25;
// Sub-steps are shorter by this factor at most.
constexpr int finest = 64;
// A factor so many times too large for this time [s] shrinks, by e in the same time: patches sink softly.
constexpr int spare_factor = 4;
constexpr double calm_time = 1.0;
// What lasts of a force grows by e in this time [s]: an impact is over before.
constexpr double lasting_time = 0.5;
// Own contacts are solved anew after so many finer sub-steps.
constexpr int sub_steps_per_contact = 4;

// --- gaps ---
// A pair apart is a constraint within so many times g·dt² [1]: what it falls in this step and the next.
constexpr double gap_share = 2.0;
// A patch at least so wide as a part of its faces stops a turn by itself [1].
constexpr double wide = 0.5;

// --- sleep ---
// An island sleeps once all its bodies were slower than this, by their energies [m/s], for this time [s].
constexpr double sleep_speed = 1e-4, sleep_time = 0.5;
// It must be no faster than before, or than this share of that speed [1]: what begins to tip gains speed.
constexpr double calm_share = 0.1;
// By how much the first answer to a patch asleep may differ from the one that it has [m].
constexpr double settled_gap = 1e-5;

// --- work for a thread ---
// Blocks at a time: some 100 µs, which a core's second cache holds.
constexpr size_t blocks_per_chunk = 128;
// Ends of bodies and blocks, and patches that are read: some 20 µs.
constexpr size_t rows_per_chunk = 256;

}  // namespace box_contact::BOX_CONTACT_SET::force
