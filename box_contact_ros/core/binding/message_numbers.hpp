// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The numbers of contacts as messages have them, with the areas by which faces meet.
#pragma once

#include <algorithm>

#include "../src/faces/face_patch.hpp"
#include "models.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

// The area of the patch of two faces [m²]; 0 where edges meet. `normal`: of the separating axis; null: it is
// not known.
inline double face_area(const Rows& rows, npy_intp row, const double* normal) {
  npy_intp a = row, b = row;
  if (rows.pairs) a = rows.pairs[2 * row], b = rows.pairs[2 * row + 1];
  detail::PairNumbers pair{rows.poses_a + 7 * a, rows.poses_b + 7 * b,
                           rows.sizes_a + rows.size_step_a * a,
                           rows.sizes_b + rows.size_step_b * b};
  bc_contact exact;
  if (!normal) {
    detail::Solver solver{kernel, detail::Model::exact, nullptr};
    if (!solve_pair(solver, pair, BC_NO_PATCH, 0.0, exact) || !exact.colliding) return 0.0;
    normal = exact.normal;
  }
  auto pose = [](const double* p) { return reinterpret_cast<const bc_pose*>(p); };
  auto size = [](const double* p) { return reinterpret_cast<const bc_size*>(p); };
  return faces::patch_of_faces(*pose(pair.pose_a), *size(pair.size_a), *pose(pair.pose_b),
                               *size(pair.size_b), vector_at(normal), faces::face_tolerance)
      .area;
}

inline PyObject* face_areas(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "face_areas(sizes, poses, pairs)");
  auto sizes = read<double>(args[0], "sizes", {any_length, 3});
  auto poses = read<double>(args[1], "poses", {sizes.length(0), 7});
  auto pairs = read<int64_t>(args[2], "pairs", {any_length, 2});
  npy_intp n = pairs.length(0);
  check_pairs(pairs, sizes.length(0));
  Rows rows{poses.numbers, poses.numbers, sizes.numbers,         sizes.numbers, 3, 3,
            pairs.numbers, long(sizes.length(0))};
  auto area = make<double>({n});
  for (npy_intp row = 0; row < n; ++row)
    area.numbers[row] = face_area(rows, row, nullptr);
  return area.object.release();
}

// Numbers of a contact in a message: point, normal, depth, volume, area, upper covariance.
constexpr npy_intp message_numbers_count = 15;

// Contacts in memory, a row each.
struct ContactRows {
  const double *point, *normal, *separation, *volume, *covariance;

  void write(npy_intp row, double area, double* to) const {
    const double* c = covariance + 9 * row;
    to = std::copy_n(normal + 3 * row, 3, std::copy_n(point + 3 * row, 3, to));
    for (double number : {-separation[row], volume[row], area, c[0], c[1], c[2], c[4], c[5], c[8]})
      *to++ = number;
  }
};

inline PyObject* message_numbers(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 6)
    fail(PyExc_TypeError, "message_numbers(point, normal, separation, volume, covariance, area)");
  auto point = read<double>(args[0], "point", {any_length, 3});
  npy_intp rows = point.length(0);
  auto normal = read<double>(args[1], "normal", {rows, 3});
  auto separation = read<double>(args[2], "separation", {rows});
  auto volume = read<double>(args[3], "volume", {rows});
  auto covariance = read<double>(args[4], "covariance", {rows, 3, 3});
  auto area = read<double>(args[5], "area", {rows});
  ContactRows contacts{point.numbers, normal.numbers, separation.numbers, volume.numbers,
                       covariance.numbers};
  auto numbers = make<double>({rows, message_numbers_count});
  for (npy_intp row = 0; row < rows; ++row)
    contacts.write(row, area.numbers[row], numbers.numbers + message_numbers_count * row);
  return numbers.object.release();
}

}  // namespace box_contact::binding
