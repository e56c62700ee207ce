// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of motion. It is compiled once, for any instruction set: distances alone have kernels.
#include "../motion/least_distance.hpp"
#include "pair_arguments.hpp"

namespace box_contact::detail {

namespace {

using motion::Follower;
using motion::LeastDistance;
using motion::Motion;
using motion::Near;
using motion::SweepNumbers;

// What is asked of two boxes.
struct Question {
  bool is_least;     // the least distance, or else the first time
  double clearance;  // [m]
  double tolerance;  // [m]
};

bool is_length(double x) { return std::fabs(x) <= length_max; }

bool is_clearance(double x) { return x >= 0.0 && is_length(x); }

bc_status check_question(const Question& asked) {
  if (!is_clearance(asked.clearance))
    return fail(BC_BAD_ARGUMENT, "clearance must be within 0 and 1e50 m, not %g", asked.clearance);
  if (!(asked.tolerance > 0.0 && is_length(asked.tolerance)))
    return fail(BC_BAD_ARGUMENT, "tolerance must be above 0, and at most 1e50 m, not %g",
                asked.tolerance);
  return BC_OK;
}

// Check one of both boxes; `of`: its letter.
bc_status check_sweep(const SweepNumbers& given, char of) {
  char field[8];
  auto named = [&](const char* name) {
    std::snprintf(field, sizeof field, "%s_%c", name, of);
    return field;
  };
  if (!pose_is_valid(given.start)) return refuse_pose(named("start"), given.start);
  if (!pose_is_valid(given.end)) return refuse_pose(named("end"), given.end);
  if (!size_is_valid(given.size)) return refuse_size(named("size"), given.size);
  for (int k = 0; given.centre && k < 3; ++k)
    if (!is_length(given.centre[k]))
      return fail(BC_BAD_POSE, "centre_%c (%g, %g, %g) is not finite, or exceeds 1e50 m", of,
                  given.centre[0], given.centre[1], given.centre[2]);
  return BC_OK;
}

bc_status read_motion(const SweepNumbers& a, const SweepNumbers& b, double tolerance,
                      Motion& motion) {
  bc_status status = check_sweep(a, 'a');
  if (!status) status = check_sweep(b, 'b');
  if (status) return status;
  if (int box = motion.set(a, b); box >= 0)
    return fail(BC_BAD_POSE,
                "the turn from start_%c to end_%c by 180 degrees has two ways: give a pose between",
                "ab"[box], "ab"[box]);
  if (tolerance >= motion.least_tolerance()) return BC_OK;
  // What is printed is accepted.
  return fail(BC_BAD_ARGUMENT,
              "tolerance %g is below %.3g m, the least that rounding allows at these coordinates",
              tolerance, 1.01 * motion.least_tolerance());
}

bc_approach answer(const Kernel& kernel, const Motion& motion, const Question& asked) {
  Follower follower(motion, kernel);
  Near found;
  bool is_found = true;
  if (asked.is_least)
    found = LeastDistance(follower, asked.tolerance).find();
  else
    is_found = find_time_of_impact(follower, asked.clearance, asked.tolerance, found);
  if (is_found) return {sizeof(bc_approach), found.s, -follower.rate(found), found.nearest};
  const double none = not_a_number;
  return {sizeof(bc_approach), none, none,
          {sizeof(bc_nearest), none, {none, none, none}, {none, none, none}, {none, none, none},
           false}};
}

SweepNumbers numbers_of(const bc_sweep& sweep) {
  return {numbers(&sweep.start), numbers(&sweep.end), numbers(&sweep.size), sweep.centre};
}

bc_status answer_pair(const bc_sweep* a, const bc_sweep* b, const Question& asked,
                      bc_approach* approach) {
  return guarded([&] {
    if (!a || !b || !approach) return refuse_null(!a ? "a" : !b ? "b" : "approach");
    if (approach->size != sizeof(bc_approach))
      return fail(BC_BAD_ABI, "approach.size is unknown");
    const Kernel* kernel = chosen_kernel();
    if (!kernel) return refuse_environment();
    Motion motion;
    bc_status status = check_question(asked);
    if (!status) status = read_motion(numbers_of(*a), numbers_of(*b), asked.tolerance, motion);
    if (!status) *approach = answer(*kernel, motion, asked);
    return status;
  });
}

// Rows of sweeps, as the program gives them.
class SweepRows {
 public:
  SweepRows(const bc_sweep_rows& given, const Rows& starts) : given_(given), starts_(starts) {}

  // Read the motion of a row whose boxes have such places.
  bc_status read(const int64_t* places, double tolerance, Motion& motion) const {
    return read_motion(box(places[0], starts_.poses_a, given_.ends_a, starts_.sizes_a,
                           starts_.size_step_a, given_.centres_a),
                       box(places[1], starts_.poses_b, given_.ends_b, starts_.sizes_b,
                           starts_.size_step_b, given_.centres_b),
                       tolerance, motion);
  }
  // The same of a row; each place is read once, as another thread may change pairs that were checked.
  bool read_row(long row, double tolerance, Motion& motion) const {
    int64_t places[2] = {row, row};
    for (int of = 0; of < 2 && starts_.pairs; ++of) {
      places[of] = *static_cast<const volatile int64_t*>(starts_.pairs + (2 * row + of));
      if (places[of] < 0 || places[of] >= starts_.pose_count) return false;
    }
    return read(places, tolerance, motion) == BC_OK;
  }

 private:
  static SweepNumbers box(int64_t place, const double* starts, const bc_pose* ends,
                          const double* sizes, long size_step, const double* centres) {
    return {starts + 7 * place, numbers(ends + place), sizes + size_step * place,
            centres ? centres + 3 * place : nullptr};
  }

  const bc_sweep_rows& given_;
  const Rows& starts_;
};

void write(const bc_approach& found, const bc_approach_results& results, long row) {
  const bc_nearest& nearest = found.nearest;
  const bc_nearest_results& to = results.nearest;
  auto put = [&](auto* array, auto value) {
    if (array) array[row] = value;
  };
  auto put_three = [&](double* array, const double* three) {
    for (int k = 0; array && k < 3; ++k) array[3 * row + k] = three[k];
  };
  put(results.time, found.time);
  put(results.closing_speed, found.closing_speed);
  put(to.colliding, nearest.colliding);
  put(to.distance, nearest.distance);
  put_three(to.normal, nearest.normal);
  put_three(to.point_a, nearest.point_a);
  put_three(to.point_b, nearest.point_b);
}

bc_status answer_rows_of(const bc_sweep_rows* given, const Question& asked,
                         const bc_approach_results* results, int threads, int64_t* refused) {
  int64_t first = -1;
  bc_status status = guarded([&] {
    if (!given || !results) return refuse_null(given ? "results" : "rows");
    bc_sweep_rows rows{};
    bc_approach_results wanted{};
    bc_rows starts{};
    if (!read(given, rows)) return fail(BC_BAD_ABI, "rows.size is unknown");
    if (!read(&rows.starts, starts)) return fail(BC_BAD_ABI, "rows.starts.size is unknown");
    if (!read(results, wanted)) return fail(BC_BAD_ABI, "results.size is unknown");
    if (wanted.nearest.size != sizeof(bc_nearest_results))
      return fail(BC_BAD_ABI, "results.nearest.size is unknown");
    if (starts.count && (!rows.ends_a || !rows.ends_b))
      return refuse_null(rows.ends_a ? "ends_b" : "ends_a");
    const Kernel* kernel = chosen_kernel();
    if (!kernel) return refuse_environment();
    if (bc_status bad = check_question(asked)) return bad;
    for (int64_t row = 0; rows.clearances && row < starts.count; ++row)
      if (!is_clearance(rows.clearances[row]))
        return fail(BC_BAD_ARGUMENT, "clearances[%lld] must be within 0 and 1e50 m, not %g",
                    (long long)row, rows.clearances[row]);
    auto solve = [&](const Rows& plain, long count) {
      SweepRows sweeps(rows, plain);
      return in_chunks(count, threads, [&](long begin, long end) {
        long bad = -1;
        for (long row = begin; row < end; ++row) {
          Motion motion;
          bool is_good = sweeps.read_row(row, asked.tolerance, motion);
          bc_approach found{};
          found.time = -1.0;
          Question each = asked;
          if (rows.clearances) each.clearance = rows.clearances[row];
          if (is_good) found = answer(*kernel, motion, each);
          else if (bad < 0) bad = row;
          write(found, wanted, row);
        }
        return bad;
      });
    };
    return answer_rows(starts, threads, first, solve, [&](const Rows& plain, const int64_t* places) {
      Motion motion;
      SweepRows(rows, plain).read(places, asked.tolerance, motion);
    });
  });
  if (refused) *refused = first;
  return status;
}

}  // namespace
}  // namespace box_contact::detail

using namespace box_contact::detail;

extern "C" {

bc_status bc_time_of_impact(const bc_sweep* a, const bc_sweep* b, double clearance,
                            double tolerance, bc_approach* approach) {
  return answer_pair(a, b, {false, clearance, tolerance}, approach);
}

bc_status bc_least_distance(const bc_sweep* a, const bc_sweep* b, double tolerance,
                            bc_approach* approach) {
  return answer_pair(a, b, {true, 0.0, tolerance}, approach);
}

bc_status bc_time_of_impact_rows(const bc_sweep_rows* rows, double clearance, double tolerance,
                                 const bc_approach_results* results, int threads,
                                 int64_t* refused) {
  return answer_rows_of(rows, {false, clearance, tolerance}, results, threads, refused);
}

bc_status bc_least_distance_rows(const bc_sweep_rows* rows, double tolerance,
                                 const bc_approach_results* results, int threads,
                                 int64_t* refused) {
  return answer_rows_of(rows, {true, 0.0, tolerance}, results, threads, refused);
}

}  // extern "C"
