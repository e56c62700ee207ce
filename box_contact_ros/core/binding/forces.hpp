// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The forces of patches, as a Python type.
#pragma once

#include <vector>

#include "../include/box_contact/force.h"
#include "arrays.hpp"

namespace box_contact::binding {

struct ForcesObject {
  PyObject_HEAD bc_patch_forces* forces;
};

inline PyObject* refused(bc_status status) {
  return fail(status == BC_NO_MEMORY ? PyExc_MemoryError : PyExc_ValueError, bc_error_text());
}

inline ForcesObject* forces_of(PyObject* object) { return reinterpret_cast<ForcesObject*>(object); }
inline npy_intp body_count(PyObject* self) {
  return npy_intp(bc_patch_forces_bodies(forces_of(self)->forces));
}

inline void forces_dealloc(PyObject* self) {
  bc_patch_forces_destroy(forces_of(self)->forces);
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

inline bool read_bodies(PyObject* masses, PyObject* inertias, PyObject* centres,
                        std::vector<bc_body>& bodies) {
  Array<double> mass, inertia, centre;
  if (!read(masses, "mass", {any_length}, mass)) return false;
  npy_intp count = mass.length(0);
  if (!read(inertias, "inertia", {count, 3}, inertia) ||
      !read(centres, "centre", {count, 3}, centre))
    return false;
  bodies.assign(size_t(count), bc_body{});
  for (npy_intp k = 0; k < count; ++k) {
    bc_body& body = bodies[size_t(k)];
    body.mass = mass.numbers[k];
    std::memcpy(body.inertia, inertia.numbers + 3 * k, sizeof body.inertia);
    std::memcpy(body.centre, centre.numbers + 3 * k, sizeof body.centre);
  }
  return true;
}

inline PyObject* wrap_forces(PyTypeObject* type, bc_patch_forces* forces) {
  PyObject* self = type->tp_alloc(type, 0);
  if (!self) return bc_patch_forces_destroy(forces), nullptr;
  forces_of(self)->forces = forces;
  return self;
}

inline PyObject* forces_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *masses, *inertias, *centres;
  bc_force_options options = BC_DEFAULT_FORCE_OPTIONS;
  std::vector<bc_body> bodies;
  if (!PyArg_ParseTuple(args, "OOOiid:PatchForces", &masses, &inertias, &centres,
                        &options.iterations, &options.relaxations, &options.friction) ||
      !read_bodies(masses, inertias, centres, bodies))
    return nullptr;
  bc_patch_forces* forces;
  if (bc_status status =
          bc_patch_forces_create(bodies.data(), int64_t(bodies.size()), &options, &forces))
    return refused(status);
  return wrap_forces(type, forces);
}

inline PyObject* forces_set_bodies(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  std::vector<bc_body> bodies;
  if (count != 3) return fail(PyExc_TypeError, "set_bodies(mass, inertia, centre)");
  if (!read_bodies(args[0], args[1], args[2], bodies)) return nullptr;
  if (bc_status status = bc_patch_forces_set_bodies(forces_of(self)->forces, bodies.data(),
                                                    int64_t(bodies.size())))
    return refused(status);
  Py_RETURN_NONE;
}

// An array of numbers of each pair, or None.
inline bool read_given(PyObject* argument, const char* name, Shape shape, Array<double>& array) {
  return argument == Py_None || read(argument, name, shape, array);
}

inline PyObject* forces_hold(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 12)
    return fail(PyExc_TypeError,
                "hold(pairs, separation, normal, point, volume, covariance, poses, friction, "
                "surface, stiffness, age, period)");
  double age = PyFloat_AsDouble(args[10]), period = PyFloat_AsDouble(args[11]);
  if (PyErr_Occurred()) return nullptr;
  Array<int64_t> pairs;
  if (!read(args[0], "pairs", {any_length, 2}, pairs)) return nullptr;
  npy_intp n = pairs.length(0);
  Array<double> separation, normal, point, volume, covariance, poses, friction, surface, stiffness;
  if (!read(args[1], "separation", {n}, separation) || !read(args[2], "normal", {n, 3}, normal) ||
      !read(args[3], "point", {n, 3}, point) || !read(args[4], "volume", {n}, volume) ||
      !read(args[5], "covariance", {n, 3, 3}, covariance) ||
      !read(args[6], "poses", {body_count(self), 7}, poses) ||
      !read_given(args[7], "friction", {n}, friction) ||
      !read_given(args[8], "surface_velocity", {n, 3}, surface) ||
      !read_given(args[9], "stiffness", {n}, stiffness))
    return nullptr;
  bc_patches answer{sizeof(bc_patches), int64_t(n),       pairs.numbers,  separation.numbers,
                    normal.numbers,     point.numbers,    volume.numbers, covariance.numbers,
                    friction.numbers,   surface.numbers,  stiffness.numbers, age,
                    period};
  if (bc_status status =
          bc_patch_forces_hold(forces_of(self)->forces, &answer,
                               reinterpret_cast<const bc_pose*>(poses.numbers)))
    return refused(status);
  Py_RETURN_NONE;
}

inline PyObject* forces_step(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 5) return fail(PyExc_TypeError, "step(dt, poses, velocities, outside, as_wrenches)");
  double dt = PyFloat_AsDouble(args[0]);
  int as_wrenches = PyObject_IsTrue(args[4]);
  if (PyErr_Occurred()) return nullptr;
  npy_intp bodies = body_count(self);
  Array<double> poses, velocities, outside, found;
  if (!read(args[1], "poses", {bodies, 7}, poses) ||
      !read(args[2], "velocities", {bodies, 6}, velocities) ||
      !read_given(args[3], "wrenches", {bodies, 6}, outside) || !make({bodies, 6}, found))
    return nullptr;
  if (bc_status status = bc_patch_forces_step(
          forces_of(self)->forces, dt, reinterpret_cast<const bc_pose*>(poses.numbers),
          reinterpret_cast<const bc_velocity*>(velocities.numbers),
          reinterpret_cast<const bc_wrench*>(outside.numbers),
          as_wrenches ? nullptr : reinterpret_cast<bc_velocity*>(found.numbers),
          as_wrenches ? reinterpret_cast<bc_wrench*>(found.numbers) : nullptr))
    return refused(status);
  return found.object.release();
}

inline PyObject* forces_forget(PyObject* self, PyObject* body) {
  long long place = PyLong_AsLongLong(body);
  if (PyErr_Occurred()) return nullptr;
  if (bc_status status = bc_patch_forces_forget(forces_of(self)->forces, place))
    return refused(status);
  Py_RETURN_NONE;
}

inline PyObject* forces_reset(PyObject* self, PyObject*) {
  bc_patch_forces_reset(forces_of(self)->forces);
  Py_RETURN_NONE;
}

inline PyObject* forces_save(PyObject* self, PyObject*) {
  const bc_patch_forces* forces = forces_of(self)->forces;
  int64_t size = bc_patch_forces_save(forces, nullptr, 0);
  PyObject* bytes = PyBytes_FromStringAndSize(nullptr, Py_ssize_t(size));
  if (bytes) bc_patch_forces_save(forces, PyBytes_AS_STRING(bytes), size);
  return bytes;
}

inline PyObject* forces_load(PyObject* type, PyObject* bytes) {
  char* data;
  Py_ssize_t size;
  if (PyBytes_AsStringAndSize(bytes, &data, &size) < 0) return nullptr;
  bc_patch_forces* forces;
  if (bc_status status = bc_patch_forces_load(data, int64_t(size), &forces)) return refused(status);
  return wrap_forces(reinterpret_cast<PyTypeObject*>(type), forces);
}

inline PyMethodDef forces_methods[] = {
    {"set_bodies", method<forces_set_bodies>(), METH_FASTCALL,
     "set_bodies(mass, inertia, centre)\n--\n\nChange the bodies: (n,), (n, 3), (n, 3)."},
    {"hold", method<forces_hold>(), METH_FASTCALL,
     "hold(pairs, separation, normal, point, volume, covariance, poses, friction, surface, "
     "stiffness)\n--\n\nTake the arrays of an answer; None for the last three."},
    {"step", method<forces_step>(), METH_FASTCALL,
     "step(dt, poses, velocities, outside, as_wrenches)\n--\n\nReturn velocities or wrenches (n, "
     "6)."},
    {"forget", method<forces_forget>(), METH_O, "forget(body)\n--\n\nForget a body's patches."},
    {"reset", method<forces_reset>(), METH_NOARGS, "reset()\n--\n\nForget all patches."},
    {"save", method<forces_save>(), METH_NOARGS, "save()\n--\n\nReturn the state as bytes."},
    {"load", method<forces_load>(), METH_O | METH_CLASS, "load(bytes)\n--\n\nReturn forces of saved bytes."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot forces_slots[] = {
    {Py_tp_doc, const_cast<char*>("PatchForces(mass, inertia, centre, iterations, relaxations, "
                                  "friction)\n--\n\nPatches as velocity constraints. See force.h.")},
    {Py_tp_new, slot<forces_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(forces_dealloc)},
    {Py_tp_methods, forces_methods},
    {0, nullptr}};
inline PyType_Spec forces_spec = {"box_contact_ros.core._native.PatchForces", sizeof(ForcesObject),
                                  0, Py_TPFLAGS_DEFAULT, forces_slots};

}  // namespace box_contact::binding
