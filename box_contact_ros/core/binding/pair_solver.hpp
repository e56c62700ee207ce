// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Class `PairSolver`: pairs of boxes by a model, with sizes that are known beforehand or come with
// each call.
//
// Arguments are checked here for kind and shape only. What is no plain number goes to Python, which
// converts it or says what is wrong with it.
#pragma once

#include <memory>

#include "models.hpp"

namespace box_contact::binding {

inline PyObject* name_call_general = nullptr;  // of the methods for what is no plain array
inline PyObject* name_batch_general = nullptr;
inline PyObject* name_distance_general = nullptr;
inline PyObject* name_distance_batch_general = nullptr;

// Who answers, and the sizes of the boxes, where they are known.
struct Setup {
  Owned owner;  // of the model
  NativeModel* model;
  double size_a[3], size_b[3];  // full extents [m]
  bool has_size_a = false, has_size_b = false;
  double margin = 0.0;  // [m]

  detail::PairNumbers pair(const double* pose_a, const double* pose_b) const {
    return {pose_a, pose_b, size_a, size_b};
  }
  // Rows without poses; nullptr instead of sizes that are not known.
  Rows rows() const {
    return {nullptr, nullptr, has_size_a ? size_a : nullptr, has_size_b ? size_b : nullptr, 0, 0};
  }
};

struct PairSolver {
  std::unique_ptr<Setup> setup;  // none: Python answers
  bool is_made = false;
};

inline PyObject* solver_new(PyTypeObject* type, PyObject*, PyObject*) {
  return Holder<PairSolver>::make(type, PairSolver{});
}

// Returns whether there is a size.
inline bool read_size(PyObject* given, double* size) {
  if (given == Py_None) return false;
  return PyArg_ParseTuple(given, "ddd", size, size + 1, size + 2) ? true : throw PythonError{};
}

// Model None: Python answers.
inline int solver_init(PyObject* self, PyObject* args, PyObject* keywords) {
  auto setup = std::make_unique<Setup>();
  PyObject *model, *size_a = Py_None, *size_b = Py_None;
  static const char* names[] = {"model", "size_a", "size_b", "margin", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O|OOd", const_cast<char**>(names), &model,
                                   &size_a, &size_b, &setup->margin))
    return -1;
  for (PyObject* size : {size_a, size_b})
    if (size != Py_None && !PyTuple_Check(size)) fail(PyExc_TypeError, "a size is a tuple or None");
  setup->has_size_a = read_size(size_a, setup->size_a);
  setup->has_size_b = read_size(size_b, setup->size_b);
  PairSolver& solver = Holder<PairSolver>::of(self);
  // Other threads may be using it.
  if (solver.is_made) fail(PyExc_RuntimeError, "a solver is made once: make another");
  if (is_native_model(model)) {
    setup->owner.reset(Py_NewRef(model));
    setup->model = ModelObject::of(model).get();
    solver.setup = std::move(setup);
  } else if (model != Py_None) {
    fail(PyExc_TypeError, "model is an Exact, an Mlp, a Paper, or None");
  }
  solver.is_made = true;
  return 0;
}

inline PyObject* call_method(PyObject* self, PyObject* name, PyObject* args, PyObject* keywords) {
  Owned method(made(PyObject_GetAttr(self, name)));
  return PyObject_Call(method.get(), args, keywords);
}

inline PyObject* solver_call(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  if (setup && setup->has_size_a && setup->has_size_b && !keywords && PyTuple_GET_SIZE(args) == 2) {
    double copy_a[7], copy_b[7];
    const double* a = numbers_of(PyTuple_GET_ITEM(args, 0), 7, copy_a);
    const double* b = a ? numbers_of(PyTuple_GET_ITEM(args, 1), 7, copy_b) : nullptr;
    bc_contact contact;
    if (b && detail::solve_pair(setup->model->solver(), setup->pair(a, b), BC_COVARIANCE,
                                setup->margin, contact)) {
      return Contact::make(contact_type, std::move(contact));
    }
  }
  return call_method(self, name_call_general, args, keywords);
}

// What a call of `batch` asks for, if it is all plain.
struct PlainBatch {
  Rows rows{};
  npy_intp count = -1;  // of pairs
  npy_intp poses = -1;  // of A, or of all boxes
  long threads = 1;
  bool patch = true;

  // Returns false for what Python has to convert or to refuse.
  bool read(PyObject* args, PyObject* keywords, const Setup& setup, bool takes_patch) {
    Py_ssize_t given = PyTuple_GET_SIZE(args);
    if (given != 1 && given != 2) return false;
    rows = setup.rows();
    by_place = given == 1;
    rows.poses_a = plain_rows<double>(PyTuple_GET_ITEM(args, 0), poses, 7);
    if (!rows.poses_a) return false;
    rows.poses_b =
        by_place ? rows.poses_a : plain_rows<double>(PyTuple_GET_ITEM(args, 1), poses, 7);
    if (!rows.poses_b) return false;
    count = poses;
    PyObject *key, *value;
    for (Py_ssize_t place = 0; keywords && PyDict_Next(keywords, &place, &key, &value);)
      if (!PyUnicode_Check(key) || !read_keyword(key, value, takes_patch)) return false;
    bool are_known = rows.sizes_a == setup.size_a && rows.sizes_b == setup.size_b;
    if (setup.model->kind == Model::paper && !are_known) return false;  // Python checks new sizes
    return rows.sizes_a && rows.sizes_b && by_place == (rows.pairs != nullptr);
  }

 private:
  bool by_place = false;  // batch(poses, sizes=…, pairs=…)

  bool read_keyword(PyObject* key, PyObject* value, bool takes_patch) {
    auto is = [key](const char* name) { return PyUnicode_CompareWithASCIIString(key, name) == 0; };
    if (is("size_a")) return !by_place && read_sizes(value, rows.sizes_a, rows.size_step_a);
    if (is("size_b")) return !by_place && read_sizes(value, rows.sizes_b, rows.size_step_b);
    if (is("sizes"))
      return by_place && read_sizes(value, rows.sizes_a, rows.size_step_a) &&
             read_sizes(value, rows.sizes_b, rows.size_step_b);
    if (is("pairs")) return by_place && read_pairs(value);
    if (takes_patch && is("patch") && PyBool_Check(value)) return patch = value == Py_True, true;
    if (!is("threads") || !PyLong_CheckExact(value)) return false;
    int overflow;
    threads = PyLong_AsLongAndOverflow(value, &overflow);
    return !overflow && threads >= 1 && threads <= detail::threads_max;
  }
  bool read_sizes(PyObject* value, const double*& sizes, long& step) {
    if (value == Py_None) return true;
    sizes = plain_rows<double>(value, poses, 3);
    step = 3;
    return sizes != nullptr;
  }
  bool read_pairs(PyObject* value) {
    count = -1;
    rows.pairs = plain_rows<int64_t>(value, count, 2);
    rows.pose_count = long(poses);
    return rows.pairs && bad_place(rows.pairs, count, poses) < 0;
  }
};

inline PyObject* solver_batch(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  PlainBatch plain;
  if (setup && plain.read(args, keywords, *setup, true)) {
    ContactArrays found{plain.count, plain.patch};
    if (setup->model->solve(plain.rows, found, setup->margin, plain.threads) < 0)
      return found.release();
  }
  return call_method(self, name_batch_general, args, keywords);
}

inline PyObject* solver_distance(PyObject* self, PyObject* const* args, Py_ssize_t count,
                                 PyObject* names) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  if (setup && setup->has_size_a && setup->has_size_b && !names && count == 2) {
    double copy_a[7], copy_b[7];
    const double* a = numbers_of(args[0], 7, copy_a);
    const double* b = a ? numbers_of(args[1], 7, copy_b) : nullptr;
    bc_nearest nearest;
    nearest.size = sizeof nearest;
    if (b && kernel->nearest_pair(setup->pair(a, b), nearest))
      return Nearest::make(nearest_type, std::move(nearest));
  }
  Owned general(made(PyObject_GetAttr(self, name_distance_general)));
  return PyObject_Vectorcall(general.get(), args, size_t(count), names);
}

inline PyObject* solver_distance_batch(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = Holder<PairSolver>::of(self).setup.get();
  PlainBatch plain;
  if (setup && plain.read(args, keywords, *setup, false)) {
    NearestArrays found{plain.count};
    if (found.find(*kernel, plain.rows, plain.threads) < 0) return found.release();
  }
  return call_method(self, name_distance_batch_general, args, keywords);
}

inline PyMethodDef solver_methods[] = {
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
    {"distance", method<solver_distance>(), METH_FASTCALL | METH_KEYWORDS,
     "distance($self, pose_a, pose_b)\n--\n\n"
     "Return how far boxes at two poses (7,) are apart, and between which points: a Nearest.\n\n"
     "Boxes in contact have the distance 0, and the contact point and normal of model exact."},
    {"distance_batch", method<solver_distance_batch>(), METH_VARARGS | METH_KEYWORDS,
     "distance_batch($self, poses_a, poses_b=None, *, size_a=None, size_b=None, sizes=None, "
     "pairs=None, threads=1)\n--\n\n"
     "Return the Nearests of n pairs: row i is what `distance` gives for row i.\n\n"
     "Poses, sizes, pairs and threads are those of `batch`."},
    {nullptr, nullptr, 0, nullptr}};
inline PyType_Slot solver_slots[] = {
    {Py_tp_doc,
     const_cast<char*>(
         "PairSolver(model, size_a=None, size_b=None, margin=0.0)\n--\n\n"
         "Solve pairs of boxes by an Exact, an Mlp or a Paper; model None leaves all to Python.\n\n"
         "A call with two poses (7,) returns a Contact, and batch(poses_a, poses_b) returns "
         "Contacts. What is no plain array, tuple or list of numbers, and what is refused, goes to "
         "self._call_general(pose_a, pose_b) and self._batch_general(...).")},
    {Py_tp_new, slot<solver_new>()},
    {Py_tp_init, slot<solver_init>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<PairSolver>::dealloc)},
    {Py_tp_call, slot<solver_call>()},
    {Py_tp_methods, solver_methods},
    {0, nullptr}};

inline PyType_Spec solver_spec = {"box_contact_ros.core._native.PairSolver",
                                  sizeof(Holder<PairSolver>), 0,
                                  Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, solver_slots};

}  // namespace box_contact::binding
