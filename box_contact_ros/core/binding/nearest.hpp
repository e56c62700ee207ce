// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Nearest points as Python has them: an object for one pair, and one of arrays for many.
#pragma once

#include "../src/library/batch.hpp"
#include "pair_arrays.hpp"
#include "rows_class.hpp"

namespace box_contact::binding {

inline PyTypeObject* nearest_type = nullptr;

using Nearest = Holder<bc_nearest>;

inline PyObject* nearest_normal(PyObject* self, void*) {
  return array_of(Nearest::of(self).normal, 3);
}
inline PyObject* nearest_point_a(PyObject* self, void*) {
  return array_of(Nearest::of(self).point_a, 3);
}
inline PyObject* nearest_point_b(PyObject* self, void*) {
  return array_of(Nearest::of(self).point_b, 3);
}

inline PyObject* nearest_new(PyTypeObject* type, PyObject* args, PyObject* keywords) {
  PyObject *distance_given, *normal_given, *point_a_given, *point_b_given;
  int colliding;
  bc_nearest nearest{};
  static const char* names[] = {"colliding", "distance", "normal", "point_a", "point_b", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "pOOOO:Nearest", const_cast<char**>(names),
                                   &colliding, &distance_given, &normal_given, &point_a_given,
                                   &point_b_given))
    return nullptr;
  nearest.size = sizeof nearest;
  nearest.colliding = colliding != 0;
  nearest.distance = number_of(distance_given, "distance");
  auto normal = read<double>(normal_given, "normal", {3});
  auto point_a = read<double>(point_a_given, "point_a", {3});
  auto point_b = read<double>(point_b_given, "point_b", {3});
  std::copy_n(normal.numbers, 3, nearest.normal);
  std::copy_n(point_a.numbers, 3, nearest.point_a);
  std::copy_n(point_b.numbers, 3, nearest.point_b);
  return Nearest::make(type, std::move(nearest));
}

// The arguments that make the same object.
inline PyObject* nearest_fields(PyObject* self) {
  const bc_nearest& nearest = Nearest::of(self);
  return Py_BuildValue("(NdNNN)", PyBool_FromLong(nearest.colliding), nearest.distance,
                       nearest_normal(self, nullptr), nearest_point_a(self, nullptr),
                       nearest_point_b(self, nullptr));
}
inline PyObject* nearest_repr(PyObject* self) {
  Owned text(made(PyUnicode_FromString(
      "Nearest(colliding=%r, distance=%r, normal=%r, point_a=%r, point_b=%r)")));
  Owned fields(made(nearest_fields(self)));
  return PyUnicode_Format(text.get(), fields.get());
}
inline PyObject* nearest_reduce(PyObject* self, PyObject*) {
  return Py_BuildValue("(ON)", Py_TYPE(self), made(nearest_fields(self)));
}

inline PyMemberDef nearest_members[] = {
    {"colliding", T_BOOL, offsetof(Nearest, held) + offsetof(bc_nearest, colliding), READONLY,
     "As of `Contact`: from exact touch on."},
    {"distance", T_DOUBLE, offsetof(Nearest, held) + offsetof(bc_nearest, distance), READONLY,
     "Distance of the boxes [m]; 0 in contact."},
    {}};
inline PyGetSetDef nearest_arrays[] = {
    {"normal", Guarded<nearest_normal>::call, nullptr,
     "(3,) unit vector from point_a to point_b, the gradient of the distance by B's position; in\n"
     "contact the normal of the contact.",
     nullptr},
    {"point_a", Guarded<nearest_point_a>::call, nullptr,
     "(3,) nearest point on box A [m]; in contact the contact point.", nullptr},
    {"point_b", Guarded<nearest_point_b>::call, nullptr,
     "(3,) nearest point on box B [m]; in contact the contact point.", nullptr},
    {}};
inline PyMethodDef nearest_methods[] = {
    {"__reduce__", method<nearest_reduce>(), METH_NOARGS, "Pickle the fields."}, {}};
inline PyType_Slot nearest_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("Nearest(colliding, distance, normal, point_a, point_b)\n--\n\n"
                       "The nearest points of two boxes; frame: that of the poses.\n\n"
                       "Of nearest points that fill a set they are the centroids. It never\n"
                       "changes. Arrays are made when they are read, a new one each time.")},
    {Py_tp_new, slot<nearest_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Nearest::dealloc)},
    {Py_tp_repr, slot<nearest_repr>()},
    {Py_nb_bool, slot<refuse_truth>()},
    {Py_tp_members, nearest_members},
    {Py_tp_getset, nearest_arrays},
    {Py_tp_methods, nearest_methods},
    {0, nullptr}};
inline PyType_Spec nearest_spec = {"box_contact_ros.Nearest", sizeof(Nearest), 0,
                                   Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE, nearest_slots};

inline RowsClass<5> nearests_class{{"colliding", "distance", "normal", "point_a", "point_b"}};

inline PyObject* use_nearests(PyObject*, PyObject* type) { return nearests_class.use(type); }

// Arrays of a row for each pair.
struct NearestArrays {
  npy_intp count;
  Array<bool> colliding = make<bool>({count});
  Array<double> distance = make<double>({count}), normal = make<double>({count, 3});
  Array<double> point_a = make<double>({count, 3}), point_b = make<double>({count, 3});

  // Find the distances of rows without Python's lock. Returns the first row that is refused, or −1.
  long find(const detail::Kernel& kernel, const Rows& rows, long threads) const {
    detail::NearestResults results{colliding.numbers, distance.numbers, normal.numbers,
                                   point_a.numbers, point_b.numbers};
    return without_lock(
        [&] { return detail::nearest_rows(kernel, rows, long(count), results, threads); });
  }
  PyObject* release() { return nearests_class.make(colliding, distance, normal, point_a, point_b); }
};

}  // namespace box_contact::binding
