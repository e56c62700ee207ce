// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The broad phase as a Python type.
#pragma once

#include <algorithm>

#include "../include/box_contact/broad_phase.h"
#include "arrays.hpp"

namespace box_contact::binding {

struct DestroyBroadPhase {
  void operator()(bc_broad_phase* made) const { bc_broad_phase_destroy(made); }
};
struct BroadPhase {
  std::unique_ptr<bc_broad_phase, DestroyBroadPhase> made;
  npy_intp count;  // of boxes
};

inline PyObject* broad_phase_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *sizes_given, *fixed_given, *listed_given, *groups_given, *allowed_given, *bodies_given;
  bc_boxes boxes{};
  if (!PyArg_ParseTuple(args, "OOdOOOO:BroadPhase", &sizes_given, &fixed_given, &boxes.margin,
                        &listed_given, &groups_given, &allowed_given, &bodies_given))
    return nullptr;
  auto sizes = read<double>(sizes_given, "sizes", {any_length, 3});
  npy_intp count = sizes.length(0);
  auto fixed = read<uint8_t>(fixed_given, "fixed", {count});
  auto listed = read<int64_t>(listed_given, "listed", {any_length, 2});
  auto groups = read<int32_t>(groups_given, "groups", {count});
  auto allowed = read<uint8_t>(allowed_given, "allowed", {any_length, any_length});
  auto bodies = read<int32_t>(bodies_given, "bodies", {count});
  npy_intp group_count = allowed.length(0);
  if (allowed.length(1) != group_count || group_count > count)
    fail(PyExc_ValueError, "allowed must be square, and of no more groups than boxes");
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
  boxes.bodies = bodies.numbers;
  bc_broad_phase* made;
  check(bc_broad_phase_create(&boxes, &made));
  return Holder<BroadPhase>::make(type, {decltype(BroadPhase::made)(made), count});
}

inline Array<int64_t> array_of_pairs(const int64_t* pairs, int64_t count) {
  auto array = make<int64_t>({npy_intp(count), 2});
  std::copy_n(pairs, 2 * count, array.numbers);
  return array;
}

inline PyObject* broad_phase_find(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) fail(PyExc_TypeError, "find(poses, most)");
  const BroadPhase& phase = Holder<BroadPhase>::of(self);
  auto poses = read<double>(args[0], "poses", {phase.count, 7});
  long most = whole_of(args[1]);
  bc_near near{};
  near.size = sizeof near;
  near.refused = -1;
  bc_status status = bc_broad_phase_find(
      phase.made.get(), reinterpret_cast<const bc_pose*>(poses.numbers), most, &near);
  if (near.refused < 0 || status == BC_NO_MEMORY) check(status);
  auto pairs = array_of_pairs(near.pairs, near.count);
  auto stale = array_of_pairs(near.stale, near.stale_count);
  return Py_BuildValue("(NNL)", pairs.object.release(), stale.object.release(),
                       (long long)near.refused);
}

inline PyObject* broad_phase_resize(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) fail(PyExc_TypeError, "resize(boxes, sizes)");
  auto boxes = read<int64_t>(args[0], "boxes", {any_length});
  auto sizes = read<double>(args[1], "sizes", {boxes.length(0), 3});
  const BroadPhase& phase = Holder<BroadPhase>::of(self);
  for (npy_intp k = 0; k < boxes.length(0); ++k)
    check(bc_broad_phase_resize(phase.made.get(), boxes.numbers[k],
                                reinterpret_cast<const bc_size*>(sizes.numbers) + k));
  Py_RETURN_NONE;
}

inline PyTypeObject* broad_phase_type = nullptr;

inline PyObject* broad_phase_take_fixed(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2 || !Py_IS_TYPE(args[0], broad_phase_type))
    fail(PyExc_TypeError, "take_fixed(former, kept)");
  const BroadPhase& phase = Holder<BroadPhase>::of(self);
  auto kept = read<int64_t>(args[1], "kept", {phase.count});
  check(bc_broad_phase_take_fixed(phase.made.get(), Holder<BroadPhase>::of(args[0]).made.get(),
                                  kept.numbers));
  Py_RETURN_NONE;
}

inline PyMethodDef broad_phase_methods[] = {
    {"take_fixed", method<broad_phase_take_fixed>(), METH_FASTCALL,
     "take_fixed(former, kept)\n--\n\n"
     "Take over what another one knows of fixed boxes; kept (n,): their indices there, or -1."},
    {"resize", method<broad_phase_resize>(), METH_FASTCALL,
     "resize(boxes, sizes)\n--\n\n"
     "Give boxes (n,) that move other sizes (n, 3) [m], from the next call on."},
    {"find", method<broad_phase_find>(), METH_FASTCALL,
     "find(poses, most)\n--\n\n"
     "Return the pairs (n, 2) that may touch, stale rows (m, 2), and a box of a bad pose or -1.\n\n"
     "poses (boxes, 7); seven NaN: the box is not there. Ends with more than `most` pairs."},
    {nullptr, nullptr, 0, nullptr}};

inline PyType_Slot broad_phase_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("BroadPhase(sizes, fixed, margin, listed, groups, allowed, bodies)\n--\n\n"
                       "Find the pairs of boxes that may touch; see broad_phase.h.\n\n"
                       "allowed of no groups: listed pairs alone.")},
    {Py_tp_new, slot<broad_phase_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<BroadPhase>::dealloc)},
    {Py_tp_methods, broad_phase_methods},
    {0, nullptr}};

inline PyType_Spec broad_phase_spec = {"box_contact_ros.core._native.BroadPhase",
                                       sizeof(Holder<BroadPhase>), 0, Py_TPFLAGS_DEFAULT,
                                       broad_phase_slots};

}  // namespace box_contact::binding
