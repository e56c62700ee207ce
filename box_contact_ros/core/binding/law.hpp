// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The force law as a Python type.
#pragma once

#include <vector>

#include "../include/box_contact/force.h"
#include "arrays.hpp"

namespace box_contact::binding {

struct LawObject {
  PyObject_HEAD bc_law* law;
  npy_intp count;  // of bodies
};

inline LawObject* law_of(PyObject* object) { return reinterpret_cast<LawObject*>(object); }

inline PyObject* refused(bc_status status) {
  return fail(status == BC_NO_MEMORY ? PyExc_MemoryError : PyExc_ValueError, bc_error_text());
}

// `rows` rows of numbers, in any shape.
inline bool read_numbers(PyObject* argument, const char* name, npy_intp rows, npy_intp columns,
                         Array<double>& array) {
  array.take(PyArray_FROM_OTF(argument, NPY_DOUBLE, NPY_ARRAY_CARRAY_RO));
  if (!array.object) return false;
  npy_intp size = PyArray_SIZE(reinterpret_cast<PyArrayObject*>(array.object.get()));
  if (size == rows * columns) return true;
  PyErr_Format(PyExc_ValueError, "%s must have %zd x %zd numbers, not %zd", name, rows, columns,
               size);
  return false;
}

inline bool read_fixed(PyObject* argument, const char* name, npy_intp count, double* numbers) {
  Array<double> array;
  if (!read_numbers(argument, name, 1, count, array)) return false;
  std::memcpy(numbers, array.numbers, size_t(count) * sizeof(double));
  return true;
}

// A `Contact`: colliding, separation, normal, point, volume, covariance.
inline bool read_contact(PyObject* object, bc_contact& contact) {
  if (!PyTuple_Check(object) || PyTuple_GET_SIZE(object) < 6)
    return fail(PyExc_TypeError, "a Contact is needed");
  contact = {};
  int colliding = PyObject_IsTrue(PyTuple_GET_ITEM(object, 0));
  contact.separation = PyFloat_AsDouble(PyTuple_GET_ITEM(object, 1));
  contact.volume = PyFloat_AsDouble(PyTuple_GET_ITEM(object, 4));
  if (colliding < 0 || PyErr_Occurred()) return false;
  contact.colliding = colliding;
  if (!colliding) {
    contact.volume = 0.0;
    return true;
  }
  return read_fixed(PyTuple_GET_ITEM(object, 2), "normal", 3, contact.normal) &&
         read_fixed(PyTuple_GET_ITEM(object, 3), "point", 3, contact.point) &&
         read_fixed(PyTuple_GET_ITEM(object, 5), "covariance", 9, contact.covariance[0]);
}

inline void law_dealloc(PyObject* self) {
  bc_law_destroy(law_of(self)->law);
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

inline PyObject* law_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *masses, *inertias, *centres;
  bc_loop loop = BC_DEFAULT_LOOP;
  if (!PyArg_ParseTuple(args, "OOOddddd:Law", &masses, &inertias, &centres, &loop.rate,
                        &loop.latency, &loop.step, &loop.friction, &loop.gravity))
    return nullptr;
  Array<double> mass, inertia, centre;
  if (!read(masses, "mass", {any_length}, mass)) return nullptr;
  npy_intp count = mass.length(0);
  if (!read(inertias, "inertia", {count, 3}, inertia) ||
      !read(centres, "centre", {count, 3}, centre))
    return nullptr;
  std::vector<bc_body> bodies(static_cast<size_t>(count), bc_body{});
  for (npy_intp k = 0; k < count; ++k) {
    bc_body& body = bodies[size_t(k)];
    body.mass = mass.numbers[k];
    std::memcpy(body.inertia, inertia.numbers + 3 * k, sizeof body.inertia);
    std::memcpy(body.centre, centre.numbers + 3 * k, sizeof body.centre);
  }
  bc_law* law;
  if (bc_status status = bc_law_create(bodies.data(), count, &loop, &law)) return refused(status);
  PyObject* self = type->tp_alloc(type, 0);
  if (!self) return bc_law_destroy(law), nullptr;
  law_of(self)->law = law;
  law_of(self)->count = count;
  return self;
}

inline PyObject* law_hold(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) return fail(PyExc_TypeError, "hold(touches, poses)");
  Array<double> poses;
  if (!read_numbers(args[1], "poses", law_of(self)->count, 7, poses)) return nullptr;
  // A tuple of their own: numbers that are read may be objects whose code changes a list.
  Owned touches(PySequence_Tuple(args[0]));
  if (!touches) return nullptr;
  std::vector<bc_touch> read(size_t(PyTuple_GET_SIZE(touches.get())), bc_touch{});
  for (size_t k = 0; k < read.size(); ++k) {
    long long pair;
    int a, b;
    PyObject *item = PyTuple_GET_ITEM(touches.get(), Py_ssize_t(k)), *contact;
    if (!PyTuple_Check(item) || !PyArg_ParseTuple(item, "LiiO", &pair, &a, &b, &contact))
      return PyErr_Occurred() ? nullptr : fail(PyExc_TypeError, "a touch is (pair, a, b, contact)");
    read[k].pair = pair;
    read[k].a = a;
    read[k].b = b;
    read[k].stale = contact == Py_None;
    if (!read[k].stale && !read_contact(contact, read[k].contact)) return nullptr;
  }
  if (bc_status status = bc_law_hold(law_of(self)->law, read.data(), int64_t(read.size()),
                                     reinterpret_cast<const bc_pose*>(poses.numbers)))
    return refused(status);
  Py_RETURN_NONE;
}

inline PyObject* law_wrenches(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) return fail(PyExc_TypeError, "wrenches(poses, velocities)");
  Array<double> poses, velocities, found;
  npy_intp bodies = law_of(self)->count;
  if (!read_numbers(args[0], "poses", bodies, 7, poses) ||
      !read_numbers(args[1], "velocities", bodies, 6, velocities) || !make({bodies, 6}, found))
    return nullptr;
  if (bc_status status =
          bc_law_wrenches(law_of(self)->law, reinterpret_cast<const bc_pose*>(poses.numbers),
                          reinterpret_cast<const bc_velocity*>(velocities.numbers),
                          reinterpret_cast<bc_wrench*>(found.numbers)))
    return refused(status);
  return found.object.release();
}

inline PyObject* law_reset(PyObject* self, PyObject*) {
  bc_law_reset(law_of(self)->law);
  Py_RETURN_NONE;
}

inline PyObject* law_copy(PyObject* self, PyObject*) {
  bc_law* law;
  if (bc_status status = bc_law_copy(law_of(self)->law, &law)) return refused(status);
  PyTypeObject* type = Py_TYPE(self);
  PyObject* copy = type->tp_alloc(type, 0);
  if (!copy) return bc_law_destroy(law), nullptr;
  law_of(copy)->law = law;
  law_of(copy)->count = law_of(self)->count;
  return copy;
}

inline PyObject* law_frequency(PyObject* self, void*) {
  return PyFloat_FromDouble(bc_law_frequency(law_of(self)->law));
}

inline PyMethodDef law_methods[] = {
    {"hold", method<law_hold>(), METH_FASTCALL,
     "hold(touches, poses)\n--\n\nHold contacts: touches (pair, a, b, Contact), asked for at "
     "poses; None for a Contact keeps the patch of its pair."},
    {"wrenches", method<law_wrenches>(), METH_FASTCALL,
     "wrenches(poses, velocities)\n--\n\nReturn the wrenches (bodies, 6) at (bodies, 7), (bodies, "
     "6)."},
    {"reset", method<law_reset>(), METH_NOARGS, "reset()\n--\n\nForget all patches."},
    {"copy", method<law_copy>(), METH_NOARGS, "copy()\n--\n\nReturn a law with the same patches."},
    {nullptr, nullptr, 0, nullptr}};
inline PyGetSetDef law_attributes[] = {
    {"frequency", Guarded<law_frequency>::call, nullptr,
     "The greatest angular frequency on a patch [1/s].", nullptr},
    {nullptr, nullptr, nullptr, nullptr, nullptr}};
inline PyType_Slot law_slots[] = {
    {Py_tp_doc,
     const_cast<char*>(
         "Law(mass, inertia, centre, rate, latency, step, friction, gravity)\n--\n\n"
         "The force law of bodies: arrays (n,), (n, 3), (n, 3). See force.h.")},
    {Py_tp_new, slot<law_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(law_dealloc)},
    {Py_tp_methods, law_methods},
    {Py_tp_getset, law_attributes},
    {0, nullptr}};
inline PyType_Spec law_spec = {"box_contact_ros.core._native.Law", sizeof(LawObject), 0,
                               Py_TPFLAGS_DEFAULT, law_slots};

}  // namespace box_contact::binding
