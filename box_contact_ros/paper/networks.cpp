// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The paper's networks as a Python extension; _networks.pyi documents it.
//
// Arrays are checked here for kind and shape only. Words about refused poses and sizes are made in
// Python, which is told the row.
#include "networks.hpp"

#include <vector>

#include "../core/binding/arrays.hpp"
#include "../core/binding/other_kernel.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::binding;
using namespace box_contact::paper;

// --- Arguments ----------------------------------------------------------------------------------

// Read a network: its parameters, and the units of its layers, which go to `widths`.
bool read_network(PyObject* const* args, Array<float>& parameters, std::vector<float>& widths,
                  Network& network) {
  Array<int64_t> given;
  if (!read(args[0], "network", {any_length}, parameters) ||
      !read(args[1], "widths", {any_length}, given))
    return false;
  for (npy_intp k = 0; k < given.length(0); ++k) widths.push_back(float(given.numbers[k]));
  network = {widths.data(), long(widths.size()), parameters.numbers};
  if (network.parameter_count(parameters.length(0)) == parameters.length(0)) return true;
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

// --- Functions ----------------------------------------------------------------------------------

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
  std::vector<float> widths;
  Network network;
  if (!read_network(args, parameters, widths, network) ||
      !read(args[2], "inputs", {any_length, network.width(0)}, inputs))
    return nullptr;
  npy_intp count = inputs.length(0);
  long into = network.width(0), out_of = network.outputs();
  if (!make({count, out_of}, outputs)) return nullptr;
  without_lock([&] {
    Units units;
    for (npy_intp row = 0; row < count; ++row)
      std::copy_n(forward(network, inputs.numbers + row * into, units), out_of,
                  outputs.numbers + row * out_of);
  });
  return outputs.object.release();
}

// --- Module -------------------------------------------------------------------------------------

PyMethodDef module_methods[] = {
    {"fold", method<fold_pairs>(), METH_FASTCALL,
     "fold(fold_to, offset, rotation, axis, normal, /)\n--\n\n"
     "Return M, N, offset, rotation, roll pitch yaw, and subset of folded pairs."},
    {"forward", method<forward_rows>(), METH_FASTCALL,
     "forward(network, widths, inputs, /)\n--\n\nReturn the outputs of a network."},
    {nullptr, nullptr, 0, nullptr}};

struct Constant {
  const char* name;
  long value;
};
constexpr Constant constants[] = {{"INPUTS", input_count},
                                  {"OUTPUTS", output_count},
                                  {"MOST_UNITS", most_units},
                                  {"NO_FOLD", long(FoldTo::nothing)},
                                  {"OCTANT", long(FoldTo::octant)},
                                  {"FEATURES", long(FoldTo::features)},
                                  {"VERTEX_FACE", long(Subset::vertex_face)},
                                  {"EDGE_EDGE", long(Subset::edge_edge)}};

bool reads(const detail::NetworkNumbers& packed) { return PaperModel(packed).count > 0; }

const OtherKernel kernel = {
    {"paper", "paper", 1, {{solve_rows, solve_rows}, {solve_rows, solve_rows}}, nullptr}, reads};

bool add(PyObject* module, const char* name, PyObject* value) {
  Owned owned(value);
  return value && PyModule_AddObjectRef(module, name, value) == 0;
}

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
  bool added = add(module.get(), "SAME_SIZE", PyFloat_FromDouble(same_size)) &&
               add(module.get(), "KERNEL",
                   PyCapsule_New(const_cast<OtherKernel*>(&kernel), kernel_capsule, nullptr));
  return added ? module.release() : nullptr;
}
