// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The paper's networks as a Python extension; _networks.pyi documents it.
//
// Arrays are checked here for kind and shape only. Words about refused poses and sizes are made in
// Python, which is told the row.
#include "networks.hpp"

#include <string>

#include "../../core/binding/arrays.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::binding;
using namespace box_contact::paper;

// --- Arguments ----------------------------------------------------------------------------------

// Read the units of a network's layers. `count` is how many parameters the network has.
bool read_widths(PyObject* argument, npy_intp count, Widths& widths) {
  Array<int64_t> given;
  if (!read(argument, "widths", {any_length}, given)) return false;
  widths.assign(given.numbers, given.numbers + given.length(0));
  // Limits that keep the products of `parameter_count` in range.
  bool possible = widths.size() >= 2;
  for (long units : widths) possible = possible && units >= 1 && units <= count;
  if (possible && parameter_count(widths) == count) return true;
  fail(PyExc_ValueError, "widths do not fit the parameters");
  return false;
}

bool read_fold_to(PyObject* argument, FoldTo& to) {
  long value = PyLong_AsLong(argument);
  if (value == -1 && PyErr_Occurred()) return false;
  for (FoldTo known : {FoldTo::nothing, FoldTo::octant, FoldTo::features})
    if (value == long(known)) return to = known, true;
  fail(PyExc_ValueError, "fold_to is NO_FOLD, OCTANT or FEATURES");
  return false;
}

// Sizes are as many as poses, or one for all.
bool read_sizes(PyObject* argument, const char* name, npy_intp count, Array<double>& sizes,
                long& step) {
  if (!read(argument, name, {any_length, 3}, sizes)) return false;
  step = sizes.length(0) == 1 ? 0 : 3;
  if (step == 0 || sizes.length(0) == count) return true;
  PyErr_Format(PyExc_ValueError, "%s are neither one nor as many as the poses", name);
  return false;
}

// --- Functions ----------------------------------------------------------------------------------

PyObject* solve_pairs(PyObject*, PyObject* const* args, Py_ssize_t given) {
  if (given != 8)
    return fail(PyExc_TypeError,
                "solve(poses_a, poses_b, sizes_a, sizes_b, networks, widths, cubes, fold_to)");
  Array<double> poses_a, poses_b, sizes_a, sizes_b;
  Array<float> parameters;
  Rows rows{};
  Networks networks{};
  if (!read(args[0], "poses_a", {any_length, 7}, poses_a)) return nullptr;
  npy_intp count = poses_a.length(0);
  if (!read(args[1], "poses_b", {count, 7}, poses_b) ||
      !read_sizes(args[2], "sizes_a", count, sizes_a, rows.size_step_a) ||
      !read_sizes(args[3], "sizes_b", count, sizes_b, rows.size_step_b) ||
      !read(args[4], "networks", {any_length, any_length}, parameters) ||
      !read_widths(args[5], parameters.length(1), networks.widths) ||
      !read_fold_to(args[7], networks.fold_to))
    return nullptr;
  int cubes = PyObject_IsTrue(args[6]);
  if (cubes < 0) return nullptr;
  networks.cubes = cubes;
  if (networks.widths.front() != input_count || networks.widths.back() != output_count)
    return fail(PyExc_ValueError, "the networks must have 6 inputs and 4 outputs");
  if (parameters.length(0) != (networks.fold_to == FoldTo::features ? 2 : 1))
    return fail(PyExc_ValueError, "FEATURES needs two networks, other folds one");
  for (npy_intp k = 0; k < parameters.length(0); ++k)
    networks.parameters.push_back(parameters.numbers + k * parameters.length(1));
  rows.poses_a = poses_a.numbers, rows.poses_b = poses_b.numbers;
  rows.sizes_a = sizes_a.numbers, rows.sizes_b = sizes_b.numbers;

  Array<bool> colliding;
  Array<double> separation, normal, point;
  if (!make({count}, colliding) || !make({count}, separation) || !make({count, 3}, normal) ||
      !make({count, 3}, point))
    return nullptr;
  long refused;
  Py_BEGIN_ALLOW_THREADS;
  refused = solve(networks, rows, count,
                  {colliding.numbers, separation.numbers, normal.numbers, point.numbers, nullptr,
                   nullptr, nullptr, 0.0});
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("(NNNNl)", colliding.object.release(), separation.object.release(),
                       normal.object.release(), point.object.release(), refused);
}

PyObject* fold_pairs(PyObject*, PyObject* const* args, Py_ssize_t given) {
  if (given != 5) return fail(PyExc_TypeError, "fold(fold_to, offset, rotation, axis, normal)");
  FoldTo to;
  Array<double> offset, rotation, normal;
  Array<int64_t> axis;
  if (!read_fold_to(args[0], to) || !read(args[1], "offset", {any_length, 3}, offset))
    return nullptr;
  npy_intp count = offset.length(0);
  if (!read(args[2], "rotation", {count, 3, 3}, rotation) ||
      !read(args[3], "axis", {count}, axis) || !read(args[4], "normal", {count, 3}, normal))
    return nullptr;
  for (npy_intp row = 0; to == FoldTo::features && row < count; ++row)
    if (!has_reference_features(axis.numbers[row])) {
      PyErr_Format(PyExc_ValueError, "axis[%zd] is no face of the first box and no edge pair", row);
      return nullptr;
    }

  Array<double> map_first, map_second, folded_offset, folded_rotation, angles;
  Array<int64_t> subset;
  if (!make({count, 3, 3}, map_first) || !make({count, 3, 3}, map_second) ||
      !make({count, 3}, folded_offset) || !make({count, 3, 3}, folded_rotation) ||
      !make({count, 3}, angles) || !make({count}, subset))
    return nullptr;
  Py_BEGIN_ALLOW_THREADS;
  for (npy_intp row = 0; row < count; ++row) {
    Placement placement{vector_at(offset.numbers + 3 * row), matrix_at(rotation.numbers + 9 * row)};
    Fold fold =
        fold_pair(to, placement, int(axis.numbers[row]), vector_at(normal.numbers + 3 * row));
    write(fold.map_first, map_first.numbers + 9 * row);
    write(fold.map_second, map_second.numbers + 9 * row);
    write(fold.placement.offset, folded_offset.numbers + 3 * row);
    write(fold.placement.rotation, folded_rotation.numbers + 9 * row);
    write(euler_angles(fold.placement.rotation), angles.numbers + 3 * row);
    subset.numbers[row] = int64_t(fold.subset);
  }
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("(NNNNNN)", map_first.object.release(), map_second.object.release(),
                       folded_offset.object.release(), folded_rotation.object.release(),
                       angles.object.release(), subset.object.release());
}

PyObject* forward_rows(PyObject*, PyObject* const* args, Py_ssize_t given) {
  if (given != 3) return fail(PyExc_TypeError, "forward(network, widths, inputs)");
  Array<float> parameters, inputs, outputs;
  Widths widths;
  if (!read(args[0], "network", {any_length}, parameters) ||
      !read_widths(args[1], parameters.length(0), widths) ||
      !read(args[2], "inputs", {any_length, widths.front()}, inputs))
    return nullptr;
  npy_intp count = inputs.length(0);
  if (!make({count, widths.back()}, outputs)) return nullptr;
  Py_BEGIN_ALLOW_THREADS;
  Units units(widths);
  for (npy_intp row = 0; row < count; ++row) {
    std::copy_n(inputs.numbers + row * widths.front(), widths.front(), units.layer.begin());
    forward(parameters.numbers, widths, units);
    std::copy_n(units.layer.begin(), widths.back(), outputs.numbers + row * widths.back());
  }
  Py_END_ALLOW_THREADS;
  return outputs.object.release();
}

// --- Module -------------------------------------------------------------------------------------

PyMethodDef module_methods[] = {
    {"solve", fastcall(solve_pairs), METH_FASTCALL,
     "solve(poses_a, poses_b, sizes_a, sizes_b, networks, widths, cubes, fold_to, /)\n--\n\n"
     "Return colliding, separation, normal, point, and the first refused row or -1."},
    {"fold", fastcall(fold_pairs), METH_FASTCALL,
     "fold(fold_to, offset, rotation, axis, normal, /)\n--\n\n"
     "Return M, N, offset, rotation, roll pitch yaw, and subset of folded pairs."},
    {"forward", fastcall(forward_rows), METH_FASTCALL,
     "forward(network, widths, inputs, /)\n--\n\nReturn the outputs of a network."},
    {nullptr, nullptr, 0, nullptr}};

struct Constant {
  const char* name;
  long value;
};
constexpr Constant constants[] = {{"INPUTS", input_count},
                                  {"OUTPUTS", output_count},
                                  {"NO_FOLD", long(FoldTo::nothing)},
                                  {"OCTANT", long(FoldTo::octant)},
                                  {"FEATURES", long(FoldTo::features)},
                                  {"VERTEX_FACE", long(Subset::vertex_face)},
                                  {"EDGE_EDGE", long(Subset::edge_edge)}};

PyModuleDef module_definition = {PyModuleDef_HEAD_INIT,
                                 "_networks",
                                 "The paper's networks and the symmetries around them.",
                                 -1,
                                 module_methods,
                                 nullptr,
                                 nullptr,
                                 nullptr,
                                 nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__networks() {
  import_array();
  Owned module(PyModule_Create(&module_definition));
  if (!module) return nullptr;
  for (const Constant& constant : constants)
    if (PyModule_AddIntConstant(module.get(), constant.name, constant.value) < 0) return nullptr;
  return module.release();
}
