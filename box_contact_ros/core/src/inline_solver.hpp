// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The solver of box_contact/inline.hpp.
#pragma once

#include "mlp/mlp_model.hpp"
#include "mlp/shipped_network.hpp"
#include "pose_refusal.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Answers for pairs of boxes A and B; box_contact.hpp describes it. Threads may share a solver. Calls
// allocate no memory.
class Solver {
 public:
  enum class Model { exact, mlp };
  using Pose = BOX_CONTACT_SET::Pose<double>;  // position [m]; quaternion x y z w of any length
  using Size = Vec<double>;                    // full extents along the box's own axes [m]

  // Arrays of a row for each pair: normals and points have three numbers, covariances nine. The last
  // three may be nullptr.
  struct Results {
    bool* colliding;
    double *separation, *normal, *point;
    double *volume = nullptr, *covariance = nullptr;
    int32_t* axis = nullptr;
  };

  // Pairs that a batch solves side by side.
#if defined(__AVX512F__)
  static constexpr int lanes = 8;
#elif defined(__AVX2__)
  static constexpr int lanes = 4;
#else
  static constexpr int lanes = 2;
#endif

  // Throws std::invalid_argument for extents outside 1e-50 to 1e50 m. Throws std::logic_error where
  // the compiler fuses products and sums in spite of the pragmas.
  Solver(const Size& size_a, const Size& size_b, Model model = Model::mlp)
      : size_a_(size_a), size_b_(size_b), model_(model) {
    if (fuses_products())
      throw std::logic_error("box_contact: compile with -ffp-contract=off, without -ffast-math");
    check_size("size_a", size_a);
    check_size("size_b", size_b);
  }

  // The contact of one pair. Throws std::invalid_argument with field and value. Refused are numbers
  // that are not finite, coordinates beyond 1e50 m, and quaternions of a length outside 1e-100 to
  // 1e100.
  Contact operator()(const Pose& pose_a, const Pose& pose_b) const {
    const double a[7] = {pose_a.position[0],   pose_a.position[1],   pose_a.position[2],
                         pose_a.quaternion[0], pose_a.quaternion[1], pose_a.quaternion[2],
                         pose_a.quaternion[3]};
    const double b[7] = {pose_b.position[0],   pose_b.position[1],   pose_b.position[2],
                         pose_b.quaternion[0], pose_b.quaternion[1], pose_b.quaternion[2],
                         pose_b.quaternion[3]};
    Contact contact{};
    int32_t axis;
    Results results{&contact.colliding,
                    &contact.separation,
                    contact.normal.v,
                    contact.point.v,
                    &contact.volume,
                    contact.covariance[0],
                    &axis};
    if (solve({a, b, size_a_.v, size_b_.v, 0, 0, nullptr}, 1, results) >= 0) refuse(a, b);
    contact.axis = axis;
    return contact;
  }

  // The contacts of `count` pairs, bit for bit those of single calls. Poses: rows of seven numbers
  // `x y z qx qy qz qw`. Results: `count` rows each, normals and points of three numbers, covariances
  // of nine.
  // Returns the first row that is refused, or −1. A refused row gets `colliding` false and
  // `separation` NaN, and its other fields have no meaning. All other rows are solved.
  long batch(const double* poses_a, const double* poses_b, long count,
             const Results& results) const {
    return solve({poses_a, poses_b, size_a_.v, size_b_.v, 0, 0, nullptr}, count, results);
  }

  // The same, and each row has its own boxes. Sizes: rows of three full extents [m]. Bad sizes are
  // refused like bad poses.
  long batch(const double* poses_a, const double* poses_b, const double* sizes_a,
             const double* sizes_b, long count, const Results& results) const {
    return solve({poses_a, poses_b, sizes_a, sizes_b, 3, 3, nullptr}, count, results);
  }

 private:
  long solve(const Rows& rows, long count, const Results& wanted) const {
    using Block = Lanes<double, lanes>;
    detail::Results results{wanted.colliding, wanted.separation, wanted.normal, wanted.point,
                            wanted.volume,    wanted.covariance, wanted.axis,   0.0};
    Counts counts{};
    if (model_ == Model::mlp)
      return solve_rows<Block>(MlpModel{shipped()}, rows, 0, count, results, counts);
    return solve_rows<Block>(ExactModel{}, rows, 0, count, results, counts);
  }

  static Network shipped() {
    constexpr long count = std::size(detail::shipped_network);
    return view(detail::shipped_network, count);
  }

  // (1 + 2⁻³⁰)² has one bit more than a double holds. Fused or wider arithmetic keeps this bit.
  static bool fuses_products() {
    volatile double x = 1.0 + 0x1p-30;
    double y = x;
    return y * y - (1.0 + 0x1p-29) != 0.0;
  }

  static void check_size(const char* field, const Size& size) {
    if (size_valid(0.5 * size)) return;
    char words[200];
    std::snprintf(words, sizeof words, "%s (%g, %g, %g) is not within 1e-50 to 1e50 m", field,
                  size[0], size[1], size[2]);
    throw std::invalid_argument(words);
  }
  [[noreturn]] static void refuse(const double* a, const double* b) {
    bool of_a = !pose_valid(Pose{{a[0], a[1], a[2]}, {a[3], a[4], a[5], a[6]}});
    char words[300];
    explain_refusal(of_a ? "pose_a" : "pose_b", of_a ? a : b, words, sizeof words);
    throw std::invalid_argument(words);
  }

  Size size_a_, size_b_;
  Model model_;
};

}  // namespace box_contact::BOX_CONTACT_SET
