// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Contacts as Python has them: named tuples of Python's own, for one pair and for many.
#pragma once

#include <limits>

#include "../src/kernel.hpp"
#include "arrays.hpp"

namespace box_contact::binding {

inline PyTypeObject* contact_type = nullptr;  // tuples, until `use_contact_types` is called
inline PyTypeObject* contacts_type = nullptr;

// A new tuple of a type; takes over the fields, and some of them may be nullptr.
template <Py_ssize_t count>
PyObject* new_tuple(PyTypeObject* type, PyObject* const (&fields)[count]) {
  bool complete = true;
  for (PyObject* field : fields) complete &= field != nullptr;
  PyObject* tuple = complete ? type->tp_alloc(type, count) : nullptr;
  for (Py_ssize_t k = 0; k < count; ++k) {
    if (tuple) {
      PyTuple_SET_ITEM(tuple, k, fields[k]);
    } else {
      Py_XDECREF(fields[k]);
    }
  }
  return tuple;
}

// A new array of 3, or of 3 × 3 numbers.
inline PyObject* new_array(const double* numbers, int dimensions) {
  npy_intp shape[] = {3, 3};
  PyObject* array = PyArray_SimpleNew(dimensions, shape, NPY_DOUBLE);
  if (array)
    std::memcpy(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array)), numbers,
                (dimensions == 1 ? 3 : 9) * sizeof(double));
  return array;
}

inline PyObject* new_contact(const bc_contact& contact) {
  PyObject* const fields[] = {
      PyBool_FromLong(contact.colliding), PyFloat_FromDouble(contact.separation),
      new_array(contact.normal, 1),       new_array(contact.point, 1),
      PyFloat_FromDouble(contact.volume), new_array(contact.covariance[0], 2),
      PyLong_FromLong(contact.axis)};
  return new_tuple(contact_type, fields);
}

// Arrays of a row for each pair.
struct ContactArrays {
  npy_intp count;
  bool patch;
  Array<bool> colliding = make<bool>({count});
  Array<double> separation = make<double>({count}), normal = make<double>({count, 3});
  Array<double> point = make<double>({count, 3}), volume = make<double>({count});
  Array<double> covariance = patch ? make<double>({count, 3, 3}) : unknown_covariances();
  Array<int32_t> axis = make<int32_t>({count});

  detail::Results results(double margin) const {
    return {colliding.numbers,
            separation.numbers,
            normal.numbers,
            point.numbers,
            patch ? volume.numbers : nullptr,
            patch ? covariance.numbers : nullptr,
            axis.numbers,
            margin};
  }
  PyObject* release(PyTypeObject* type) {
    // Without a patch, the volume of pairs in contact is unknown.
    for (npy_intp row = 0; !patch && row < count; ++row)
      volume.numbers[row] = colliding.numbers[row] ? unknown : 0.0;
    PyObject* const fields[] = {colliding.object.release(), separation.object.release(),
                                normal.object.release(),    point.object.release(),
                                volume.object.release(),    covariance.object.release(),
                                axis.object.release()};
    return new_tuple(type, fields);
  }

 private:
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  // One NaN, seen in all places: read-only.
  Array<double> unknown_covariances() const {
    npy_intp shape[] = {count, 3, 3}, steps[] = {0, 0, 0};
    return Array<double>(PyArray_New(&PyArray_Type, 3, shape, NPY_DOUBLE, steps,
                                     const_cast<double*>(&unknown), 0, NPY_ARRAY_ALIGNED, nullptr));
  }
};

}  // namespace box_contact::binding
