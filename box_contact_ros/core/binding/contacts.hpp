// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Contacts as Python has them: an object for one pair, and one of arrays for many.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

#include "../src/kernel.hpp"
#include "rows_class.hpp"

namespace box_contact::binding {

inline PyTypeObject* contact_type = nullptr;

// --- Contact ------------------------------------------------------------------------------------

using Contact = Holder<bc_contact>;

inline PyObject* contact_normal(PyObject* self, void*) {
  return array_of(Contact::of(self).normal, 3);
}
inline PyObject* contact_depth(PyObject* self, void*) {
  return PyFloat_FromDouble(std::max(0.0, -Contact::of(self).separation));
}
inline PyObject* contact_point(PyObject* self, void*) {
  return array_of(Contact::of(self).point, 3);
}
inline PyObject* contact_covariance(PyObject* self, void*) {
  return array_of(Contact::of(self).covariance[0], 3, 3);
}

inline PyObject* contact_new(PyTypeObject* type, PyObject* args, PyObject* keywords) {
  PyObject *separation_given, *normal_given, *point_given, *volume_given, *covariance_given;
  int colliding;
  bc_contact contact{};
  contact.axis = -1;
  static const char* names[] = {"colliding", "separation", "normal", "point",
                                "volume",    "covariance", "axis",   nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "pOOOOO|i:Contact", const_cast<char**>(names),
                                   &colliding, &separation_given, &normal_given, &point_given,
                                   &volume_given, &covariance_given, &contact.axis))
    return nullptr;
  contact.separation = number_of(separation_given, "separation");
  contact.volume = number_of(volume_given, "volume");
  contact.colliding = colliding != 0;
  auto normal = read<double>(normal_given, "normal", {3});
  auto point = read<double>(point_given, "point", {3});
  auto covariance = read<double>(covariance_given, "covariance", {3, 3});
  std::copy_n(normal.numbers, 3, contact.normal);
  std::copy_n(point.numbers, 3, contact.point);
  std::copy_n(covariance.numbers, 9, contact.covariance[0]);
  return Contact::make(type, std::move(contact));
}

// The arguments that make the same contact.
inline PyObject* contact_fields(PyObject* self) {
  const bc_contact& contact = Contact::of(self);
  return Py_BuildValue("(NdNNdNi)", PyBool_FromLong(contact.colliding), contact.separation,
                       contact_normal(self, nullptr), contact_point(self, nullptr), contact.volume,
                       contact_covariance(self, nullptr), contact.axis);
}
inline PyObject* contact_repr(PyObject* self) {
  Owned text(made(PyUnicode_FromString(
      "Contact(colliding=%r, separation=%r, normal=%r, point=%r, volume=%r, covariance=%r, "
      "axis=%r)")));
  Owned fields(made(contact_fields(self)));
  return PyUnicode_Format(text.get(), fields.get());
}
inline PyObject* contact_reduce(PyObject* self, PyObject*) {
  return Py_BuildValue("(ON)", Py_TYPE(self), made(contact_fields(self)));
}

#define BC_MEMBER(name, type, text) \
  {#name, type, offsetof(Contact, held) + offsetof(bc_contact, name), READONLY, text}
inline PyMemberDef contact_members[] = {
    BC_MEMBER(colliding, T_BOOL,
              "True from exact touch on: separation <= 8 ulp of the largest coordinate or size."),
    BC_MEMBER(separation, T_DOUBLE,
              "Signed [m]: negative is the overlap depth, positive the largest gap on a SAT axis."),
    BC_MEMBER(volume, T_DOUBLE,
              "Volume of A∩B [m³]; 0 without contact; NaN from models that give the point alone."),
    BC_MEMBER(axis, T_INT,
              "The winning axis, also of pairs apart; -1 from models that do not tell it.\n\n"
              "0 to 2 faces of A, 3 to 5 faces of B, 6 + 3·i + j the edges i of A and j of B."),
    {}};
#undef BC_MEMBER
inline PyGetSetDef contact_arrays[] = {
    {"normal", Guarded<contact_normal>::call, nullptr,
     "(3,) unit vector from A to B; NaN where the separation exceeds the solver's margin.", nullptr},
    {"depth", Guarded<contact_depth>::call, nullptr,
     "How deep the boxes overlap along the normal [m]; 0 where they touch or are apart.", nullptr},
    {"point", Guarded<contact_point>::call, nullptr,
     "(3,) centroid of A∩B [m]; NaN without contact.", nullptr},
    {"covariance", Guarded<contact_covariance>::call, nullptr,
     "(3, 3) second central moments of A∩B divided by its volume [m²]; NaN where volume is\n"
     "NaN, and without contact.\n\n"
     "Volume and covariance are those of the overlap whose centroid is `point`, pressed in or not.",
     nullptr},
    {}};
inline PyMethodDef contact_methods[] = {
    {"__reduce__", method<contact_reduce>(), METH_NOARGS, "Pickle the fields."}, {}};
inline PyType_Slot contact_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("Contact(colliding, separation, normal, point, volume, covariance, axis=-1)"
                       "\n--\n\n"
                       "The contact of one pair of boxes; frame: that of the poses.\n\n"
                       "It never changes. Arrays are made when they are read, a new one each time.")},
    {Py_tp_new, slot<contact_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Contact::dealloc)},
    {Py_tp_repr, slot<contact_repr>()},
    {Py_nb_bool, slot<refuse_truth>()},
    {Py_tp_members, contact_members},
    {Py_tp_getset, contact_arrays},
    {Py_tp_methods, contact_methods},
    {0, nullptr}};
inline PyType_Spec contact_spec = {"box_contact_ros.Contact", sizeof(Contact), 0,
                                   Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE, contact_slots};

// --- Contacts -----------------------------------------------------------------------------------

inline RowsClass<7> contacts_class{
    {"colliding", "separation", "normal", "point", "volume", "covariance", "axis"}};

inline PyObject* use_contacts(PyObject*, PyObject* type) { return contacts_class.use(type); }

// Arrays of a row for each pair.
struct ContactArrays {
  npy_intp count;
  bool patch;
  Array<bool> colliding = make<bool>({count});
  Array<double> separation = make<double>({count}), normal = make<double>({count, 3});
  Array<double> point = make<double>({count, 3}), volume = make<double>({count});
  Array<double> covariance = patch ? make<double>({count, 3, 3}) : unknown_covariances();
  Array<int32_t> axis = make<int32_t>({count});

  detail::Results results(double margin) const {
    return {colliding.numbers,
            separation.numbers,
            normal.numbers,
            point.numbers,
            patch ? volume.numbers : nullptr,
            patch ? covariance.numbers : nullptr,
            axis.numbers,
            margin};
  }
  PyObject* release() {
    // Without a patch, the volume of pairs in contact is unknown.
    for (npy_intp row = 0; !patch && row < count; ++row)
      volume.numbers[row] = colliding.numbers[row] ? unknown : 0.0;
    return contacts_class.make(colliding, separation, normal, point, volume, covariance, axis);
  }

 private:
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  // One NaN, seen in all places: read-only.
  Array<double> unknown_covariances() const {
    npy_intp shape[] = {count, 3, 3}, steps[] = {0, 0, 0};
    return Array<double>(PyArray_New(&PyArray_Type, 3, shape, NPY_DOUBLE, steps,
                                     const_cast<double*>(&unknown), 0, NPY_ARRAY_ALIGNED, nullptr));
  }
};

}  // namespace box_contact::binding
