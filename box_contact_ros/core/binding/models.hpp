// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Classes `Exact`, `Mlp` and `Paper`: the models of the library as objects. Sizes come with each call.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <vector>

#include "../src/library/batch.hpp"
#include "../src/mlp/format.hpp"
#include "../src/mlp/shipped_network.hpp"
#include "contacts.hpp"
#include "nearest.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

using detail::Model;

inline const detail::Kernel* kernel = nullptr;  // of this process
inline PyTypeObject *exact_type = nullptr, *mlp_type = nullptr, *paper_type = nullptr;

struct NativeModel {
  Model kind = Model::exact;
  std::vector<float> network;  // of `Mlp` and `Paper`

  detail::Solver solver() const { return {kernel, kind, network.data()}; }
  // Solve rows without Python's lock. Returns the first row that is refused, or −1.
  long solve(const Rows& rows, const ContactArrays& found, double margin, long threads) const {
    return without_lock([&] {
      return detail::solve_rows(solver(), rows, long(found.count), found.results(margin), threads);
    });
  }
};

using ModelObject = Holder<std::unique_ptr<NativeModel>>;

inline bool is_native_model(PyObject* object) {
  return Py_IS_TYPE(object, exact_type) || Py_IS_TYPE(object, mlp_type) ||
         Py_IS_TYPE(object, paper_type);
}

// Whether a weight is believed: trained ones stay below 1e2, a flipped exponent bit does not.
inline bool is_weight(float number) { return std::fabs(number) <= 1e4F; }

inline std::vector<float> read_network(PyObject* object) {
  auto array = read<float>(object, "network", {any_length});
  float* end = array.numbers + array.length(0);
  if (!std::all_of(array.numbers, end, is_weight))
    fail(PyExc_ValueError, "the network has a weight that is not within -1e4 to 1e4");
  return {array.numbers, end};
}

// Whether a model has the network that it needs, in the form of mlp/network.hpp.
inline bool fits(Model model, const std::vector<float>& network) {
  if (model == Model::exact) return network.empty();
  if (network.size() < detail::network_header) return false;
  constexpr float most = detail::network_units_max;
  for (int k = 1; k <= 2; ++k)
    if (!(network[k] >= 1.0F && network[k] <= most && network[k] == std::floor(network[k])))
      return false;
  bool is_mlp = model == Model::mlp;
  float inputs = is_mlp ? detail::network_features : detail::paper_inputs;
  float outputs = is_mlp ? detail::network_outputs : detail::paper_outputs;
  if (network[0] != inputs || network[3] != outputs) return false;
  for (int k = 4; k < detail::network_header; ++k)
    if (network[k] != 0.0F && network[k] != 1.0F) return false;
  auto up_to_fours = [&](int k) { return (long(network[k]) + 3) / 4 * 4; };
  long wanted = detail::network_header;
  for (int k = 0; k < 3; ++k) {
    long path = k == 2 && network[6] != 0.0F ? up_to_fours(0) : 0;
    wanted += (long(network[k + 1]) + 7) / 8 * 8 * (1 + path + up_to_fours(k));
  }
  return long(network.size()) == wanted;
}

inline PyObject* make_model(PyTypeObject* type, std::unique_ptr<NativeModel> model) {
  if (!fits(model->kind, model->network))
    fail(PyExc_ValueError, "the network does not fit the model");
  // core/__init__.py goes no further.
  if (!kernel) fail(PyExc_RuntimeError, "the environment names an unknown instruction set");
  return ModelObject::make(type, std::move(model));
}

inline PyObject* exact_new(PyTypeObject* type, PyObject* args, PyObject* keywords) {
  static const char* names[] = {nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, ":Exact", const_cast<char**>(names)))
    return nullptr;
  return make_model(type, std::make_unique<NativeModel>());
}

// No network: the shipped one.
inline PyObject* mlp_new(PyTypeObject* type, PyObject* args, PyObject* keywords) {
  PyObject* network = Py_None;
  static const char* names[] = {"network", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "|O:Mlp", const_cast<char**>(names), &network))
    return nullptr;
  auto model = std::make_unique<NativeModel>();
  model->kind = Model::mlp;
  if (network == Py_None) {
    model->network.assign(std::begin(detail::shipped_network), std::end(detail::shipped_network));
  } else {
    model->network = read_network(network);
  }
  return make_model(type, std::move(model));
}

inline PyObject* paper_new(PyTypeObject* type, PyObject* args, PyObject* keywords) {
  PyObject* network;
  static const char* names[] = {"network", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O:Paper", const_cast<char**>(names), &network))
    return nullptr;
  auto model = std::make_unique<NativeModel>();
  model->kind = Model::paper;
  model->network = read_network(network);
  return make_model(type, std::move(model));
}

inline PyObject* exact_reduce(PyObject* self, PyObject*) {
  return Py_BuildValue("(O())", Py_TYPE(self));
}
inline PyObject* network_reduce(PyObject* self, PyObject*) {
  const std::vector<float>& network = ModelObject::of(self)->network;
  auto array = make<float>({npy_intp(network.size())});
  std::copy(network.begin(), network.end(), array.numbers);
  return Py_BuildValue("(O(N))", Py_TYPE(self), array.object.release());
}

inline long read_threads(PyObject* number) {
  long threads = whole_of(number);
  if (threads < 1 || threads > detail::threads_max)
    fail(PyExc_ValueError, "threads must be within 1 and 1024");
  return threads;
}

inline PyObject* model_solve(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  if (count < 4 || count > 8)
    fail(PyExc_TypeError,
         "solve(a, b, size_a, size_b, threads=1, patch=True, pairs=None, margin=0.0)");
  long threads = count > 4 ? read_threads(args[4]) : 1;
  bool patch = count > 5 ? truth_of(args[5]) : true;
  double margin = count > 7 ? PyFloat_AsDouble(args[7]) : 0.0;
  if (PyErr_Occurred()) return nullptr;
  PairArrays pairs(args, count > 6 ? args[6] : Py_None);
  ContactArrays found{pairs.count, patch};
  long refused = ModelObject::of(self)->solve(pairs.rows, found, margin, threads);
  return Py_BuildValue("(Nl)", found.release(), refused);
}

inline PyObject* distances(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 6) fail(PyExc_TypeError, "distances(a, b, size_a, size_b, threads, pairs)");
  long threads = read_threads(args[4]);
  PairArrays pairs(args, args[5]);
  NearestArrays found{pairs.count};
  long refused = found.find(*kernel, pairs.rows, threads);
  return Py_BuildValue("(Nl)", found.release(), refused);
}

inline PyMethodDef solve_method(PyCFunction solve) {
  return {"solve", solve, METH_FASTCALL,
          "solve(a, b, size_a, size_b, threads=1, patch=True, pairs=None, margin=0.0, /)\n--\n\n"
          "Return Contacts, and the first refused row or -1.\n\n"
          "Poses a and b are (m, 7), full extents (m, 3) or (1, 3) [m]. pairs (n, 2): places of\n"
          "the boxes of each row. margin: up to which separation pairs apart have a normal [m]."};
}
inline PyMethodDef exact_methods[] = {
    solve_method(method<model_solve>()),
    {"__reduce__", method<exact_reduce>(), METH_NOARGS, "Pickle nothing."},
    {}};
inline PyMethodDef network_methods[] = {
    solve_method(method<model_solve>()),
    {"__reduce__", method<network_reduce>(), METH_NOARGS, "Pickle the network."},
    {}};
inline PyType_Slot exact_slots[] = {
    {Py_tp_doc, const_cast<char*>("Exact()\n--\n\n"
                                  "Model `exact`: the exact moments of the overlap.")},
    {Py_tp_new, slot<exact_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(ModelObject::dealloc)},
    {Py_tp_methods, exact_methods},
    {0, nullptr}};
inline PyType_Slot mlp_slots[] = {
    {Py_tp_doc, const_cast<char*>("Mlp(network=None)\n--\n\n"
                                  "Model `mlp` with the shipped network, or one (n,) float32.")},
    {Py_tp_new, slot<mlp_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(ModelObject::dealloc)},
    {Py_tp_methods, network_methods},
    {0, nullptr}};
inline PyType_Slot paper_slots[] = {
    {Py_tp_doc, const_cast<char*>("Paper(network)\n--\n\n"
                                  "Model `paper` with a network (n,) float32, for two boxes of the\n"
                                  "size that it was trained for: `solve` checks no sizes.")},
    {Py_tp_new, slot<paper_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(ModelObject::dealloc)},
    {Py_tp_methods, network_methods},
    {0, nullptr}};
inline PyType_Spec exact_spec = {"box_contact_ros.core._native.Exact", sizeof(ModelObject), 0,
                                 Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE, exact_slots};
inline PyType_Spec mlp_spec = {"box_contact_ros.core._native.Mlp", sizeof(ModelObject), 0,
                               Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE, mlp_slots};
inline PyType_Spec paper_spec = {"box_contact_ros.core._native.Paper", sizeof(ModelObject), 0,
                                 Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE, paper_slots};

}  // namespace box_contact::binding
