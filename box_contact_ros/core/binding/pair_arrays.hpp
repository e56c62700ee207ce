// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Poses and sizes of pairs of boxes as arguments.
#pragma once

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

// Rows (count, columns) of a float64 array that lies in order, or nullptr. `count` −1: any.
inline const double* plain_rows(PyObject* object, npy_intp& count, npy_intp columns) {
  if (!is_plain<double>(object)) return nullptr;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  bool fits = PyArray_NDIM(array) == 2 && PyArray_DIM(array, 1) == columns &&
              (count < 0 || PyArray_DIM(array, 0) == count);
  if (!fits) return nullptr;
  count = PyArray_DIM(array, 0);
  return static_cast<const double*>(PyArray_DATA(array));
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
    for (npy_intp k = 0; k < 2 * count; ++k) {
      if (places.numbers[k] >= 0 && places.numbers[k] < poses) continue;
      PyErr_Format(PyExc_ValueError, "pairs[%zd] has the place %lld, which no pose has", k / 2,
                   (long long)places.numbers[k]);
      throw PythonError{};
    }
  }
};

}  // namespace box_contact::binding
