// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// NumPy arrays as arguments and results of the extensions.
#pragma once

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#define NPY_NO_DEPRECATED_API NPY_1_20_API_VERSION
#include <numpy/arrayobject.h>

#include <cstdint>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <memory>
#include <new>
#include <type_traits>

#include "../src/lanes/vectors.hpp"

namespace box_contact::binding {

// An owned reference.
struct Release {
  void operator()(PyObject* object) const { Py_DECREF(object); }
};
using Owned = std::unique_ptr<PyObject, Release>;

template <class Number>
constexpr int numpy_type = std::is_same_v<Number, double>    ? NPY_DOUBLE
                           : std::is_same_v<Number, float>   ? NPY_FLOAT
                           : std::is_same_v<Number, int64_t> ? NPY_INT64
                           : std::is_same_v<Number, int32_t> ? NPY_INT32
                                                             : NPY_BOOL;

// An array of numbers in C order.
template <class Number>
struct Array {
  Owned object;
  Number* numbers = nullptr;

  void take(PyObject* array) {
    object.reset(array);
    if (array)
      numbers = static_cast<Number*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array)));
  }
  npy_intp length(int axis) const {
    return PyArray_DIM(reinterpret_cast<PyArrayObject*>(object.get()), axis);
  }
};

using Shape = std::initializer_list<npy_intp>;
constexpr npy_intp any_length = -1;

// Returns false with a Python error where the shape differs.
inline bool has_shape(PyArrayObject* given, const char* name, Shape shape) {
  bool fits = PyArray_NDIM(given) == int(shape.size());
  for (size_t axis = 0; fits && axis < shape.size(); ++axis) {
    npy_intp wanted = shape.begin()[axis];
    fits = wanted == any_length || wanted == PyArray_DIM(given, int(axis));
  }
  if (!fits) PyErr_Format(PyExc_ValueError, "%s has the wrong shape", name);
  return fits;
}

// Take an argument. Returns false with a Python error if its kind or shape differs. Booleans are read
// as `npy_bool`: NumPy's may be any byte, and C++ knows two.
template <class Number>
bool read(PyObject* argument, const char* name, Shape shape, Array<Number>& array) {
  static_assert(!std::is_same_v<Number, bool>);
  array.take(PyArray_FROM_OTF(argument, numpy_type<Number>, NPY_ARRAY_CARRAY_RO));
  return array.object &&
         has_shape(reinterpret_cast<PyArrayObject*>(array.object.get()), name, shape);
}

// Take a writable array in C order as it is. Returns false with a Python error for all others.
template <class Number>
bool read_in_place(PyObject* argument, const char* name, Shape shape, Array<Number>& array) {
  auto* given = reinterpret_cast<PyArrayObject*>(argument);
  if (!PyArray_Check(argument) || PyArray_TYPE(given) != numpy_type<Number> ||
      !PyArray_ISCARRAY(given)) {
    PyErr_Format(PyExc_TypeError, "%s is no array of the type that is written in place", name);
    return false;
  }
  array.take(Py_NewRef(argument));
  return has_shape(given, name, shape);
}

template <class Number>
bool make(Shape shape, Array<Number>& array) {
  array.take(PyArray_SimpleNew(int(shape.size()), const_cast<npy_intp*>(shape.begin()),
                               numpy_type<Number>));
  return bool(array.object);
}

inline Vec<double> vector_at(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }
inline Mat<double> matrix_at(const double* numbers) {
  Mat<double> m;
  std::memcpy(m.m, numbers, sizeof(m.m));
  return m;
}
inline void write(const Vec<double>& v, double* numbers) { std::memcpy(numbers, v.v, sizeof(v.v)); }
inline void write(const Mat<double>& m, double* numbers) { std::memcpy(numbers, m.m, sizeof(m.m)); }

inline PyObject* fail(PyObject* kind, const char* message) {
  PyErr_SetString(kind, message);
  return nullptr;
}

// A function as Python calls it: what it throws becomes a Python error.
template <auto function>
struct Guarded;
template <class Result, class... Arguments, Result (*function)(Arguments...)>
struct Guarded<function> {
  static Result call(Arguments... arguments) noexcept {
    try {
      return function(arguments...);
    } catch (const std::bad_alloc&) {
      PyErr_NoMemory();
    } catch (const std::exception& error) {
      PyErr_SetString(PyExc_RuntimeError, error.what());
    }
    if constexpr (std::is_pointer_v<Result>) {
      return nullptr;
    } else {
      return -1;
    }
  }
};

// An entry of a table of methods or slots. All entries that can fail go through it.
template <auto function>
PyCFunction method() {
  return reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(Guarded<function>::call));
}
template <auto function>
void* slot() {
  return reinterpret_cast<void*>(Guarded<function>::call);
}

// Call `work` without Python's lock. What it throws is thrown on, with the lock.
template <class Work>
auto without_lock(Work work) {
  struct Unlocked {
    PyThreadState* state = PyEval_SaveThread();
    ~Unlocked() { PyEval_RestoreThread(state); }
  } unlocked;
  return work();
}

}  // namespace box_contact::binding
