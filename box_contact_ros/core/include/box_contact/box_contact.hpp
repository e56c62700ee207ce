// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C++17 interface of libbox_contact: whether two boxes touch, where, and along which direction.
//
//   box_contact::Solver solver({1.0, 1.0, 1.0}, {2.0, 2.0, 2.0});   // full extents [m]
//   box_contact::Pose a{{0.0, 0.0, 1.49}, {0.0, 0.0, 0.0, 1.0}};    // position, quaternion x y z w
//   box_contact::Pose b{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
//   box_contact::Contact contact = solver(a, b);  // the normal points down, from A to B
//
// Units are SI, frames are right-handed. A pose places a box's centre and axes in a frame common to
// both boxes. Answers are in the same frame. "Size" as a length: the largest extent of both boxes.
//
// Fields of `Contact`, each with its unit, its frame and its largest error. The rounding of the
// coordinates comes on top.
//
//   colliding: bool. Touching counts, up to 8 ulp of the largest coordinate or size.
//   separation [m], to 1e-12 · size. Negative: the depth along the normal. Positive: the largest
//       gap of the separating-axis test, at most the distance.
//   normal: unit vector, common frame, from A to B. Moving B by depth · normal separates the boxes.
//   axis: the winning axis. 0–2: faces of A. 3–5: faces of B. 6 + 3 i + j: the edges a_i × b_j.
//   point [m], common frame: the centroid of A∩B, inside both boxes but for its error. The error of
//       model `exact` is at most max(1e-9, 1e-14 · size / depth) · size. That of model `mlp` is below
//       0.01 % of the smaller box's longest edge in 99 of 100 contacts.
//   volume [m³] of A∩B. The error of model `exact` is at most max(1e-9, 1e-14 · size / depth) of it.
//       That of model `mlp` is at most 1 %, plus rounding.
//   covariance [m²], common frame: the second central moments of A∩B divided by its volume. The
//       error of model `exact` is at most max(1e-8, 1e-14 · size / depth) of the trace. That of model
//       `mlp` is below 0.1 % of the trace in 99 of 100 contacts; it is positive definite.
//
// Without contact, `point` and `covariance` are NaN, and `volume` is zero. `normal` is NaN where the
// separation exceeds the margin, 0 by default. A contact shallower than 1e-9 · size has the point,
// volume and covariance of boxes that were pressed in to this depth.
//
// No compiler flag is needed. The library contains code for several instruction sets, and uses the
// best one that the machine can run.
#ifndef BOX_CONTACT_HPP
#define BOX_CONTACT_HPP

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "box_contact.h"

namespace box_contact {

using Size = bc_size;        // full extents along the box's own axes [m]
using Pose = bc_pose;        // position [m]; quaternion x y z w of any length
using Contact = bc_contact;  // see above
using Counts = bc_counts;

enum class Patch { none = BC_NO_PATCH, volume = BC_VOLUME, covariance = BC_COVARIANCE };

// Numbers in a row that somebody else owns: an array, a std::vector or a std::array.
template <class T>
class Span {
 public:
  constexpr Span() = default;
  constexpr Span(T* data, std::size_t size) : data_(data), size_(size) {}
  template <std::size_t n>
  constexpr Span(T (&array)[n]) : data_(array), size_(n) {}
  template <class Container, class = decltype(static_cast<T*>(std::declval<Container&>().data()))>
  constexpr Span(Container&& container) : data_(container.data()), size_(container.size()) {}

  constexpr T* data() const { return data_; }
  constexpr std::size_t size() const { return size_; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

namespace detail {

// Without exceptions (-fno-exceptions) the program ends; such programs call box_contact.h instead.
[[noreturn]] inline void raise(bc_status status, const char* words) {
#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
  if (status == BC_NO_MEMORY) throw std::bad_alloc();
  if (status == BC_BAD_WEIGHTS || status == BC_BAD_ENVIRONMENT || status == BC_BAD_ABI)
    throw std::runtime_error(words);
  throw std::invalid_argument(words);
#else
  (void)status, (void)words;
  std::abort();
#endif
}

}  // namespace detail

// Arrays of a row for each pair; nullptr for what is not wanted, which is then not computed.
struct Results {
  bool* colliding = nullptr;
  double* separation = nullptr;
  double* normal = nullptr;  // three numbers a row
  double* point = nullptr;   // three numbers a row
  double* volume = nullptr;
  double* covariance = nullptr;  // nine numbers a row
  std::int32_t* axis = nullptr;
};

// Answers for pairs of boxes A and B. Threads may share a solver. Calls allocate no memory, but for
// those of several threads.
class Solver {
 public:
  using Pose = box_contact::Pose;
  using Size = box_contact::Size;

  struct Options {
    bc_model model = BC_MLP;
    std::string weights;  // path of a regular file of at most 16 MiB; empty: the shipped weights
    double margin = 0.0;  // [m]; normals are given up to this separation
  };

  // Model `mlp`. Throws std::invalid_argument, with field and value, for extents outside 1e-50 to
  // 1e50 m.
  Solver(const Size& size_a, const Size& size_b) : Solver(size_a, size_b, Options()) {}

  // Throws std::invalid_argument as well, and std::runtime_error for a weights file that is refused
  // and for an unknown BOX_CONTACT_INSTRUCTION_SET.
  Solver(const Size& size_a, const Size& size_b, const Options& options) {
    if (bc_abi() != BC_ABI)
      detail::raise(BC_BAD_ABI, "libbox_contact is of another version than its header");
    bc_options plain = BC_DEFAULT_OPTIONS;
    plain.model = options.model;
    plain.weights = options.weights.empty() ? nullptr : options.weights.c_str();
    plain.margin = options.margin;
    bc_solver* made;
    check(bc_solver_create(&size_a, &size_b, &plain, &made));
    solver_.reset(made);
  }

  // The contact of one pair. Throws std::invalid_argument with field and value. Refused are numbers
  // that are not finite, coordinates beyond 1e50 m, and quaternions of a length outside 1e-100 to
  // 1e100.
  Contact operator()(const Pose& pose_a, const Pose& pose_b,
                     Patch patch = Patch::covariance) const {
    return solve(pose_a, pose_b, nullptr, nullptr, patch);
  }
  // The same for boxes of these sizes.
  Contact operator()(const Pose& pose_a, const Pose& pose_b, const Size& size_a, const Size& size_b,
                     Patch patch = Patch::covariance) const {
    return solve(pose_a, pose_b, &size_a, &size_b, patch);
  }

  // Rows of pairs: row i is (poses_a[i], poses_b[i]). With `pairs` row i has box A at
  // poses_a[pairs[2 i]] and box B at poses_b[pairs[2 i + 1]]; an empty list has no rows. Poses of A
  // and B are equally many. Sizes go with poses, one for each; without them all are the solver's.
  struct Rows {
    Span<const Pose> poses_a, poses_b;
    std::optional<Span<const Size>> sizes_a{}, sizes_b{};
    std::optional<Span<const std::int64_t>> pairs{};
  };

  // Solve many pairs, bit for bit as single calls do. Returns the first row that is refused, or −1. A
  // refused row gets `colliding` false and `separation` NaN, and its other fields have no meaning.
  // All other rows are solved. Throws std::invalid_argument for arrays of unequal lengths, and where
  // a place in `pairs` has no pose.
  std::int64_t batch(const Rows& rows, const Results& results, int threads = 1) const {
    std::size_t poses = rows.poses_a.size();
    bool fits = rows.poses_b.size() == poses && fits_poses(rows.sizes_a, poses) &&
                fits_poses(rows.sizes_b, poses);
    if (!fits) detail::raise(BC_BAD_ARGUMENT, "poses_a, poses_b and sizes must be equally many");
    Span<const std::int64_t> pairs = rows.pairs.value_or(Span<const std::int64_t>());
    if (pairs.size() % 2) detail::raise(BC_BAD_ARGUMENT, "pairs must be two indices a row");
    const bc_rows plain{sizeof(bc_rows),       std::int64_t(rows.pairs ? pairs.size() / 2 : poses),
                        rows.poses_a.data(),   rows.poses_b.data(),
                        data_of(rows.sizes_a), data_of(rows.sizes_b),
                        pairs.data(),          std::int64_t(poses)};
    const bc_results wanted{sizeof(bc_results), results.colliding, results.separation,
                            results.normal,     results.point,     results.volume,
                            results.covariance, results.axis};
    std::int64_t refused = -1;
    bc_status status = bc_solve_rows(solver_.get(), &plain, &wanted, threads, &refused);
    if (status != BC_BAD_ROWS || is_bad_place(rows, refused)) check(status);
    return refused;
  }
  std::int64_t batch(Span<const Pose> poses_a, Span<const Pose> poses_b, const Results& results,
                     int threads = 1) const {
    return batch({poses_a, poses_b}, results, threads);
  }

  // How many contacts took another way than most, since the solver was made.
  Counts counts() const { return bc_solver_counts(solver_.get()); }

 private:
  struct Destroy {
    void operator()(bc_solver* solver) const { bc_solver_destroy(solver); }
  };

  Contact solve(const Pose& pose_a, const Pose& pose_b, const Size* size_a, const Size* size_b,
                Patch patch) const {
    Contact contact;
    check(bc_solve(solver_.get(), &pose_a, &pose_b, size_a, size_b, bc_patch(patch), &contact));
    return contact;
  }

  static bool fits_poses(const std::optional<Span<const Size>>& sizes, std::size_t poses) {
    return !sizes || sizes->size() == poses;
  }
  static const Size* data_of(const std::optional<Span<const Size>>& sizes) {
    return sizes ? sizes->data() : nullptr;
  }
  static bool is_bad_place(const Rows& rows, std::int64_t row) {
    if (!rows.pairs) return false;
    for (std::int64_t place : {rows.pairs->data()[2 * row], rows.pairs->data()[2 * row + 1]})
      if (place < 0 || place >= std::int64_t(rows.poses_a.size())) return true;
    return false;
  }

  static void check(bc_status status) {
    if (status != BC_OK) detail::raise(status, bc_error_text());
  }

  std::unique_ptr<bc_solver, Destroy> solver_;
};

// The instruction set of this process: "baseline", "avx2" or "avx512".
inline std::string instruction_set() {
  const char* name = bc_instruction_set();
  return name ? name : "";
}

}  // namespace box_contact

#endif
