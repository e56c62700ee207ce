// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The areas of contacts' patches, and all numbers of contacts as messages have them.
#pragma once

#include <algorithm>

#include "../include/box_contact/box_contact.h"
#include "arrays.hpp"

namespace box_contact::binding {

inline PyObject* patch_areas(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 2) fail(PyExc_TypeError, "patch_areas(normal, covariance)");
  auto normal = read<double>(args[0], "normal", {any_length, 3});
  npy_intp rows = normal.length(0);
  auto covariance = read<double>(args[1], "covariance", {rows, 3, 3});
  auto area = make<double>({rows});
  for (npy_intp row = 0; row < rows; ++row)
    area.numbers[row] = bc_patch_area(normal.numbers + 3 * row, covariance.numbers + 9 * row);
  return area.object.release();
}

// Numbers of a contact in a message: point, normal, depth, volume, area, upper covariance.
constexpr npy_intp message_numbers_count = 15;

// Contacts in memory, a row each.
struct ContactRows {
  const double *point, *normal, *separation, *volume, *covariance;

  void write(npy_intp row, double* to) const {
    const double *n = normal + 3 * row, *c = covariance + 9 * row;
    to = std::copy_n(n, 3, std::copy_n(point + 3 * row, 3, to));
    for (double number :
         {-separation[row], volume[row], bc_patch_area(n, c), c[0], c[1], c[2], c[4], c[5], c[8]})
      *to++ = number;
  }
};

inline PyObject* message_numbers(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 5)
    fail(PyExc_TypeError, "message_numbers(point, normal, separation, volume, covariance)");
  auto point = read<double>(args[0], "point", {any_length, 3});
  npy_intp rows = point.length(0);
  auto normal = read<double>(args[1], "normal", {rows, 3});
  auto separation = read<double>(args[2], "separation", {rows});
  auto volume = read<double>(args[3], "volume", {rows});
  auto covariance = read<double>(args[4], "covariance", {rows, 3, 3});
  ContactRows contacts{point.numbers, normal.numbers, separation.numbers, volume.numbers,
                       covariance.numbers};
  auto numbers = make<double>({rows, message_numbers_count});
  for (npy_intp row = 0; row < rows; ++row)
    contacts.write(row, numbers.numbers + message_numbers_count * row);
  return numbers.object.release();
}

}  // namespace box_contact::binding
