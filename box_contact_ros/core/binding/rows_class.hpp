// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Answers as Python has them: arrays of numbers, and classes of arrays with a row for each pair.
#pragma once

#include <structmember.h>

#include <algorithm>
#include <cstddef>

#include "arrays.hpp"  // Python.h

namespace box_contact::binding {

// A new array of such lengths with these numbers.
template <class... Lengths>
PyObject* array_of(const double* numbers, Lengths... lengths) {
  auto array = make<double>({lengths...});
  std::copy_n(numbers, (lengths * ...), array.numbers);
  return array.object.release();
}

// A class of Python's whose objects have a slot for each of n arrays.
template <size_t n>
struct RowsClass {
  const char* fields[n];
  PyTypeObject* type = nullptr;
  Py_ssize_t places[n] = {};  // of the slots in an object

  PyObject* use(PyObject* given) {
    if (!PyType_Check(given)) fail(PyExc_TypeError, "a class is needed");
    for (size_t k = 0; k < n; ++k) {
      Owned slot(made(PyObject_GetAttrString(given, fields[k])));
      if (!Py_IS_TYPE(slot.get(), &PyMemberDescr_Type)) fail(PyExc_TypeError, "slots are needed");
      places[k] = reinterpret_cast<PyMemberDescrObject*>(slot.get())->d_member->offset;
    }
    Owned before(reinterpret_cast<PyObject*>(type));
    type = reinterpret_cast<PyTypeObject*>(Py_NewRef(given));
    Py_RETURN_NONE;
  }
  // An object of the class. Its own constructor would take as long as a small batch.
  template <class... Arrays>
  PyObject* make(Arrays&... arrays) const {
    static_assert(sizeof...(arrays) == n);
    if (!type) fail(PyExc_RuntimeError, "nobody has set the class of the answer");
    PyObject* rows = made(type->tp_alloc(type, 0));
    const Py_ssize_t* place = places;
    ((*reinterpret_cast<PyObject**>(reinterpret_cast<char*>(rows) + *place++) =
          arrays.object.release()),
     ...);
    return rows;
  }
};

}  // namespace box_contact::binding
