// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface, and the choice of the instruction set.
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>

#include "../mlp/shipped_network.hpp"
#include "refusals.hpp"
#include "solver.hpp"
#include "weights_file.hpp"

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
  return size_valid(Vec<double>{0.5 * size[0], 0.5 * size[1], 0.5 * size[2]});
}

// Why a pair is refused.
bc_status refuse_pair(const double* pose_a, const double* pose_b, const double* size_a,
                      const double* size_b) {
  if (!pose_is_valid(pose_a)) return refuse_pose("pose_a", pose_a);
  if (!pose_is_valid(pose_b)) return refuse_pose("pose_b", pose_b);
  return size_is_valid(size_a) ? refuse_size("size_b", size_b) : refuse_size("size_a", size_a);
}

bc_status make(const bc_size* size_a, const bc_size* size_b, const bc_options& options,
               bc_solver** solver) {
  if (!size_is_valid(size_a->extent)) return refuse_size("size_a", size_a->extent);
  if (!size_is_valid(size_b->extent)) return refuse_size("size_b", size_b->extent);
  Solver::Setup setup;
  setup.kernel = chosen_kernel();
  if (!setup.kernel) {
    std::string names;
    for (const Kernel* kernel : kernels())
      names += (names.empty() ? "" : ", ") + std::string(kernel->name);
    return fail(BC_BAD_ENVIRONMENT, "BOX_CONTACT_INSTRUCTION_SET is none of: %s", names.c_str());
  }
  std::copy_n(size_a->extent, 3, setup.size_a.begin());
  std::copy_n(size_b->extent, 3, setup.size_b.begin());
  setup.margin = options.margin;
  if (!(options.margin >= 0.0))
    return fail(BC_BAD_ARGUMENT, "margin must be 0 or more, not %g", options.margin);
  if (number_of(options.model) == BC_MLP) {
    setup.model = Model::mlp;
    try {
      if (options.weights) {
        setup.network = read_numbers(options.weights);
      } else {
        setup.network.assign(std::begin(shipped_network), std::end(shipped_network));
      }
    } catch (const std::runtime_error& error) {
      return fail(BC_BAD_WEIGHTS, "%s", error.what());
    }
  } else if (number_of(options.model) != BC_EXACT) {
    return fail(BC_BAD_ARGUMENT, "model %u is unknown", number_of(options.model));
  }
  *solver = reinterpret_cast<bc_solver*>(new Solver(std::move(setup)));
  return BC_OK;
}

Solver& solver_of(bc_solver* solver) { return *reinterpret_cast<Solver*>(solver); }

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

bc_status solve_rows(Solver& solver, const bc_rows& given, const bc_results& wanted, int threads,
                     int64_t& refused) {
  if (given.count < 0 || given.count > largest_count)
    return fail(BC_BAD_ARGUMENT, "count %lld is that of no array", (long long)given.count);
  if (threads < 1) return fail(BC_BAD_ARGUMENT, "threads must be 1 or more, not %d", threads);
  if (given.count == 0) return BC_OK;
  if (!given.poses_a || !given.poses_b) return refuse_null(given.poses_a ? "poses_b" : "poses_a");
  if (!places_are_valid(given, refused))
    return fail(BC_BAD_ROWS, "pairs[%lld] is (%lld, %lld), but there are %lld poses",
                (long long)refused, (long long)given.pairs[2 * refused],
                (long long)given.pairs[2 * refused + 1], (long long)given.pose_count);
  Rows rows{numbers(given.poses_a),
            numbers(given.poses_b),
            given.sizes_a ? numbers(given.sizes_a) : solver.setup().size_a.data(),
            given.sizes_b ? numbers(given.sizes_b) : solver.setup().size_b.data(),
            given.sizes_a ? 3 : 0,
            given.sizes_b ? 3 : 0,
            given.pairs};
  Results results{wanted.colliding, wanted.separation, wanted.normal, wanted.point,
                  wanted.volume,    wanted.covariance, wanted.axis,   0.0};
  refused = solver.solve(rows, long(given.count), results, threads);
  if (refused < 0) return BC_OK;
  int64_t of_a = given.pairs ? given.pairs[2 * refused] : refused;
  int64_t of_b = given.pairs ? given.pairs[2 * refused + 1] : refused;
  refuse_pair(rows.poses_a + 7 * of_a, rows.poses_b + 7 * of_b,
              rows.sizes_a + rows.size_step_a * of_a, rows.sizes_b + rows.size_step_b * of_b);
  char why[sizeof error_text];
  std::memcpy(why, error_text, sizeof why);
  return fail(BC_BAD_ROWS, "row %lld: %.480s", (long long)refused, why);
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

bc_status bc_solver_create(const bc_size* size_a, const bc_size* size_b, const bc_options* options,
                           bc_solver** solver) {
  return guarded([&] {
    if (!solver) return refuse_null("solver");
    *solver = nullptr;
    if (!size_a || !size_b) return refuse_null(size_a ? "size_b" : "size_a");
    bc_options all = BC_DEFAULT_OPTIONS;
    if (options && !read(options, all)) return fail(BC_BAD_ABI, "options.size is unknown");
    return make(size_a, size_b, all, solver);
  });
}

void bc_solver_destroy(bc_solver* solver) { delete reinterpret_cast<Solver*>(solver); }

bc_status bc_solve(bc_solver* solver, const bc_pose* pose_a, const bc_pose* pose_b,
                   const bc_size* size_a, const bc_size* size_b, bc_patch patch,
                   bc_contact* contact) {
  return guarded([&] {
    if (!solver || !pose_a || !pose_b || !contact)
      return refuse_null(!solver ? "solver" : !pose_a ? "pose_a" : !pose_b ? "pose_b" : "contact");
    if (number_of(patch) > BC_COVARIANCE)
      return fail(BC_BAD_ARGUMENT, "patch %u is unknown", number_of(patch));
    const double *a = numbers(pose_a), *b = numbers(pose_b);
    const double *extents_a = numbers(size_a), *extents_b = numbers(size_b);
    Solver& self = solver_of(solver);
    if (self.solve(a, b, extents_a, extents_b, patch, *contact)) return BC_OK;
    return refuse_pair(a, b, extents_a ? extents_a : self.setup().size_a.data(),
                       extents_b ? extents_b : self.setup().size_b.data());
  });
}

bc_status bc_solve_rows(bc_solver* solver, const bc_rows* rows, const bc_results* results,
                        int threads, int64_t* refused) {
  int64_t first = -1;
  bc_status status = guarded([&] {
    if (!solver || !rows || !results)
      return refuse_null(!solver ? "solver" : !rows ? "rows" : "results");
    bc_rows all_rows{};
    bc_results all_results{};
    if (!read(rows, all_rows)) return fail(BC_BAD_ABI, "rows.size is unknown");
    if (!read(results, all_results)) return fail(BC_BAD_ABI, "results.size is unknown");
    return solve_rows(solver_of(solver), all_rows, all_results, threads, first);
  });
  if (refused) *refused = first;
  return status;
}

bc_counts bc_solver_counts(const bc_solver* solver) {
  return solver ? reinterpret_cast<const Solver*>(solver)->counts() : bc_counts{};
}

}  // extern "C"
