// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The patches of two faces, as arrays.
#pragma once

#include <vector>

#include "../src/faces/beds.hpp"
#include "../src/faces/face_patch.hpp"
#include "../src/faces/hull.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

inline void check_normals(const Array<double>& normal) {
  for (npy_intp k = 0; k < normal.length(0); ++k) {
    if (is_unit(vector_at(normal.numbers + 3 * k))) continue;
    Owned row(made(PySequence_GetItem(normal.object.get(), k)));
    Owned numbers(made(PyObject_CallMethod(row.get(), "tolist", nullptr)));
    PyErr_Format(PyExc_ValueError, "normal[%zd] must be of length 1, not %R", k, numbers.get());
    throw PythonError{};
  }
}

// The rows of `polygon` (count, corners_max, 3): the corners, and the first one again in what is left.
// Where faces are apart there are none, and places are NaN.
inline PyObject* face_patches(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 5)
    fail(PyExc_TypeError, "face_patches(sizes, poses, pairs, normal, tolerance)");
  auto sizes = read<double>(args[0], "sizes", {any_length, 3});
  auto poses = read<double>(args[1], "poses", {sizes.length(0), 7});
  auto pairs = read<int64_t>(args[2], "pairs", {any_length, 2});
  npy_intp n = pairs.length(0);
  auto normal = read<double>(args[3], "normal", {n, 3});
  double tolerance = number_of(args[4], "tolerance");
  check_pairs(pairs, sizes.length(0));
  check_normals(normal);
  constexpr npy_intp corners = faces::Polygon::corners_max;
  auto polygon = make<double>({n, corners, 3}), area = make<double>({n});
  auto corner_count = make<int64_t>({n});
  auto centre = make<double>({n, 3}), rectangle = make<double>({n, 4, 3});
  auto* pose = reinterpret_cast<const bc_pose*>(poses.numbers);
  auto* size = reinterpret_cast<const bc_size*>(sizes.numbers);
  for (npy_intp k = 0; k < n; ++k) {
    int64_t a = pairs.numbers[2 * k], b = pairs.numbers[2 * k + 1];
    faces::FacePatch patch = faces::patch_of_faces(
        pose[a], size[a], pose[b], size[b], vector_at(normal.numbers + 3 * k), tolerance);
    bc_polygon found = faces::in_common_frame(patch);
    area.numbers[k] = found.area;
    corner_count.numbers[k] = found.count;
    std::copy_n(found.centre, 3, centre.numbers + 3 * k);
    std::copy_n(found.corners[0], 3 * corners, polygon.numbers + 3 * corners * k);
    if (found.count == 0) patch.height = not_a_number;
    auto around = patch.rectangle();
    for (size_t c = 0; c < 4; ++c)
      write(patch.level(around[c]), rectangle.numbers + 3 * (4 * k + npy_intp(c)));
  }
  return pack(&PyTuple_Type, polygon, corner_count, area, centre, rectangle);
}

// The greatest pressures of unit loads at points, on beds that do not pull.
inline PyObject* bed_pressures(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "bed_pressures(polygon, corner_count, at)");
  constexpr npy_intp corners = faces::Polygon::corners_max;
  auto polygon = read<double>(args[0], "polygon", {any_length, corners, 2});
  npy_intp n = polygon.length(0);
  auto corner_count = read<int64_t>(args[1], "corner_count", {n});
  auto at = read<double>(args[2], "at", {n, 2});
  auto pressure = make<double>({n});
  for (npy_intp k = 0; k < n; ++k) {
    faces::Polygon one;
    for (npy_intp c = 0; c < std::min<npy_intp>(corner_count.numbers[k], corners); ++c) {
      const double* corner = polygon.numbers + 2 * (corners * k + c);
      one.add({corner[0], corner[1]});
    }
    pressure.numbers[k] =
        faces::greatest_pressure(one, {at.numbers[2 * k], at.numbers[2 * k + 1]});
  }
  return pressure.object.release();
}

// How deep points are inside the hulls of others, which come in order: those of row k begin at first[k].
inline PyObject* hull(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 1) fail(PyExc_TypeError, "hull(points)");
  auto points = read<double>(args[0], "points", {any_length, 2});
  std::vector<faces::Point> own, corners;
  for (npy_intp p = 0; p < points.length(0); ++p)
    own.push_back({points.numbers[2 * p], points.numbers[2 * p + 1]});
  faces::make_hull(own, corners);
  auto found = make<double>({static_cast<npy_intp>(corners.size()), 2});
  for (size_t k = 0; k < corners.size(); ++k) {
    found.numbers[2 * k] = corners[k].x;
    found.numbers[2 * k + 1] = corners[k].y;
  }
  return found.object.release();
}

inline PyObject* hull_depths(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "hull_depths(points, first, at)");
  auto points = read<double>(args[0], "points", {any_length, 2});
  auto at = read<double>(args[2], "at", {any_length, 2});
  npy_intp n = at.length(0);
  auto first = read<int64_t>(args[1], "first", {n + 1});
  auto depth = make<double>({n});
  std::vector<faces::Point> own, hull;
  for (npy_intp k = 0; k < n; ++k) {
    int64_t begin = first.numbers[k], end = first.numbers[k + 1];
    if (begin < 0 || end < begin || end > points.length(0))
      fail(PyExc_ValueError, "first must rise from 0 to the number of points");
    own.clear();
    for (int64_t p = begin; p < end; ++p)
      own.push_back({points.numbers[2 * p], points.numbers[2 * p + 1]});
    faces::make_hull(own, hull);
    depth.numbers[k] = faces::depth_inside(hull, {at.numbers[2 * k], at.numbers[2 * k + 1]});
  }
  return depth.object.release();
}

}  // namespace box_contact::binding
