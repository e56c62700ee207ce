// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface, and the choice of the instruction set.
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <string>

#include "../faces/face_patch.hpp"
#include "../mlp/shipped_network.hpp"
#include "batch.hpp"
#include "refusals.hpp"

namespace box_contact::detail {

const Kernels& kernels() {
  static const Kernels found = [] {
    Kernels here{{&kernel_baseline}, 1};
#if defined(BOX_CONTACT_AVX2)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
        __builtin_cpu_supports("bmi2"))
      here.all[here.count++] = &kernel_avx2;
#endif
#if defined(BOX_CONTACT_AVX512)
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
      here.all[here.count++] = &kernel_avx512;
#endif
    return here;
  }();
  return found;
}

const Kernel* chosen_kernel() {
  static const Kernel* const chosen = []() -> const Kernel* {
    const char* forced = std::getenv("BOX_CONTACT_INSTRUCTION_SET");
    if (!forced || !*forced) return kernels().end()[-1];
    for (const Kernel* kernel : kernels())
      if (!std::strcmp(forced, kernel->name)) return kernel;
    return nullptr;
  }();
  return chosen;
}

namespace {

bc_status refuse_size(const char* field, const double* size) {
  return fail(BC_BAD_SIZE, "%s (%g, %g, %g) is not within 1e-50 to 1e50 m", field, size[0], size[1],
              size[2]);
}

bool size_is_valid(const double* size) {
  return size_valid<double>(triple(Vec<double>{size[0], size[1], size[2]}));
}

// Why a pair is refused.
bc_status refuse_pair(const double* pose_a, const double* pose_b, const double* size_a,
                      const double* size_b) {
  if (!pose_is_valid(pose_a)) return refuse_pose("pose_a", pose_a);
  if (!pose_is_valid(pose_b)) return refuse_pose("pose_b", pose_b);
  return size_is_valid(size_a) ? refuse_size("size_b", size_b) : refuse_size("size_a", size_a);
}

// Why nobody answers a query.
bc_status refuse_query(const bc_query& query) {
  if (number_of(query.model) > BC_MLP)
    return fail(BC_BAD_ARGUMENT, "model %u is unknown", number_of(query.model));
  if (number_of(query.patch) > BC_COVARIANCE)
    return fail(BC_BAD_ARGUMENT, "patch %u is unknown", number_of(query.patch));
  if (!(query.margin >= 0.0))
    return fail(BC_BAD_ARGUMENT, "margin must be 0 or more, not %g", query.margin);
  std::string names;
  for (const Kernel* kernel : kernels())
    names += (names.empty() ? "" : ", ") + std::string(kernel->name);
  return fail(BC_BAD_ENVIRONMENT, "BOX_CONTACT_INSTRUCTION_SET is none of: %s", names.c_str());
}

// Call `work` with the solver and the query that a program gives, which may be of an older header.
template <class Work>
bc_status with_query(const bc_query* given, Work work) {
  bc_query query = bc_default_query();
  if (given && !read(given, query)) return fail(BC_BAD_ABI, "query.size is unknown");
  const Kernel* kernel = chosen_kernel();
  bool known = number_of(query.model) <= BC_MLP && number_of(query.patch) <= BC_COVARIANCE;
  if (!kernel || !known || !(query.margin >= 0.0)) return refuse_query(query);
  return work(Solver{kernel, query.model == BC_MLP ? Model::mlp : Model::exact, shipped_network}, query);
}

// Whether all places of boxes are within the poses. `first`: the first row where they are not.
bool places_are_valid(const bc_rows& rows, int64_t& first) {
  for (int64_t place = 0; rows.pairs && place < 2 * rows.count; ++place)
    if (rows.pairs[place] < 0 || rows.pairs[place] >= rows.pose_count) {
      first = place / 2;
      return false;
    }
  return true;
}

// No memory holds more rows.
constexpr int64_t largest_count = PTRDIFF_MAX / int64_t(sizeof(bc_contact));

const double* numbers(const bc_pose* poses) { return reinterpret_cast<const double*>(poses); }
const double* numbers(const bc_size* sizes) { return reinterpret_cast<const double*>(sizes); }

bc_status check_rows(const bc_rows& rows, int threads, int64_t& refused) {
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

// Answer rows by `solve`, which returns the first that is refused, or −1.
template <class Solve>
bc_status answer_rows(const bc_rows& given, int threads, int64_t& refused, const Solve& solve) {
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
  refuse_pair(rows.poses_a + 7 * places[0], rows.poses_b + 7 * places[1],
              rows.sizes_a + rows.size_step_a * places[0],
              rows.sizes_b + rows.size_step_b * places[1]);
  char why[sizeof error_text];
  std::memcpy(why, error_text, sizeof why);
  return fail(BC_BAD_ROWS, "row %lld: %.480s", (long long)refused, why);
}

PairNumbers pair_of(const bc_box& a, const bc_box& b) {
  return {numbers(&a.pose), numbers(&b.pose), numbers(&a.size), numbers(&b.size)};
}

bc_status find_face_patch(const bc_box& a, const bc_box& b, const double* normal, double tolerance,
                          bc_polygon& patch) {
  auto [pose_a, pose_b, size_a, size_b] = pair_of(a, b);
  if (!pose_is_valid(pose_a) || !pose_is_valid(pose_b) || !size_is_valid(size_a) ||
      !size_is_valid(size_b))
    return refuse_pair(pose_a, pose_b, size_a, size_b);
  Vec<double> from_a = vector_at(normal);
  if (!is_unit(from_a))
    return fail(BC_BAD_ARGUMENT, "normal (%g, %g, %g) must be of length 1", normal[0], normal[1],
                normal[2]);
  if (!(tolerance >= 0.0 && tolerance <= length_max))
    return fail(BC_BAD_ARGUMENT, "tolerance must be within 0 and 1e50 m, not %g", tolerance);
  patch = faces::in_common_frame(
      faces::patch_of_faces(a.pose, a.size, b.pose, b.size, from_a, tolerance));
  return BC_OK;
}

}  // namespace
}  // namespace box_contact::detail

using namespace box_contact::detail;

extern "C" {

int bc_abi(void) { return BC_ABI; }

const char* bc_version(void) { return BOX_CONTACT_VERSION; }

const char* bc_instruction_set(void) {
  const Kernel* kernel = chosen_kernel();
  return kernel ? kernel->name : nullptr;
}

const char* bc_error_text(void) { return error_text; }

bc_status bc_collide(const bc_box* a, const bc_box* b, const bc_query* query,
                     bc_contact* contact) {
  return guarded([&] {
    if (!a || !b || !contact) return refuse_null(!a ? "a" : !b ? "b" : "contact");
    return with_query(query, [&](const Solver& solver, const bc_query& asked) {
      PairNumbers pair = pair_of(*a, *b);
      if (solve_pair(solver, pair, asked.patch, asked.margin, *contact)) return BC_OK;
      return refuse_pair(pair.pose_a, pair.pose_b, pair.size_a, pair.size_b);
    });
  });
}

bc_status bc_collide_rows(const bc_rows* rows, const bc_query* query, const bc_results* results,
                          int threads, int64_t* refused) {
  int64_t first = -1;
  bc_status status = guarded([&] {
    if (!rows || !results) return refuse_null(rows ? "results" : "rows");
    bc_rows all_rows{};
    bc_results all_results{};
    if (!read(rows, all_rows)) return fail(BC_BAD_ABI, "rows.size is unknown");
    if (!read(results, all_results)) return fail(BC_BAD_ABI, "results.size is unknown");
    return with_query(query, [&](const Solver& solver, const bc_query& asked) {
      Results wanted{all_results.colliding,  all_results.separation, all_results.normal,
                     all_results.point,      all_results.volume,     all_results.covariance,
                     all_results.axis,       asked.margin};
      return answer_rows(all_rows, threads, first, [&](const Rows& given, long count) {
        return solve_rows(solver, given, count, wanted, threads);
      });
    });
  });
  if (refused) *refused = first;
  return status;
}

bc_status bc_distance(const bc_box* a, const bc_box* b, bc_nearest* nearest) {
  return guarded([&] {
    if (!a || !b || !nearest) return refuse_null(!a ? "a" : !b ? "b" : "nearest");
    if (nearest->size != sizeof(bc_nearest)) return fail(BC_BAD_ABI, "nearest.size is unknown");
    return with_query(nullptr, [&](const Solver& solver, const bc_query&) {
      PairNumbers pair = pair_of(*a, *b);
      if (solver.kernel->nearest_pair(pair, *nearest)) return BC_OK;
      return refuse_pair(pair.pose_a, pair.pose_b, pair.size_a, pair.size_b);
    });
  });
}

bc_status bc_distance_rows(const bc_rows* rows, const bc_nearest_results* results, int threads,
                           int64_t* refused) {
  int64_t first = -1;
  bc_status status = guarded([&] {
    if (!rows || !results) return refuse_null(rows ? "results" : "rows");
    bc_rows all_rows{};
    bc_nearest_results all{};
    if (!read(rows, all_rows)) return fail(BC_BAD_ABI, "rows.size is unknown");
    if (!read(results, all)) return fail(BC_BAD_ABI, "results.size is unknown");
    NearestResults wanted{all.colliding, all.distance, all.normal, all.point_a, all.point_b};
    return with_query(nullptr, [&](const Solver& solver, const bc_query&) {
      return answer_rows(all_rows, threads, first, [&](const Rows& given, long count) {
        return nearest_rows(*solver.kernel, given, count, wanted, threads);
      });
    });
  });
  if (refused) *refused = first;
  return status;
}

bc_status bc_face_patch(const bc_box* a, const bc_box* b, const double* normal, double tolerance,
                        bc_polygon* patch) {
  return guarded([&] {
    if (!a || !b || !normal || !patch)
      return refuse_null(!a ? "a" : !b ? "b" : !normal ? "normal" : "patch");
    if (patch->size != sizeof(bc_polygon)) return fail(BC_BAD_ABI, "patch.size is unknown");
    return find_face_patch(*a, *b, normal, tolerance, *patch);
  });
}

}  // extern "C"
