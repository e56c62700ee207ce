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
#include <utility>

#include "../include/box_contact/box_contact.h"
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
                           : std::is_same_v<Number, uint8_t> ? NPY_UINT8
                                                             : NPY_BOOL;

// Thrown once a Python error is set.
struct PythonError {};

[[noreturn]] inline void fail(PyObject* kind, const char* message) {
  PyErr_SetString(kind, message);
  throw PythonError{};
}
// What a function of Python's has made; nullptr is its error.
inline PyObject* made(PyObject* object) {
  return object ? object : throw PythonError{};
}
inline long whole_of(PyObject* number) {
  long value = PyLong_AsLong(number);
  return value == -1 && PyErr_Occurred() ? throw PythonError{} : value;
}
inline double number_of(PyObject* number, const char* name) {
  double value = PyFloat_AsDouble(number);
  if (value != -1.0 || !PyErr_Occurred()) return value;
  PyErr_Clear();
  PyErr_Format(PyExc_ValueError, "%s must be a number, not %.200R", name, number);
  throw PythonError{};
}
inline bool truth_of(PyObject* object) {
  int truth = PyObject_IsTrue(object);
  return truth < 0 ? throw PythonError{} : truth > 0;
}

// An array of numbers in C order, or none.
template <class Number>
struct Array {
  Owned object;
  Number* numbers = nullptr;

  Array() = default;
  explicit Array(PyObject* new_array)
      : object(made(new_array)), numbers(static_cast<Number*>(PyArray_DATA(array()))) {}

  PyArrayObject* array() const { return reinterpret_cast<PyArrayObject*>(object.get()); }
  npy_intp length(int axis) const { return PyArray_DIM(array(), axis); }
};

using Shape = std::initializer_list<npy_intp>;
constexpr npy_intp any_length = -1;

template <class Number>
void check_shape(const Array<Number>& given, const char* name, Shape shape) {
  bool fits = PyArray_NDIM(given.array()) == int(shape.size());
  for (size_t axis = 0; fits && axis < shape.size(); ++axis) {
    npy_intp wanted = shape.begin()[axis];
    fits = wanted == any_length || wanted == given.length(int(axis));
  }
  if (fits) return;
  Owned wanted(made(PyTuple_New(Py_ssize_t(shape.size()))));
  for (size_t axis = 0; axis < shape.size(); ++axis) {
    npy_intp length = shape.begin()[axis];
    PyTuple_SET_ITEM(
        wanted.get(), Py_ssize_t(axis),
        made(length == any_length ? PyUnicode_FromString("n") : PyLong_FromSsize_t(length)));
  }
  Owned found(made(PyObject_GetAttrString(given.object.get(), "shape")));
  PyErr_Format(PyExc_ValueError, "%s must be an array of shape %S, not %S", name, wanted.get(),
               found.get());
  throw PythonError{};
}

// Whether an object is an array of such numbers in C order, as it is read.
template <class Number>
bool is_plain(PyObject* object) {
  if (!PyArray_CheckExact(object)) return false;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  return PyArray_TYPE(array) == numpy_type<Number> && PyArray_ISCARRAY_RO(array);
}

// Take an argument. Booleans are read as `uint8_t`: NumPy's may be any byte, and C++ knows two.
template <class Number>
Array<Number> read(PyObject* argument, const char* name, Shape shape) {
  static_assert(!std::is_same_v<Number, bool>);
  PyObject* converted = is_plain<Number>(argument)  // NumPy takes five times as long to see it
                            ? Py_NewRef(argument)
                            : PyArray_FROM_OTF(argument, numpy_type<Number>, NPY_ARRAY_CARRAY_RO);
  if (!converted &&
      (PyErr_ExceptionMatches(PyExc_TypeError) || PyErr_ExceptionMatches(PyExc_ValueError))) {
    PyErr_Clear();  // NumPy's words have no name
    PyErr_Format(PyExc_ValueError, "%s must be an array of numbers, not %.200R", name, argument);
  }
  Array<Number> array(converted);
  check_shape(array, name, shape);
  return array;
}
// Take one that is such an array, or None, as it is: no code of Python's runs. Another kind of object
// gives false.
template <class Number>
bool read_plain(PyObject* argument, Array<Number>& array) {
  if (argument == Py_None) return true;
  if (!is_plain<Number>(argument)) return false;
  array = Array<Number>(Py_NewRef(argument));
  return true;
}
// The same, or None.
template <class Number>
Array<Number> read_given(PyObject* argument, const char* name, Shape shape) {
  return argument == Py_None ? Array<Number>() : read<Number>(argument, name, shape);
}

template <class Number>
Array<Number> make(Shape shape) {
  return Array<Number>(PyArray_SimpleNew(
      int(shape.size()), const_cast<npy_intp*>(shape.begin()), numpy_type<Number>));
}

// A tuple of arrays, or an object of a type that is one.
template <class... Arrays>
PyObject* pack(PyTypeObject* type, Arrays&... arrays) {
  PyObject* tuple = made(type->tp_alloc(type, sizeof...(arrays)));
  Py_ssize_t at = 0;
  (PyTuple_SET_ITEM(tuple, at++, arrays.object.release()), ...);
  return tuple;
}

inline void write(const Vec<double>& v, double* numbers) { std::memcpy(numbers, v.v, sizeof(v.v)); }
inline void write(const Mat<double>& m, double* numbers) { std::memcpy(numbers, m.m, sizeof(m.m)); }

// A function as Python calls it: what it throws becomes a Python error.
template <auto function>
struct Guarded;
template <class Result, class... Arguments, Result (*function)(Arguments...)>
struct Guarded<function> {
  static Result call(Arguments... arguments) noexcept {
    try {
      return function(arguments...);
    } catch (PythonError) {
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

// A Python object that holds a T.
template <class T>
struct Holder {
  PyObject_HEAD T held;

  static T& of(PyObject* object) { return reinterpret_cast<Holder*>(object)->held; }
  static PyObject* make(PyTypeObject* type, T&& value) {
    PyObject* self = made(type->tp_alloc(type, 0));
    new (&of(self)) T(std::move(value));
    return self;
  }
  static void dealloc(PyObject* self) {
    PyTypeObject* type = Py_TYPE(self);
    of(self).~T();
    type->tp_free(self);
    Py_DECREF(type);  // an object of a heap type keeps its type alive
  }
};

// An error of the library as Python's.
inline void check(bc_status status) {
  if (status != BC_OK)
    fail(status == BC_NO_MEMORY  ? PyExc_MemoryError
         : status == BC_TOO_MUCH ? PyExc_OverflowError
                                 : PyExc_ValueError,
         bc_error_text());
}

// What asks an answer for its truth is refused: boxes apart have one, too. The type is one of a package.
[[noreturn]] inline int refuse_truth(PyObject* self) {
  PyErr_Format(PyExc_TypeError, "%s has no truth value: ask .colliding",
               std::strrchr(Py_TYPE(self)->tp_name, '.') + 1);
  throw PythonError{};
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
