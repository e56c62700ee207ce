// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Poses and sizes of pairs of boxes as arguments.
#pragma once

#include <algorithm>
#include <limits>

#include "../src/kernel.hpp"
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
    if (places.object) check_places();
  }

 private:
  long step(const Array<double>& sizes) const {
    if (sizes.length(0) == 1) return 0;
    if (sizes.length(0) != count) fail(PyExc_ValueError, "sizes must be as many as poses, or one");
    return 3;
  }
  void check_places() {
    npy_intp poses = count;
    count = places.length(0);
    npy_intp bad = bad_place(places.numbers, count, poses);
    if (bad < 0) return;
    PyErr_Format(PyExc_ValueError, "pairs[%zd] has a place that no pose has", bad);
    throw PythonError{};
  }
};

}  // namespace box_contact::binding
