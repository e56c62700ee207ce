// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pairs and rows of them as a program gives them: what is checked before they are answered, and why
// one is refused.
#pragma once

#include <cstring>
#include <string>

#include "batch.hpp"
#include "refusals.hpp"

namespace box_contact::detail {

// Why nobody answers.
inline bc_status refuse_environment() {
  std::string names;
  for (const Kernel* kernel : kernels())
    names += (names.empty() ? "" : ", ") + std::string(kernel->name);
  return fail(BC_BAD_ENVIRONMENT, "BOX_CONTACT_INSTRUCTION_SET is none of: %s", names.c_str());
}

inline bc_status refuse_size(const char* field, const double* size) {
  return fail(BC_BAD_SIZE, "%s (%g, %g, %g) is not within 1e-50 to 1e50 m", field, size[0], size[1],
              size[2]);
}

inline bool size_is_valid(const double* size) {
  return size_valid<double>(triple(Vec<double>{size[0], size[1], size[2]}));
}

// Why a pair is refused.
inline bc_status refuse_pair(const double* pose_a, const double* pose_b, const double* size_a,
                             const double* size_b) {
  if (!pose_is_valid(pose_a)) return refuse_pose("pose_a", pose_a);
  if (!pose_is_valid(pose_b)) return refuse_pose("pose_b", pose_b);
  return size_is_valid(size_a) ? refuse_size("size_b", size_b) : refuse_size("size_a", size_a);
}

// Whether all places of boxes are within the poses. `first`: the first row where they are not.
inline bool places_are_valid(const bc_rows& rows, int64_t& first) {
  for (int64_t place = 0; rows.pairs && place < 2 * rows.count; ++place)
    if (rows.pairs[place] < 0 || rows.pairs[place] >= rows.pose_count) {
      first = place / 2;
      return false;
    }
  return true;
}

// No memory holds more rows.
constexpr int64_t largest_count = PTRDIFF_MAX / int64_t(sizeof(bc_contact));

inline const double* numbers(const bc_pose* poses) {
  return reinterpret_cast<const double*>(poses);
}
inline const double* numbers(const bc_size* sizes) {
  return reinterpret_cast<const double*>(sizes);
}

inline bc_status check_rows(const bc_rows& rows, int threads, int64_t& refused) {
  if (rows.count < 0 || rows.count > largest_count)
    return fail(BC_BAD_ARGUMENT, "count %lld is that of no array", (long long)rows.count);
  if (threads < 1 || threads > threads_max)
    return fail(BC_BAD_ARGUMENT, "threads must be within 1 and %d, not %d", threads_max, threads);
  if (rows.count == 0) return BC_OK;
  if (!rows.poses_a || !rows.poses_b) return refuse_null(rows.poses_a ? "poses_b" : "poses_a");
  if (!rows.pairs && rows.pose_count != rows.count)
    return fail(BC_BAD_ARGUMENT, "pose_count must be count without pairs");
  for (int64_t sizes : {rows.size_count_a, rows.size_count_b})
    if (sizes != 1 && sizes != rows.pose_count)
      return fail(BC_BAD_ARGUMENT, "sizes must be one, or one for each pose, not %lld",
                  (long long)sizes);
  if (!rows.sizes_a || !rows.sizes_b) return refuse_null(rows.sizes_a ? "sizes_b" : "sizes_a");
  if (places_are_valid(rows, refused)) return BC_OK;
  return fail(BC_BAD_ROWS, "pairs[%lld] is (%lld, %lld), but there are %lld poses",
              (long long)refused, (long long)rows.pairs[2 * refused],
              (long long)rows.pairs[2 * refused + 1], (long long)rows.pose_count);
}

// Answer rows by `solve`, which returns the first that is refused, or −1. `refuse` finds the words for a
// row, by the places of its boxes.
template <class Solve, class Refuse>
bc_status answer_rows(const bc_rows& given, int threads, int64_t& refused, const Solve& solve,
                      const Refuse& refuse) {
  bc_status status = check_rows(given, threads, refused);
  if (status != BC_OK || given.count == 0) return status;
  Rows rows{numbers(given.poses_a),
            numbers(given.poses_b),
            numbers(given.sizes_a),
            numbers(given.sizes_b),
            given.size_count_a == 1 ? 0 : 3,
            given.size_count_b == 1 ? 0 : 3,
            given.pairs,
            long(given.pose_count)};
  refused = solve(rows, long(given.count));
  if (refused < 0) return BC_OK;
  // Another thread may have changed the pairs since: each place is read once.
  int64_t places[2] = {refused, refused};
  if (given.pairs) std::memcpy(places, given.pairs + 2 * refused, sizeof places);
  for (int64_t place : places)
    if (given.pairs && (place < 0 || place >= given.pose_count))
      return fail(BC_BAD_ROWS, "pairs[%lld] was changed while it was read", (long long)refused);
  refuse(rows, places);
  char why[sizeof error_text];
  std::memcpy(why, error_text, sizeof why);
  return fail(BC_BAD_ROWS, "row %lld: %.480s", (long long)refused, why);
}
template <class Solve>
bc_status answer_rows(const bc_rows& given, int threads, int64_t& refused, const Solve& solve) {
  return answer_rows(given, threads, refused, solve, [](const Rows& rows, const int64_t* places) {
    refuse_pair(rows.poses_a + 7 * places[0], rows.poses_b + 7 * places[1],
                rows.sizes_a + rows.size_step_a * places[0],
                rows.sizes_b + rows.size_step_b * places[1]);
  });
}

}  // namespace box_contact::detail
