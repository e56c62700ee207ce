// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The broad phase as a Python type.
#pragma once

#include <algorithm>

#include "../include/box_contact/broad_phase.h"
#include "arrays.hpp"

namespace box_contact::binding {

struct BroadPhaseObject {
  PyObject_HEAD bc_broad_phase* broad_phase;
  npy_intp count;  // of boxes
};

inline BroadPhaseObject* broad_phase_of(PyObject* object) {
  return reinterpret_cast<BroadPhaseObject*>(object);
}

inline void broad_phase_dealloc(PyObject* self) {
  bc_broad_phase_destroy(broad_phase_of(self)->broad_phase);
  PyTypeObject* type = Py_TYPE(self);
  type->tp_free(self);
  Py_DECREF(type);
}

inline PyObject* broad_phase_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *sizes_given, *fixed_given, *listed_given, *groups_given, *allowed_given;
  bc_boxes boxes{};
  if (!PyArg_ParseTuple(args, "OOdOOO:BroadPhase", &sizes_given, &fixed_given, &boxes.margin,
                        &listed_given, &groups_given, &allowed_given))
    return nullptr;
  Array<double> sizes;
  Array<npy_bool> fixed, allowed;
  Array<int64_t> listed;
  Array<int32_t> groups;
  if (!read(sizes_given, "sizes", {any_length, 3}, sizes)) return nullptr;
  npy_intp count = sizes.length(0);
  if (!read(fixed_given, "fixed", {count}, fixed) ||
      !read(listed_given, "listed", {any_length, 2}, listed) ||
      !read(groups_given, "groups", {count}, groups))
    return nullptr;
  allowed.take(PyArray_FROM_OTF(allowed_given, NPY_UINT8, NPY_ARRAY_CARRAY_RO));
  if (!allowed.object ||
      !has_shape(reinterpret_cast<PyArrayObject*>(allowed.object.get()), "allowed",
                 {any_length, any_length}))
    return nullptr;
  npy_intp group_count = allowed.length(0);
  if (allowed.length(1) != group_count || group_count > count)
    return fail(PyExc_ValueError, "allowed must be square, and of no more groups than boxes");
  std::unique_ptr<bool[]> is_fixed(new bool[size_t(count) + 1]);
  for (npy_intp box = 0; box < count; ++box) is_fixed[size_t(box)] = fixed.numbers[box] != 0;
  boxes.size = sizeof boxes;
  boxes.count = count;
  boxes.sizes = reinterpret_cast<const bc_size*>(sizes.numbers);
  boxes.fixed = is_fixed.get();
  boxes.listed = listed.numbers;
  boxes.listed_count = listed.length(0);
  boxes.groups = group_count ? groups.numbers : nullptr;
  boxes.group_count = int32_t(group_count);
  boxes.allowed = allowed.numbers;
  bc_broad_phase* made;
  bc_status status = bc_broad_phase_create(&boxes, &made);
  if (status != BC_OK)
    return fail(status == BC_NO_MEMORY ? PyExc_MemoryError : PyExc_ValueError, bc_error_text());
  PyObject* self = type->tp_alloc(type, 0);
  if (!self) return bc_broad_phase_destroy(made), nullptr;
  broad_phase_of(self)->broad_phase = made;
  broad_phase_of(self)->count = count;
  return self;
}

inline PyObject* new_pairs(const int64_t* pairs, int64_t count) {
  Array<int64_t> array;
  if (!make({npy_intp(count), 2}, array)) return nullptr;
  std::copy_n(pairs, 2 * count, array.numbers);
  return array.object.release();
}

inline PyObject* broad_phase_find(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) return fail(PyExc_TypeError, "find(poses, most)");
  Array<double> poses;
  if (!read(args[0], "poses", {broad_phase_of(self)->count, 7}, poses)) return nullptr;
  long long most = PyLong_AsLongLong(args[1]);
  if (most == -1 && PyErr_Occurred()) return nullptr;
  bc_near near{};
  near.size = sizeof near;
  near.refused = -1;
  bc_status status =
      bc_broad_phase_find(broad_phase_of(self)->broad_phase,
                          reinterpret_cast<const bc_pose*>(poses.numbers), most, &near);
  if (status == BC_NO_MEMORY) return PyErr_NoMemory();
  if (status != BC_OK && near.refused < 0) return fail(PyExc_ValueError, bc_error_text());
  Owned pairs(new_pairs(near.pairs, near.count)), stale(new_pairs(near.stale, near.stale_count));
  if (!pairs || !stale) return nullptr;
  return Py_BuildValue("(NNL)", pairs.release(), stale.release(), (long long)near.refused);
}

inline PyMethodDef broad_phase_methods[] = {
    {"find", method<broad_phase_find>(), METH_FASTCALL,
     "find(poses, most)\n--\n\n"
     "Return the pairs (n, 2) that may touch, stale rows (m, 2), and a box of a bad pose or -1.\n\n"
     "poses (boxes, 7); seven NaN: the box is not there. Ends with more than `most` pairs."},
    {nullptr, nullptr, 0, nullptr}};

inline PyType_Slot broad_phase_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("BroadPhase(sizes, fixed, margin, listed, groups, allowed)\n--\n\n"
                       "Find the pairs of boxes that may touch; see broad_phase.h.\n\n"
                       "allowed of no groups: listed pairs alone.")},
    {Py_tp_new, slot<broad_phase_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(broad_phase_dealloc)},
    {Py_tp_methods, broad_phase_methods},
    {0, nullptr}};

inline PyType_Spec broad_phase_spec = {"box_contact_ros.core._native.BroadPhase",
                                       sizeof(BroadPhaseObject), 0, Py_TPFLAGS_DEFAULT,
                                       broad_phase_slots};

}  // namespace box_contact::binding
