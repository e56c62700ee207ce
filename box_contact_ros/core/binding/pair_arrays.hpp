// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Poses and sizes of pairs of boxes as arguments.
#pragma once

#include <algorithm>
#include <limits>

#include "../src/kernel.hpp"
#include "../src/library/refusals.hpp"
#include "arrays.hpp"

namespace box_contact::binding {

using detail::Rows;

// An array (n,) of float32 or float64 in any order of memory. Returns nullptr for another kind.
inline const double* numbers_of_array(PyArrayObject* array, int n, double* copy) {
  if (PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != n || !PyArray_ISNOTSWAPPED(array))
    return nullptr;
  int type = PyArray_TYPE(array);
  if (type == NPY_DOUBLE && PyArray_ISCARRAY_RO(array))
    return static_cast<const double*>(PyArray_DATA(array));
  if (type != NPY_DOUBLE && type != NPY_FLOAT) return nullptr;
  const char* place = PyArray_BYTES(array);
  npy_intp step = PyArray_STRIDE(array, 0);
  for (int k = 0; k < n; ++k, place += step) {
    if (type == NPY_DOUBLE) {
      std::memcpy(copy + k, place, sizeof(double));
    } else {
      float number;
      std::memcpy(&number, place, sizeof number);
      copy[k] = number;
    }
  }
  return copy;
}

// `n` numbers: an array, or a tuple or list of Python's own floats and integers. Others return
// nullptr, without an error.
inline const double* numbers_of(PyObject* object, int n, double* copy) {
  if (PyArray_CheckExact(object))
    return numbers_of_array(reinterpret_cast<PyArrayObject*>(object), n, copy);
  bool is_tuple = PyTuple_Check(object);
  if ((!is_tuple && !PyList_Check(object)) || Py_SIZE(object) != n) return nullptr;
  for (int k = 0; k < n; ++k) {
    PyObject* item = is_tuple ? PyTuple_GET_ITEM(object, k) : PyList_GET_ITEM(object, k);
    if (PyFloat_Check(item)) {
      copy[k] = PyFloat_AS_DOUBLE(item);
    } else if (PyLong_CheckExact(item)) {
      copy[k] = PyLong_AsDouble(item);
      if (copy[k] == -1.0 && PyErr_Occurred()) return PyErr_Clear(), nullptr;
    } else {
      return nullptr;
    }
  }
  return copy;
}

// Rows (count, columns) of an array that lies in order, or nullptr. `count` −1: any.
template <class Number>
const Number* plain_rows(PyObject* object, npy_intp& count, npy_intp columns) {
  if (!is_plain<Number>(object)) return nullptr;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  bool fits = PyArray_NDIM(array) == 2 && PyArray_DIM(array, 1) == columns &&
              (count < 0 || PyArray_DIM(array, 0) == count);
  if (!fits) return nullptr;
  count = PyArray_DIM(array, 0);
  return static_cast<const Number*>(PyArray_DATA(array));
}

// The first of pairs (count, 2) with a place that none of the poses has, or −1.
inline npy_intp bad_place(const int64_t* pairs, npy_intp count, npy_intp poses) {
  for (npy_intp k = 0; k < 2 * count; ++k)
    if (pairs[k] < 0 || pairs[k] >= poses) return k / 2;
  return -1;
}

inline void check_pairs(const Array<int64_t>& pairs, npy_intp poses) {
  npy_intp bad = bad_place(pairs.numbers, pairs.length(0), poses);
  if (bad < 0) return;
  PyErr_Format(PyExc_ValueError, "pairs[%zd] has a place that no pose has", bad);
  throw PythonError{};
}

// Write a list of poses (7,), None for a box that is not there, to rows of an array. Returns False
// at the first that is not plain, so that Python converts them all or says what is wrong.
inline PyObject* write_poses(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3 || !is_plain<double>(args[0]))
    fail(PyExc_TypeError, "write_poses(to, rows, poses)");
  auto to = read<double>(args[0], "to", {any_length, 7});
  auto rows = read<int64_t>(args[1], "rows", {any_length});
  if (!PyArray_ISWRITEABLE(to.array())) fail(PyExc_ValueError, "to is read-only");
  PyObject* poses = args[2];
  if (!PyList_Check(poses) || PyList_GET_SIZE(poses) != rows.length(0)) Py_RETURN_FALSE;
  for (npy_intp k = 0; k < rows.length(0); ++k) {
    int64_t row = rows.numbers[k];
    if (row < 0 || row >= to.length(0)) fail(PyExc_ValueError, "rows has one that `to` lacks");
    double copy[7], *place = to.numbers + 7 * row;
    std::fill_n(copy, 7, std::numeric_limits<double>::quiet_NaN());
    PyObject* pose = PyList_GET_ITEM(poses, k);
    const double* numbers = pose == Py_None ? copy : numbers_of(pose, 7, copy);
    if (!numbers) Py_RETURN_FALSE;
    std::memmove(place, numbers, sizeof copy);  // a pose may be a row of `to`
  }
  Py_RETURN_TRUE;
}

inline Pose<double> pose_at(const double* p) {
  return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
}

// Write the poses of the boxes of bodies to the first n of rows (m, 7). `bodies` (n,): the row of
// each box's body, or −1. `local` (n, 7): the boxes' poses in the bodies' frames. Returns the row of
// a body whose pose is bad, or −1. Seven NaN: the body is not there, nor are its boxes.
inline int64_t place_boxes_of_bodies(double* rows, const int64_t* bodies, npy_intp n,
                                     const double* local) {
  for (npy_intp box = 0; box < n; ++box) {
    int64_t row = bodies[box];
    if (row < 0) continue;
    const double* body = rows + 7 * row;
    bool is_there = !std::all_of(body, body + 7, [](double number) { return std::isnan(number); });
    if (is_there && !detail::pose_is_valid(body)) return row;
    Pose<double> pose = pose_in_common_frame(pose_at(body), pose_at(local + 7 * box));
    std::copy_n(pose.position.v, 3, rows + 7 * box);
    std::copy_n(pose.quaternion, 4, rows + 7 * box + 3);
  }
  return -1;
}

inline PyObject* place_boxes(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 3 || !is_plain<double>(args[0]))
    fail(PyExc_TypeError, "place_boxes(rows, bodies, local)");
  auto rows = read<double>(args[0], "rows", {any_length, 7});
  auto bodies = read<int64_t>(args[1], "bodies", {any_length});
  auto local = read<double>(args[2], "local", {bodies.length(0), 7});
  if (!PyArray_ISWRITEABLE(rows.array())) fail(PyExc_ValueError, "rows is read-only");
  if (bodies.length(0) > rows.length(0)) fail(PyExc_ValueError, "bodies has more than rows");
  for (npy_intp box = 0; box < bodies.length(0); ++box)
    if (bodies.numbers[box] >= rows.length(0))
      fail(PyExc_ValueError, "bodies has a row that `rows` lacks");
  return PyLong_FromLongLong(
      place_boxes_of_bodies(rows.numbers, bodies.numbers, bodies.length(0), local.numbers));
}

// Rows of pairs, as arrays that stay alive.
struct PairArrays {
  Array<double> poses_a, poses_b, sizes_a, sizes_b;
  Array<int64_t> places;
  npy_intp count;
  Rows rows{};

  // Read (poses_a, poses_b, sizes_a, sizes_b); `given` None, or the pairs (n, 2).
  PairArrays(PyObject* const* args, PyObject* given)
      : poses_a(read<double>(args[0], "poses_a", {any_length, 7})),
        poses_b(read<double>(args[1], "poses_b", {poses_a.length(0), 7})),
        sizes_a(read<double>(args[2], "sizes_a", {any_length, 3})),
        sizes_b(read<double>(args[3], "sizes_b", {any_length, 3})),
        places(read_given<int64_t>(given, "pairs", {any_length, 2})),
        count(poses_a.length(0)) {
    rows = {poses_a.numbers, poses_b.numbers, sizes_a.numbers, sizes_b.numbers,
            step(sizes_a),   step(sizes_b),   places.numbers,  long(count)};
    if (!places.object) return;
    count = places.length(0);
    check_pairs(places, poses_a.length(0));
  }

 private:
  long step(const Array<double>& sizes) const {
    if (sizes.length(0) == 1) return 0;
    if (sizes.length(0) != count) fail(PyExc_ValueError, "sizes must be as many as poses, or one");
    return 3;
  }
};

}  // namespace box_contact::binding
