// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface, and the choice of the instruction set.
#include <cstdlib>
#include <cstring>

#include "../faces/face_patch.hpp"
#include "../mlp/shipped_network.hpp"
#include "pair_arguments.hpp"

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

// Why nobody answers a query.
bc_status refuse_query(const bc_query& query) {
  if (number_of(query.model) > BC_MLP)
    return fail(BC_BAD_ARGUMENT, "model %u is unknown", number_of(query.model));
  if (number_of(query.patch) > BC_COVARIANCE)
    return fail(BC_BAD_ARGUMENT, "patch %u is unknown", number_of(query.patch));
  if (!(query.margin >= 0.0))
    return fail(BC_BAD_ARGUMENT, "margin must be 0 or more, not %g", query.margin);
  return refuse_environment();
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
