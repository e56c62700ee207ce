// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Filters, indices, movers and paths as Python types; see box_contact/index.h.
#pragma once

#include <algorithm>

#include "../include/box_contact/index.h"
#include "nearest.hpp"

namespace box_contact::binding {

template <class Made, void (*destroy)(Made*)>
struct Destroy {
  void operator()(Made* made) const { destroy(made); }
};
using Filter = std::unique_ptr<bc_filter, Destroy<bc_filter, bc_filter_destroy>>;
using Index = std::unique_ptr<bc_index, Destroy<bc_index, bc_index_destroy>>;
struct Movers {
  Owned filter, index;  // that it needs
  std::unique_ptr<bc_movers, Destroy<bc_movers, bc_movers_destroy>> made;
  npy_intp count;  // of boxes
};
struct Path {
  Owned filter, around, beside;
  std::unique_ptr<bc_path, Destroy<bc_path, bc_path_destroy>> made;
};
inline PyTypeObject *filter_type = nullptr, *index_type = nullptr, *movers_type = nullptr;

inline const bc_size* sizes_of(const Array<double>& sizes) {
  return reinterpret_cast<const bc_size*>(sizes.numbers);
}
inline const bc_pose* poses_of(const Array<double>& poses) {
  return reinterpret_cast<const bc_pose*>(poses.numbers);
}
// What a Python object holds, or nullptr of None.
template <class Made>
auto* held_or_null(PyObject* object, PyTypeObject* type, const char* name) {
  if (object != Py_None && !Py_IS_TYPE(object, type)) {
    PyErr_Format(PyExc_TypeError, "%s must be a %s or None", name, type->tp_name);
    throw PythonError{};
  }
  return object == Py_None ? nullptr : Holder<Made>::of(object).get();
}
// Rows of numbers of boxes that a call has found.
inline Array<int64_t> array_of_pairs(const int64_t* pairs, int64_t count) {
  auto array = make<int64_t>({npy_intp(count), 2});
  std::copy_n(pairs, 2 * count, array.numbers);
  return array;
}

// --- Filters --------------------------------------------------------------------------------------

inline PyObject* filter_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *listed_given, *groups_given, *allowed_given, *bodies_given, *order_given;
  if (!PyArg_ParseTuple(args, "OOOOO:Filter", &listed_given, &groups_given, &allowed_given,
                        &bodies_given, &order_given))
    return nullptr;
  auto groups = read<int32_t>(groups_given, "groups", {any_length});
  npy_intp count = groups.length(0);
  auto listed = read<int64_t>(listed_given, "listed", {any_length, 2});
  auto allowed = read<uint8_t>(allowed_given, "allowed", {any_length, any_length});
  auto bodies = read<int32_t>(bodies_given, "bodies", {count});
  auto order = read<int32_t>(order_given, "order", {count});
  if (allowed.length(1) != allowed.length(0)) fail(PyExc_ValueError, "allowed must be square");
  const bc_filter_rows rows{sizeof(bc_filter_rows), count, listed.numbers, listed.length(0),
                            groups.numbers, int32_t(allowed.length(0)), allowed.numbers,
                            bodies.numbers, order.numbers};
  bc_filter* made;
  check(bc_filter_create(&rows, &made));
  return Holder<Filter>::make(type, Filter(made));
}

inline PyObject* filter_sides(PyObject* self, PyObject* given) {
  auto pairs = read<int64_t>(given, "pairs", {any_length, 2});
  auto sides = make<uint8_t>({pairs.length(0)});
  check(bc_filter_sides(Holder<Filter>::of(self).get(), pairs.numbers, pairs.length(0),
                        sides.numbers));
  return sides.object.release();
}

inline PyMethodDef filter_methods[] = {
    {"sides", method<filter_sides>(), METH_O,
     "sides(pairs)\n--\n\n"
     "Return which box of pairs (n, 2) is A, (n,): 1: the first, 2: the other, 0: no pair.\n\n"
     "Numbers behind those of all boxes are guests, which meet everything."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot filter_slots[] = {
    {Py_tp_doc, const_cast<char*>("Filter(listed, groups, allowed, bodies, order)\n--\n\n"
                                  "Which pairs of boxes are asked for.\n\n"
                                  "listed (m, 2), groups (n,), allowed (g, g): bit 0: the first may "
                                  "be A; bit 1: the other;\nbodies (n,), order (n,).")},
    {Py_tp_new, slot<filter_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<Filter>::dealloc)},
    {Py_tp_methods, filter_methods},
    {0, nullptr}};
inline PyType_Spec filter_spec = {"box_contact_ros.core._native.Filter", sizeof(Holder<Filter>), 0,
                                  Py_TPFLAGS_DEFAULT, filter_slots};

// --- Indices --------------------------------------------------------------------------------------

inline PyObject* index_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *sizes_given, *poses_given, *former = Py_None, *kept_given = Py_None;
  if (!PyArg_ParseTuple(args, "OO|OO:Index", &sizes_given, &poses_given, &former, &kept_given))
    return nullptr;
  auto sizes = read<double>(sizes_given, "sizes", {any_length, 3});
  npy_intp count = sizes.length(0);
  auto poses = read<double>(poses_given, "poses", {count, 7});
  auto kept = read_given<int64_t>(kept_given, "kept", {count});
  const bc_index* before = held_or_null<Index>(former, index_type, "former");
  bc_index* made;
  check(before ? bc_index_change(before, kept.numbers, sizes_of(sizes), poses_of(poses), count, &made)
               : bc_index_create(sizes_of(sizes), poses_of(poses), count, &made));
  return Holder<Index>::make(type, Index(made));
}

inline PyObject* index_near(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 4) fail(PyExc_TypeError, "near(sizes, poses, margin, most)");
  auto sizes = read<double>(args[0], "sizes", {any_length, 3});
  auto poses = read<double>(args[1], "poses", {sizes.length(0), 7});
  double margin = number_of(args[2], "margin");
  int64_t most = whole_of(args[3]);
  int64_t room[128], capacity = 64, found = 0;
  std::unique_ptr<int64_t[]> more;
  auto search = [&](int64_t* pairs) {
    check(bc_index_near(Holder<Index>::of(self).get(), sizes_of(sizes), poses_of(poses),
                        sizes.length(0), margin, pairs, capacity, &found));
    return array_of_pairs(pairs, std::min(found, capacity));
  };
  auto pairs = search(room);
  while (found > capacity && capacity <= most) {
    capacity = std::min(8 * capacity, most + 1);
    more.reset(new int64_t[size_t(2 * capacity)]);
    pairs = search(more.get());
  }
  return pairs.object.release();
}

inline PyMethodDef index_methods[] = {
    {"near", method<index_near>(), METH_FASTCALL,
     "near(sizes, poses, margin, most)\n--\n\n"
     "Return the pairs (n, 2) of boxes and those of the index whose bounds are within a margin.\n\n"
     "sizes (k, 3), poses (k, 7). The search ends with more than `most` pairs."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot index_slots[] = {
    {Py_tp_doc, const_cast<char*>("Index(sizes, poses, former=None, kept=None)\n--\n\n"
                                  "Boxes that never move, by their numbers in arrays (n, 3), (n, 7).\n\n"
                                  "Seven NaN: a box is not in it. kept (n,): their numbers in `former`, "
                                  "or -1.")},
    {Py_tp_new, slot<index_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<Index>::dealloc)},
    {Py_tp_methods, index_methods},
    {0, nullptr}};
inline PyType_Spec index_spec = {"box_contact_ros.core._native.Index", sizeof(Holder<Index>), 0,
                                 Py_TPFLAGS_DEFAULT, index_slots};

// --- Movers ---------------------------------------------------------------------------------------

inline PyObject* movers_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *sizes_given, *filter, *index;
  double margin;
  if (!PyArg_ParseTuple(args, "OdOO:Movers", &sizes_given, &margin, &filter, &index)) return nullptr;
  auto sizes = read<double>(sizes_given, "sizes", {any_length, 3});
  bc_movers* made;
  check(bc_movers_create(sizes_of(sizes), sizes.length(0), margin,
                         held_or_null<Filter>(filter, filter_type, "filter"),
                         held_or_null<Index>(index, index_type, "index"), &made));
  Movers movers{Owned(Py_NewRef(filter)), Owned(Py_NewRef(index)),
                decltype(Movers::made)(made), sizes.length(0)};
  return Holder<Movers>::make(type, std::move(movers));
}

inline PyObject* movers_find(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) fail(PyExc_TypeError, "find(poses, most)");
  const Movers& movers = Holder<Movers>::of(self);
  auto poses = read<double>(args[0], "poses", {movers.count, 7});
  bc_near near{};
  near.size = sizeof near;
  near.refused = -1;
  bc_status status =
      bc_movers_find(movers.made.get(), poses_of(poses), whole_of(args[1]), &near);
  if (near.refused < 0 || status == BC_NO_MEMORY) check(status);
  auto pairs = array_of_pairs(near.pairs, near.count);
  auto stale = array_of_pairs(near.stale, near.stale_count);
  return Py_BuildValue("(NNL)", pairs.object.release(), stale.object.release(),
                       (long long)near.refused);
}

inline PyMethodDef movers_methods[] = {
    {"find", method<movers_find>(), METH_FASTCALL,
     "find(poses, most)\n--\n\n"
     "Return the pairs (n, 2) that may touch, stale rows (m, 2), and a box of a bad pose or -1.\n\n"
     "poses (boxes, 7); seven NaN: the box is not there. Ends with more than `most` pairs."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot movers_slots[] = {
    {Py_tp_doc, const_cast<char*>("Movers(sizes, margin, filter, index)\n--\n\n"
                                  "Find which boxes (n, 3) come near each other, or those of the index.")},
    {Py_tp_new, slot<movers_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<Movers>::dealloc)},
    {Py_tp_methods, movers_methods},
    {0, nullptr}};
inline PyType_Spec movers_spec = {"box_contact_ros.core._native.Movers", sizeof(Holder<Movers>), 0,
                                  Py_TPFLAGS_DEFAULT, movers_slots};

// --- Paths ----------------------------------------------------------------------------------------

inline PyObject* path_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject *sizes_given, *poses_given, *centres_given, *numbers_given, *around, *beside, *filter;
  bc_way way = bc_default_way();
  long long most_pairs, most_looks;
  if (!PyArg_ParseTuple(args, "OOOOOOOddLL:Path", &sizes_given, &poses_given, &centres_given,
                        &numbers_given, &around, &beside, &filter, &way.clearance, &way.tolerance,
                        &most_pairs, &most_looks))
    return nullptr;
  auto sizes = read<double>(sizes_given, "sizes", {any_length, 3});
  npy_intp count = sizes.length(0);
  auto poses = read<double>(poses_given, "poses", {any_length, count, 7});
  auto centres = read_given<double>(centres_given, "centres", {count, 3});
  auto numbers = read<int64_t>(numbers_given, "numbers", {count});
  way.times = poses.length(0), way.count = count;
  way.sizes = sizes_of(sizes), way.poses = poses_of(poses);
  way.centres = centres.numbers, way.numbers = numbers.numbers;
  way.around = held_or_null<Index>(around, index_type, "around");
  way.beside = held_or_null<Index>(beside, index_type, "beside");
  way.filter = held_or_null<Filter>(filter, filter_type, "filter");
  way.most_pairs = most_pairs, way.most_looks = most_looks;
  bc_path* made;
  check(bc_path_create(&way, &made));
  Path path{Owned(Py_NewRef(filter)), Owned(Py_NewRef(around)), Owned(Py_NewRef(beside)),
            decltype(Path::made)(made)};
  return Holder<Path>::make(type, std::move(path));
}

inline PyObject* path_advance(PyObject* self, PyObject* work) {
  bool is_done = false;
  // With Python's lock: another thread may have the same path.
  check(bc_path_advance(Holder<Path>::of(self).made.get(), whole_of(work), &is_done));
  return PyBool_FromLong(is_done);
}

// Pairs, and the numbers of their approaches.
inline PyObject* meetings(const bc_meeting* found, int64_t rows) {
  npy_intp count = npy_intp(rows);
  auto pairs = make<int64_t>({count, 2});
  auto time = make<double>({count}), closing_speed = make<double>({count});
  NearestArrays nearest{count};
  for (npy_intp k = 0; k < count; ++k) {
    const bc_nearest& one = found[k].approach.nearest;
    pairs.numbers[2 * k] = found[k].a, pairs.numbers[2 * k + 1] = found[k].b;
    time.numbers[k] = found[k].approach.time;
    closing_speed.numbers[k] = found[k].approach.closing_speed;
    nearest.colliding.numbers[k] = one.colliding;
    nearest.distance.numbers[k] = one.distance;
    std::copy_n(one.normal, 3, nearest.normal.numbers + 3 * k);
    std::copy_n(one.point_a, 3, nearest.point_a.numbers + 3 * k);
    std::copy_n(one.point_b, 3, nearest.point_b.numbers + 3 * k);
  }
  Owned rows_of_nearest(made(nearest.release()));
  return Py_BuildValue("(NNNN)", pairs.object.release(), time.object.release(),
                       closing_speed.object.release(), rows_of_nearest.release());
}

inline PyObject* path_found(PyObject* self, PyObject*) {
  bc_path_found found{};
  found.size = sizeof found;
  check(bc_path_read(Holder<Path>::of(self).made.get(), &found));
  Owned impacts(made(meetings(found.impacts, found.impact_count)));
  Owned least(made(meetings(found.least, found.least ? 1 : 0)));
  auto held = array_of_pairs(found.held, found.held_count);
  return Py_BuildValue("(NNN)", impacts.release(), held.object.release(), least.release());
}

inline PyMethodDef path_methods[] = {
    {"advance", method<path_advance>(), METH_O,
     "advance(work)\n--\n\nGo on by about so many looks of some microseconds; return whether all is done."},
    {"found", method<path_found>(), METH_NOARGS,
     "found()\n--\n\n"
     "Return impacts, the pairs (l, 2) within the clearance at first, and the least distance.\n\n"
     "First and last are pairs (n, 2), times (n,), closing speeds (n,) and Nearests (n,)."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot path_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("Path(sizes, poses, centres, numbers, around, beside, filter, clearance, "
                       "tolerance, most_pairs, most_looks)\n--\n\n"
                       "Boxes (n, 3) on a path of poses (m, n, 7), among those of one or two indices.")},
    {Py_tp_new, slot<path_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<Path>::dealloc)},
    {Py_tp_methods, path_methods},
    {0, nullptr}};
inline PyType_Spec path_spec = {"box_contact_ros.core._native.Path", sizeof(Holder<Path>), 0,
                                Py_TPFLAGS_DEFAULT, path_slots};

}  // namespace box_contact::binding
