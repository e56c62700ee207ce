// The public header: whether two boxes touch, where, and along which direction.
//
//   box_contact::Solver solver({2.0, 2.0, 2.0}, {1.0, 1.0, 1.0});  // full extents [m]
//   box_contact::Solver::Pose a{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};  // position, x y z w
//   box_contact::Solver::Pose b{{0.0, 0.0, 1.49}, {0.0, 0.0, 0.0, 1.0}};
//   box_contact::Contact contact = solver(a, b);
//
// Units are SI, frames are right-handed. A pose places a box's centre and axes in a frame common to
// both boxes. Answers are in the same frame. "Size" as a length: the largest extent of both boxes.
//
// Fields of `Contact`, each with its unit, its frame and its largest error. The rounding of the
// coordinates comes on top.
//
//   colliding: bool. Touching counts, up to 8 ulp of the largest coordinate or size.
//   separation [m]. Negative: the depth along the normal, to 1e-12 · size. Positive: the largest
//       gap of the separating-axis test, at most the distance.
//   normal: unit vector, common frame, from A to B. Moving B by depth · normal separates the boxes.
//   point [m], common frame: the centroid of A∩B. Model `exact` errs by at most
//       max(1e-9, 1e-14 · size / depth) · size. Model `mlp` errs by a few per cent of the smaller
//       box, and its point is inside both boxes.
//   volume [m³] of A∩B. Model `exact` errs by at most max(1e-9, 1e-14 · size / depth) of it. Model
//       `mlp` errs by some per cent, and its volume is positive.
//   covariance [m²], common frame: the second central moments of A∩B by its volume, symmetric. Model
//       `exact` errs by at most max(1e-8, 1e-14 · size / depth) of its trace. Model `mlp` errs by
//       some per cent of the trace, and its covariance is positive semidefinite.
//
// Without contact, `normal`, `point` and `covariance` are NaN, and `volume` is zero. A contact
// shallower than 1e-9 · size has the point, volume and covariance of boxes that were pressed in to
// this depth.
//
// Compile with `-std=c++17 -O3 -ffp-contract=off -fno-tree-slp-vectorize -Wno-psabi`, by g++ and by
// clang++. -ffp-contract=off alone does not stop g++: its SLP pass still fuses products and sums.
// Never use -ffast-math. With `-march=x86-64-v3` or `-v4` a batch has more lanes.
#pragma once

#if defined(__FAST_MATH__)
#error "box_contact needs IEEE arithmetic: compile without -ffast-math"
#endif

#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "mlp.hpp"

namespace box_contact {

// Answers for pairs of boxes A and B. A solver never changes, so threads may share one. Calls
// allocate no memory.
class Solver {
 public:
  using Pose = box_contact::Pose<double>;  // position [m]; quaternion x y z w of any length
  using Size = Vec<double>;                // full extents along the box's own axes [m]

  // Pairs that a batch solves side by side.
#if defined(__AVX512F__)
  static constexpr int lanes = 8;
#elif defined(__AVX2__)
  static constexpr int lanes = 4;
#else
  static constexpr int lanes = 2;
#endif

  // Model `exact`. Throws std::invalid_argument for extents outside 1e-50 to 1e50 m, and
  // std::logic_error where the compiler fuses products and sums.
  Solver(const Size& size_a, const Size& size_b) : size_a_(size_a), size_b_(size_b) {
    if (fuses_products())
      throw std::logic_error("box_contact: compile with -ffp-contract=off, without -ffast-math");
    check_size("size_a", size_a);
    check_size("size_b", size_b);
  }

  // Model `mlp`, with its own copy of a network. mlp_weights.hpp reads one. Throws
  // std::invalid_argument also for weights that are not finite or beyond ±1e4.
  Solver(const Size& size_a, const Size& size_b, Network network) : Solver(size_a, size_b) {
    for (const Network::Unit& unit : network.units) {
      check_weights(&unit.bias, 1);
      check_weights(unit.of_faces, 4);
      check_weights(unit.of_axis, 4);
      check_weights(unit.of_site, 4);
      check_weights(unit.to_outputs, site_outputs);
    }
    check_weights(network.output_bias, site_outputs);
    network_ = std::move(network);
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
    Counts counts;
    Size half_a = 0.5 * size_a_, half_b = 0.5 * size_b_;
    bool solved = network_ ? solve_one(MlpModel{*network_}, a, b, half_a, half_b, contact, counts)
                           : solve_one(ExactModel{}, a, b, half_a, half_b, contact, counts);
    if (!solved) refuse(pose_a, pose_b);
    return contact;
  }

  // The contacts of `count` pairs, bit for bit those of single calls. Poses: rows of seven numbers
  // `x y z qx qy qz qw`. Results: `count` rows each, normals and points of three numbers, covariances
  // of nine.
  // Returns the first row that is refused, or −1. A refused row gets `colliding` false and
  // `separation` NaN, and its other fields have no meaning. All other rows are solved.
  long batch(const double* poses_a, const double* poses_b, long count,
             const Results& results) const {
    return solve({poses_a, poses_b, size_a_.v, size_b_.v, 0, 0}, count, results);
  }

  // The same, and each row has its own boxes. Sizes: rows of three full extents [m]. Bad sizes are
  // refused like bad poses.
  long batch(const double* poses_a, const double* poses_b, const double* sizes_a,
             const double* sizes_b, long count, const Results& results) const {
    return solve({poses_a, poses_b, sizes_a, sizes_b, 3, 3}, count, results);
  }

 private:
  long solve(const Rows& rows, long count, const Results& results) const {
    using Block = Lanes<double, lanes>;
    Counts counts;
    return network_ ? solve_rows<Block>(MlpModel{*network_}, rows, 0, count, results, counts)
                    : solve_rows<Block>(ExactModel{}, rows, 0, count, results, counts);
  }

  // (1 + 2⁻³⁰)² has one bit more than a double holds. Fused or wider arithmetic keeps this bit.
  static bool fuses_products() {
    volatile double x = 1.0 + 0x1p-30;
    double y = x;
    return y * y - (1.0 + 0x1p-29) != 0.0;
  }

  static std::string text(const double* numbers, int count) {
    std::string words;
    char number[32];
    for (int k = 0; k < count; ++k) {
      std::snprintf(number, sizeof number, "%s%g", k ? ", " : "(", numbers[k]);
      words += number;
    }
    return words + ")";
  }
  static void check_size(const char* field, const Size& size) {
    if (!size_valid(0.5 * size))
      throw std::invalid_argument(std::string(field) + " " + text(size.v, 3) +
                                  " is not within 1e-50 to 1e50 m");
  }
  static void check_weights(const float* weights, int count) {
    for (int k = 0; k < count; ++k)
      if (!(std::fabs(weights[k]) <= 1e4F))
        throw std::invalid_argument("network: weight " + std::to_string(weights[k]) +
                                    " is not within -1e4 to 1e4");
  }
  [[noreturn]] static void refuse(const Pose& pose_a, const Pose& pose_b) {
    bool of_a = !pose_valid(pose_a);
    const Pose& pose = of_a ? pose_a : pose_b;
    std::string field = of_a ? "pose_a" : "pose_b";
    for (double coordinate : pose.position.v)
      if (!(std::fabs(coordinate) <= length_max))
        throw std::invalid_argument(field + " position " + text(pose.position.v, 3) +
                                    " is not finite, or exceeds 1e50 m");
    throw std::invalid_argument(field + " quaternion " + text(pose.quaternion, 4) +
                                " has no length within 1e-100 to 1e100");
  }

  Size size_a_, size_b_;
  std::optional<Network> network_;
};

}  // namespace box_contact
