// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Class `PairSolver`: pairs of boxes by a model of the library.
//
// Arguments are checked here for kind and shape only. What is no plain number goes to Python, which
// converts it or says what is wrong with it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <vector>

#include "../src/library/batch.hpp"
#include "../src/mlp/shipped_network.hpp"
#include "contacts.hpp"
#include "pair_arrays.hpp"

namespace box_contact::binding {

using detail::Counts;
using detail::Model;

inline const detail::Kernel* kernel = nullptr;  // of this process
inline PyObject* name_call_general = nullptr;   // of the methods for what is no plain array
inline PyObject* name_batch_general = nullptr;

// Who answers, the sizes of the boxes, and how many contacts took another way than most.
struct Setup {
  Model model = Model::exact;
  double size_a[3], size_b[3];  // full extents [m]
  double margin = 0.0;          // [m]
  std::vector<float> network;   // of model `mlp`
  std::atomic<long> clipped{0};

  detail::Solver solver() const { return {kernel, model, network.data()}; }
  detail::PairNumbers pair(const double* pose_a, const double* pose_b) const {
    return {pose_a, pose_b, size_a, size_b};
  }
  Rows rows(const double* poses_a, const double* poses_b) const {
    return {poses_a, poses_b, size_a, size_b, 0, 0, nullptr};
  }
  void count(const Counts& counts) {
    if (counts.clipped) clipped += counts.clipped;
  }
  // Solve rows without Python's lock. Returns the first row that is refused, or −1.
  long solve(const Rows& rows, const ContactArrays& found, long threads) {
    Counts counts{};
    long refused = without_lock([&] {
      return detail::solve_rows(solver(), rows, long(found.count), found.results(margin), threads,
                                counts);
    });
    if (refused < 0) count(counts);
    return refused;
  }
};

struct PairSolver {
  std::unique_ptr<Setup> setup;  // none: Python answers
  bool is_made = false;
};

inline PyObject* solver_new(PyTypeObject* type, PyObject*, PyObject*) {
  return Holder<PairSolver>::make(type, PairSolver{});
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

// Whether a model has the network that it needs. A network of `mlp` has the groups of each hidden
// layer, then groups of eight units: their biases, and their weights for each input (mlp/network.hpp).
inline bool fits(Model model, const std::vector<float>& network) {
  if (model == Model::exact) return network.empty();
  constexpr long most = detail::network_units_max / 8;
  if (network.size() < 2) return false;
  float first = network[0], second = network[1];
  if (!(first >= 1.0F && first <= most && second >= 1.0F && second <= most)) return false;
  long groups = long(first), next = long(second);
  long units = 8 * (1 + detail::network_features) * groups + 8 * (1 + 8 * groups) * next;
  return long(network.size()) == 2 + units + 8 * (1 + 8 * next);
}

// No network: the shipped one. No model: Python answers.
inline int solver_init(PyObject* self, PyObject* args, PyObject* keywords) {
  auto setup = std::make_unique<Setup>();
  PyObject *name, *network = Py_None;
  double *a = setup->size_a, *b = setup->size_b;
  static const char* names[] = {"model", "size_a", "size_b", "network", "margin", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O(ddd)(ddd)|Od", const_cast<char**>(names),
                                   &name, a, a + 1, a + 2, b, b + 1, b + 2, &network,
                                   &setup->margin))
    return -1;
  auto is = [name](const char* one) {
    return PyUnicode_Check(name) && PyUnicode_CompareWithASCIIString(name, one) == 0;
  };
  if (is("mlp")) setup->model = Model::mlp;
  if (network != Py_None) {
    setup->network = read_network(network);
  } else if (setup->model == Model::mlp) {
    setup->network.assign(std::begin(detail::shipped_network), std::end(detail::shipped_network));
  }
  if (!(is("mlp") || is("exact") || name == Py_None) || !fits(setup->model, setup->network))
    fail(PyExc_ValueError, "model is 'exact', 'mlp', or None; the network fits");
  // core/__init__.py goes no further.
  if (!kernel) fail(PyExc_RuntimeError, "the environment names an unknown instruction set");
  PairSolver& solver = Holder<PairSolver>::of(self);
  // Other threads may be using it.
  if (solver.is_made) fail(PyExc_RuntimeError, "a solver is made once: make another");
  if (name != Py_None) solver.setup = std::move(setup);
  solver.is_made = true;
  return 0;
}

inline PyObject* call_method(PyObject* self, PyObject* name, PyObject* args, PyObject* keywords) {
  Owned method(made(PyObject_GetAttr(self, name)));
  return PyObject_Call(method.get(), args, keywords);
}

inline PyObject* solver_call(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  if (setup && !keywords && PyTuple_GET_SIZE(args) == 2) {
    double copy_a[7], copy_b[7];
    const double* a = numbers_of(PyTuple_GET_ITEM(args, 0), 7, copy_a);
    const double* b = a ? numbers_of(PyTuple_GET_ITEM(args, 1), 7, copy_b) : nullptr;
    bc_contact contact;
    Counts counts{};
    if (b && detail::solve_pair(setup->solver(), setup->pair(a, b), BC_COVARIANCE, setup->margin,
                                contact, counts)) {
      setup->count(counts);
      return Contact::make(contact_type, std::move(contact));
    }
  }
  return call_method(self, name_call_general, args, keywords);
}

// What a call of `batch` asks for, if it is all plain.
struct PlainBatch {
  Rows rows{};
  npy_intp count = -1;
  long threads = 1;
  bool patch = true;

  // Returns false for what Python has to convert or to refuse.
  bool read(PyObject* args, PyObject* keywords, const Setup& setup) {
    if (PyTuple_GET_SIZE(args) != 2) return false;
    rows = setup.rows(plain_rows(PyTuple_GET_ITEM(args, 0), count, 7), nullptr);
    if (rows.poses_a) rows.poses_b = plain_rows(PyTuple_GET_ITEM(args, 1), count, 7);
    if (!rows.poses_b) return false;
    PyObject *key, *value;
    for (Py_ssize_t place = 0; keywords && PyDict_Next(keywords, &place, &key, &value);)
      if (!PyUnicode_Check(key) || !read_keyword(key, value)) return false;
    return true;
  }

 private:
  bool read_keyword(PyObject* key, PyObject* value) {
    auto is = [key](const char* name) { return PyUnicode_CompareWithASCIIString(key, name) == 0; };
    if (is("size_a")) return read_sizes(value, rows.sizes_a, rows.size_step_a);
    if (is("size_b")) return read_sizes(value, rows.sizes_b, rows.size_step_b);
    if (is("patch") && PyBool_Check(value)) return patch = value == Py_True, true;
    if (!is("threads") || !PyLong_CheckExact(value)) return false;
    int overflow;
    threads = PyLong_AsLongAndOverflow(value, &overflow);
    return !overflow && threads >= 1 && threads <= detail::threads_max;
  }
  bool read_sizes(PyObject* value, const double*& sizes, long& step) {
    if (value == Py_None) return true;
    sizes = plain_rows(value, count, 3);
    step = 3;
    return sizes != nullptr;
  }
};

inline PyObject* solver_batch(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  PlainBatch plain;
  if (setup && plain.read(args, keywords, *setup)) {
    ContactArrays found{plain.count, plain.patch};
    if (setup->solve(plain.rows, found, plain.threads) < 0) return found.release();
  }
  return call_method(self, name_batch_general, args, keywords);
}

inline PyObject* solver_solve(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  if (count < 5 || count > 7 || !setup)
    fail(PyExc_TypeError,
         "solve(poses_a, poses_b, sizes_a, sizes_b, threads, patch=True, pairs=None)");
  long threads = whole_of(args[4]);
  bool patch = count > 5 ? truth_of(args[5]) : true;
  if (threads < 1 || threads > detail::threads_max)
    fail(PyExc_ValueError, "threads must be within 1 and 1024");
  PairArrays pairs(args, count > 6 ? args[6] : Py_None);
  ContactArrays found{pairs.count, patch};
  long refused = setup->solve(pairs.rows, found, threads);
  return Py_BuildValue("(Nl)", found.release(), refused);
}

inline PyObject* solver_clipped(PyObject* self, void*) {
  const Setup* setup = Holder<PairSolver>::of(self).setup.get();
  return PyLong_FromLong(setup ? setup->clipped.load() : 0);
}

inline PyMethodDef solver_methods[] = {
    {"solve", method<solver_solve>(), METH_FASTCALL,
     "solve(poses_a, poses_b, sizes_a, sizes_b, threads, patch=True, pairs=None)\n--\n\n"
     "Return Contacts, and the first refused row or -1.\n\n"
     "poses (m, 7), sizes (m, 3) or (1, 3) full extents [m]; frame: that of the poses.\n"
     "pairs (n, 2): places of the boxes of each row."},
    {"batch", method<solver_batch>(), METH_VARARGS | METH_KEYWORDS,
     "batch($self, poses_a, poses_b=None, *, size_a=None, size_b=None, sizes=None, pairs=None, "
     "threads=1, patch=True)\n--\n\n"
     "Return the contacts of n pairs: row i is what a single call gives for row i.\n\n"
     "poses_a, poses_b are (n, 7); size_a, size_b replace the solver's sizes, (3,) for all rows\n"
     "or (n, 3) for every row its own. Or poses are (m, 7), sizes (3,) or (m, 3), and the rows of\n"
     "pairs (n, 2) are the places of their boxes A and B. 1 to 1,024 `threads` share the rows; no "
     "bit\n"
     "depends on their number. Without `patch` volume and covariance are not computed, and are "
     "NaN;\n"
     "points then have the same error bounds, not always the same bits."},
    {nullptr, nullptr, 0, nullptr}};
inline PyGetSetDef solver_attributes[] = {{"clipped", Guarded<solver_clipped>::call, nullptr,
                                    "Contacts of model exact that were clipped.", nullptr},
                                   {nullptr, nullptr, nullptr, nullptr, nullptr}};

inline PyType_Slot solver_slots[] = {
    {Py_tp_doc,
     const_cast<char*>(
         "PairSolver(model, size_a, size_b, network=None, margin=0.0)\n--\n\n"
         "Solve pairs of boxes by model 'exact' or 'mlp'; None leaves all to Python.\n\n"
         "A call with two poses (7,) returns a Contact, and batch(poses_a, poses_b) returns "
         "Contacts. What is no plain array, tuple or list of numbers, and what is refused, goes to "
         "self._call_general(pose_a, pose_b) and self._batch_general(...).")},
    {Py_tp_new, slot<solver_new>()},
    {Py_tp_init, slot<solver_init>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<PairSolver>::dealloc)},
    {Py_tp_call, slot<solver_call>()},
    {Py_tp_methods, solver_methods},
    {Py_tp_getset, solver_attributes},
    {0, nullptr}};

inline PyType_Spec solver_spec = {"box_contact_ros.core._native.PairSolver",
                                  sizeof(Holder<PairSolver>), 0,
                                  Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, solver_slots};

}  // namespace box_contact::binding
