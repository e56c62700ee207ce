// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The forces of patches, as a Python type.
#pragma once

#include <string>
#include <vector>

#include "../include/box_contact/force.h"
#include "arrays.hpp"

namespace box_contact::binding {

struct DestroyForces {
  void operator()(bc_patch_forces* forces) const { bc_patch_forces_destroy(forces); }
};
using Forces = std::unique_ptr<bc_patch_forces, DestroyForces>;

inline bc_patch_forces* forces_of(PyObject* self) { return Holder<Forces>::of(self).get(); }
inline npy_intp body_count(PyObject* self) {
  return npy_intp(bc_patch_forces_bodies(forces_of(self)));
}

inline std::vector<bc_body> read_bodies(PyObject* masses, PyObject* inertias, PyObject* centres) {
  auto mass = read<double>(masses, "mass", {any_length});
  npy_intp count = mass.length(0);
  auto inertia = read<double>(inertias, "inertia", {count, 3});
  auto centre = read<double>(centres, "centre", {count, 3});
  std::vector<bc_body> bodies(size_t(count), bc_body{});
  for (npy_intp k = 0; k < count; ++k) {
    bc_body& body = bodies[size_t(k)];
    body.mass = mass.numbers[k];
    std::memcpy(body.inertia, inertia.numbers + 3 * k, sizeof body.inertia);
    std::memcpy(body.centre, centre.numbers + 3 * k, sizeof body.centre);
  }
  return bodies;
}

inline PyObject* forces_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *masses, *inertias, *centres;
  bc_force_options options = BC_DEFAULT_FORCE_OPTIONS;
  if (!PyArg_ParseTuple(args, "OOOiiddp:PatchForces", &masses, &inertias, &centres,
                        &options.substeps, &options.threads, &options.friction,
                        &options.most_depth, &options.rest))
    return nullptr;
  std::vector<bc_body> bodies = read_bodies(masses, inertias, centres);
  bc_patch_forces* forces;
  check(bc_patch_forces_create(bodies.data(), int64_t(bodies.size()), &options, &forces));
  return Holder<Forces>::make(type, Forces(forces));
}

inline PyObject* forces_set_bodies(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "set_bodies(mass, inertia, centre)");
  std::vector<bc_body> bodies = read_bodies(args[0], args[1], args[2]);
  check(bc_patch_forces_set_bodies(forces_of(self), bodies.data(), int64_t(bodies.size())));
  Py_RETURN_NONE;
}

// Arguments of `hold` and `advance` are plain arrays, or Python converts them before it calls. No code of
// Python's runs between the count of bodies and the use of the arrays: it could change the bodies.

// The array of a row for each body or contact, if any.
template <class Number>
void check_rows(const Array<Number>& given, const char* name, Shape shape) {
  if (given.object) check_shape(given, name, shape);
}

inline PyObject* forces_hold(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 11)
    fail(PyExc_TypeError,
         "hold(pairs, separation, normal, point, volume, covariance, poses, friction, surface, age, "
         "period)");
  double age = PyFloat_AsDouble(args[9]), period = PyFloat_AsDouble(args[10]);
  if (PyErr_Occurred()) return nullptr;
  Array<int64_t> pairs;
  Array<double> separation, normal, point, volume, covariance, poses, friction, surface;
  if (!read_plain(args[0], pairs) || !pairs.object) Py_RETURN_FALSE;
  Array<double>* columns[] = {&separation, &normal,   &point,   &volume,   &covariance,
                              &poses,      &friction, &surface};
  for (int k = 0; k < 8; ++k)
    if (!read_plain(args[1 + k], *columns[k]) || (k < 6 && !columns[k]->object)) Py_RETURN_FALSE;
  check_shape(pairs, "pairs", {any_length, 2});
  npy_intp n = pairs.length(0);
  check_rows(separation, "separation", {n});
  check_rows(normal, "normal", {n, 3});
  check_rows(point, "point", {n, 3});
  check_rows(volume, "volume", {n});
  check_rows(covariance, "covariance", {n, 3, 3});
  check_rows(poses, "poses", {body_count(self), 7});
  check_rows(friction, "friction", {n});
  check_rows(surface, "surface_velocity", {n, 3});
  bc_patches answer{sizeof(bc_patches), int64_t(n),       pairs.numbers,  separation.numbers,
                    normal.numbers,     point.numbers,    volume.numbers, covariance.numbers,
                    friction.numbers,   surface.numbers,  age,            period};
  check(bc_patch_forces_hold(forces_of(self), &answer,
                             reinterpret_cast<const bc_pose*>(poses.numbers)));
  Py_RETURN_TRUE;
}

inline PyObject* forces_hold_pairs(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "hold_pairs(pairs, friction, surface)");
  auto pairs = read<int64_t>(args[0], "pairs", {any_length, 2});
  npy_intp n = pairs.length(0);
  auto friction = read_given<double>(args[1], "friction", {n});
  auto surface = read_given<double>(args[2], "surface_velocity", {n, 3});
  bc_patches asked{};
  asked.size = sizeof asked;
  asked.count = int64_t(n);
  asked.pairs = pairs.numbers;
  asked.friction = friction.numbers;
  asked.surface = surface.numbers;
  check(bc_patch_forces_hold(forces_of(self), &asked, nullptr));
  Py_RETURN_NONE;
}

inline PyObject* forces_set_boxes(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) fail(PyExc_TypeError, "set_boxes(sizes, body, poses, find_pairs)");
  auto sizes = read<double>(args[0], "sizes", {any_length, 3});
  npy_intp n = sizes.length(0);
  auto body = read_given<int64_t>(args[1], "body", {n});
  auto poses = read_given<double>(args[2], "poses", {n, 7});
  std::vector<bc_body_box> boxes(size_t(n), bc_body_box{0, {{{0, 0, 0}, {0, 0, 0, 1}}, {}}});
  for (npy_intp k = 0; k < n; ++k) {
    bc_body_box& box = boxes[size_t(k)];
    box.body = body.object ? body.numbers[k] : int64_t(k);
    std::memcpy(&box.box.size, sizes.numbers + 3 * k, sizeof box.box.size);
    if (poses.object) std::memcpy(&box.box.pose, poses.numbers + 7 * k, sizeof box.box.pose);
  }
  int find_pairs = PyObject_IsTrue(args[3]);
  if (find_pairs < 0) return nullptr;
  check(bc_patch_forces_set_boxes(forces_of(self), boxes.data(), int64_t(n), find_pairs));
  Py_RETURN_NONE;
}

inline PyObject* forces_set_surface(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "set_surface(box, velocity, friction)");
  long long box = PyLong_AsLongLong(args[0]);
  if (box == -1 && PyErr_Occurred()) return nullptr;
  auto velocity = read_given<double>(args[1], "velocity", {3});
  double friction = args[2] == Py_None ? 0.0 : PyFloat_AsDouble(args[2]);
  if (PyErr_Occurred()) return nullptr;
  check(bc_patch_forces_set_surface(forces_of(self), box, velocity.numbers,
                                    args[2] == Py_None ? nullptr : &friction));
  Py_RETURN_NONE;
}

// An array of the numbers of structs.
template <class Struct>
Struct* rows_of(const Array<double>& array) {
  return reinterpret_cast<Struct*>(array.numbers);
}

// An array that is written, or None.
template <class Number>
Array<Number> read_written(PyObject* given, const char* name, Shape shape) {
  Array<Number> array;
  bool is_plain = read_plain(given, array);
  if (!is_plain || (array.object && !PyArray_ISWRITEABLE(reinterpret_cast<PyArrayObject*>(given)))) {
    std::string text = std::string(name) + " must be a plain array that can be written";
    fail(PyExc_ValueError, text.c_str());
  }
  check_rows(array, name, shape);
  return array;
}

// `advance` and, for callers who move the bodies by themselves, `wrenches`.
template <bool by_wrenches>
inline PyObject* forces_advance(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 6) fail(PyExc_TypeError, "(dt, poses, velocities, outside, changed, out)");
  double dt = PyFloat_AsDouble(args[0]);
  if (PyErr_Occurred()) return nullptr;
  Array<double> poses, velocities, outside;
  auto changed = read_given<int64_t>(args[4], "changed", {any_length});
  if (!read_plain(args[1], poses) || !read_plain(args[2], velocities) ||
      !read_plain(args[3], outside) || !poses.object || !velocities.object)
    Py_RETURN_NONE;
  npy_intp bodies = body_count(self);
  check_rows(poses, "poses", {bodies, 7});
  check_rows(velocities, "velocities", {bodies, 6});
  check_rows(outside, "wrenches", {bodies, 6});
  Array<double> moved, after, wrenches;
  Array<bool> awake;
  bool is_given = args[5] != Py_None;
  if (is_given) {
    if (!PyTuple_Check(args[5]) || PyTuple_GET_SIZE(args[5]) != 4)
      fail(PyExc_TypeError, "out: four arrays");
    auto given = [&](Py_ssize_t place) { return PyTuple_GET_ITEM(args[5], place); };
    moved = read_written<double>(given(0), "out[0]", {bodies, 7});
    after = read_written<double>(given(1), "out[1]", {bodies, 6});
    wrenches = read_written<double>(given(2), "out[2]", {bodies, 6});
    awake = read_written<bool>(given(3), "out[3]", {bodies});
  } else {
    wrenches = make<double>({bodies, 6});
    if (!by_wrenches)
      moved = make<double>({bodies, 7}), after = make<double>({bodies, 6}), awake = make<bool>({bodies});
  }
  bc_motion motion{sizeof(bc_motion), rows_of<bc_pose>(moved), rows_of<bc_velocity>(after),
                   rows_of<bc_wrench>(wrenches),
                   reinterpret_cast<unsigned char*>(awake.numbers)};
  auto advance = [&](const auto& call, auto... named) {
    check(call(forces_of(self), dt, rows_of<bc_pose>(poses), rows_of<bc_velocity>(velocities),
               rows_of<bc_wrench>(outside), named..., &motion));
  };
  if (changed.object)
    advance(bc_patch_forces_advance_changed, changed.numbers, int64_t(changed.length(0)));
  else
    advance(bc_patch_forces_advance);
  if (by_wrenches) return wrenches.object.release();
  if (is_given) return Py_NewRef(args[5]);
  return pack(&PyTuple_Type, moved, after, wrenches, awake);
}

inline PyObject* forces_ahead(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 3) fail(PyExc_TypeError, "ahead(dt, poses, velocities)");
  double dt = PyFloat_AsDouble(args[0]);
  if (PyErr_Occurred()) return nullptr;
  npy_intp bodies = body_count(self);
  auto poses = read<double>(args[1], "poses", {bodies, 7});
  auto velocities = read<double>(args[2], "velocities", {bodies, 6});
  auto ahead = make<double>({bodies, 7});
  check(bc_patch_forces_ahead(forces_of(self), dt, rows_of<bc_pose>(poses),
                              rows_of<bc_velocity>(velocities), rows_of<bc_pose>(ahead)));
  return ahead.object.release();
}

inline PyObject* forces_loads(PyObject* self, PyObject*) {
  std::vector<bc_load> loads(size_t(bc_patch_forces_loads(forces_of(self), nullptr, 0)));
  auto n = npy_intp(loads.size());
  bc_patch_forces_loads(forces_of(self), loads.data(), int64_t(n));
  auto pairs = make<int64_t>({n, 2});
  auto pressing = make<double>({n}), friction = make<double>({n, 3}), torsion = make<double>({n});
  auto centre = make<double>({n, 3}), corners = make<double>({n, 4, 3});
  auto corner_loads = make<double>({n, 4});
  auto too_deep = make<bool>({n});
  for (npy_intp k = 0; k < n; ++k) {
    const bc_load& load = loads[size_t(k)];
    pairs.numbers[2 * k] = load.box_a;
    pairs.numbers[2 * k + 1] = load.box_b;
    pressing.numbers[k] = load.pressing;
    torsion.numbers[k] = load.torsion;
    std::memcpy(friction.numbers + 3 * k, load.friction, sizeof load.friction);
    std::memcpy(centre.numbers + 3 * k, load.centre, sizeof load.centre);
    std::memcpy(corners.numbers + 12 * k, load.corners, sizeof load.corners);
    std::memcpy(corner_loads.numbers + 4 * k, load.corner_loads, sizeof load.corner_loads);
    too_deep.numbers[k] = load.is_too_deep != 0;
  }
  return pack(&PyTuple_Type, pairs, pressing, friction, torsion, centre, corners, corner_loads,
              too_deep);
}

inline PyObject* forces_forget(PyObject* self, PyObject* bodies) {
  auto places = read<int64_t>(bodies, "bodies", {any_length});
  check(bc_patch_forces_forget(forces_of(self), places.numbers, places.length(0)));
  Py_RETURN_NONE;
}

inline PyObject* forces_reset(PyObject* self, PyObject*) {
  bc_patch_forces_reset(forces_of(self));
  Py_RETURN_NONE;
}

inline PyObject* forces_copy(PyObject* self, PyObject*) {
  bc_patch_forces* copy;
  check(bc_patch_forces_copy(forces_of(self), &copy));
  return Holder<Forces>::make(Py_TYPE(self), Forces(copy));
}

inline PyMethodDef forces_methods[] = {
    {"set_bodies", method<forces_set_bodies>(), METH_FASTCALL,
     "set_bodies(mass, inertia, centre)\n--\n\nChange the bodies: (n,), (n, 3), (n, 3)."},
    {"hold", method<forces_hold>(), METH_FASTCALL,
     "hold(pairs, separation, normal, point, volume, covariance, poses, friction, surface, age, "
     "period)\n--\n\nTake the arrays of an answer; None for friction and surface.\n\n"
     "Return False, and change nothing, where one is no plain array."},
    {"hold_pairs", method<forces_hold_pairs>(), METH_FASTCALL,
     "hold_pairs(pairs, friction, surface)\n--\n\nTake pairs whose contacts are solved at each advance; "
     "None for the last two."},
    {"set_boxes", method<forces_set_boxes>(), METH_FASTCALL,
     "set_boxes(sizes, body, poses, find_pairs)\n--\n\nChange the boxes: (m, 3), (m,), (m, 7), bool; None "
     "for body and poses."},
    {"set_surface", method<forces_set_surface>(), METH_FASTCALL,
     "set_surface(box, velocity, friction)\n--\n\nSet the surface of a box: (3,), and a number; None: as "
     "before."},
    {"wrenches", method<forces_advance<true>>(), METH_FASTCALL,
     "wrenches(dt, poses, velocities, outside, changed, out)\n--\n\nReturn wrenches (n, 6), which move the bodies "
     "until the next call.\n\nReturn None, and change nothing, where one is no plain array."},
    {"advance", method<forces_advance<false>>(), METH_FASTCALL,
     "advance(dt, poses, velocities, outside, changed, out)\n--\n\nReturn poses (n, 7), velocities and "
     "wrenches (n, 6), and who is awake (n,): those of a tuple, if one is given.\n\nReturn None, and change nothing, where one is no plain array."},
    {"ahead", method<forces_ahead>(), METH_FASTCALL,
     "ahead(dt, poses, velocities)\n--\n\nReturn the poses (n, 7) at which to take forces that depend on "
     "poses."},
    {"loads", method<forces_loads>(), METH_NOARGS,
     "loads()\n--\n\nReturn the columns of what each pair carried."},
    {"forget", method<forces_forget>(), METH_O,
     "forget(bodies)\n--\n\nForget the patches of bodies (k,)."},
    {"reset", method<forces_reset>(), METH_NOARGS, "reset()\n--\n\nForget all patches."},
    {"copy", method<forces_copy>(), METH_NOARGS,
     "copy()\n--\n\nReturn forces with the same bodies, patches and impulses."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot forces_slots[] = {
    {Py_tp_doc, const_cast<char*>("PatchForces(mass, inertia, centre, substeps, threads, "
                                  "friction, most_depth, rest)\n--\n\nPatches as velocity constraints. See force.h.")},
    {Py_tp_new, slot<forces_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<Forces>::dealloc)},
    {Py_tp_methods, forces_methods},
    {0, nullptr}};
inline PyType_Spec forces_spec = {"box_contact_ros.core._native.PatchForces", sizeof(Holder<Forces>),
                                  0, Py_TPFLAGS_DEFAULT, forces_slots};

}  // namespace box_contact::binding
