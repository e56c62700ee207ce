// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The library as a Python extension: arrays, tuples and lists become rows, and contacts become tuples.
//
// Arguments are checked here for kind and shape only. What is no plain number goes to Python, which
// converts it or says what is wrong with it.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "../src/library/batch.hpp"
#include "../src/mlp/mlp_model.hpp"
#include "../src/mlp/shipped_network.hpp"
#include "arrays.hpp"  // first, as Python.h wants
#include "broad_phase.hpp"
#include "forces.hpp"
#include "patch_area.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::binding;
using detail::Counts;
using detail::Kernel;
using detail::Model;
using detail::Results;
using detail::Rows;
using detail::Solver;
using detail::StageArrays;

const Kernel* kernel = nullptr;        // of this process
PyTypeObject* contact_type = nullptr;  // tuples, until `use_contact_types` is called
PyTypeObject* contacts_type = nullptr;
PyObject* name_call_general = nullptr;  // of the methods for what is no plain array
PyObject* name_batch_general = nullptr;

// Where the environment names an unknown instruction set, core/__init__.py goes no further.
bool has_kernel() {
  return kernel || fail(PyExc_RuntimeError, "the environment names an unknown instruction set");
}

// --- Numbers ------------------------------------------------------------------------------------

// An array (n,) of float32 or float64 in any order of memory. Returns nullptr for another kind.
const double* numbers_of_array(PyArrayObject* array, int n, double* copy) {
  if (PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != n || !PyArray_ISNOTSWAPPED(array))
    return nullptr;
  int type = PyArray_TYPE(array);
  if (type == NPY_DOUBLE && PyArray_ISCARRAY_RO(array))
    return static_cast<const double*>(PyArray_DATA(array));
  if (type != NPY_DOUBLE && type != NPY_FLOAT) return nullptr;
  const char* place = PyArray_BYTES(array);
  npy_intp step = PyArray_STRIDE(array, 0);
  for (int k = 0; k < n; ++k, place += step) {
    if (type == NPY_DOUBLE) {
      std::memcpy(copy + k, place, sizeof(double));
    } else {
      float number;
      std::memcpy(&number, place, sizeof number);
      copy[k] = number;
    }
  }
  return copy;
}

// `n` numbers: an array, or a tuple or list of Python's own floats and integers. Others return
// nullptr, without an error.
const double* numbers_of(PyObject* object, int n, double* copy) {
  if (PyArray_CheckExact(object))
    return numbers_of_array(reinterpret_cast<PyArrayObject*>(object), n, copy);
  bool is_tuple = PyTuple_Check(object);
  if ((!is_tuple && !PyList_Check(object)) || Py_SIZE(object) != n) return nullptr;
  for (int k = 0; k < n; ++k) {
    PyObject* item = is_tuple ? PyTuple_GET_ITEM(object, k) : PyList_GET_ITEM(object, k);
    if (PyFloat_Check(item)) {
      copy[k] = PyFloat_AS_DOUBLE(item);
    } else if (PyLong_CheckExact(item)) {
      copy[k] = PyLong_AsDouble(item);
      if (copy[k] == -1.0 && PyErr_Occurred()) return PyErr_Clear(), nullptr;
    } else {
      return nullptr;
    }
  }
  return copy;
}

// Rows (count, columns) of a float64 array that lies in order, or nullptr. `count` −1: any.
const double* plain_rows(PyObject* object, npy_intp& count, npy_intp columns) {
  if (!PyArray_CheckExact(object)) return nullptr;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  bool plain = PyArray_TYPE(array) == NPY_DOUBLE && PyArray_NDIM(array) == 2 &&
               PyArray_DIM(array, 1) == columns && PyArray_ISCARRAY_RO(array) &&
               (count < 0 || PyArray_DIM(array, 0) == count);
  if (!plain) return nullptr;
  count = PyArray_DIM(array, 0);
  return static_cast<const double*>(PyArray_DATA(array));
}

// Rows of pairs, as arrays that stay alive.
struct PairArrays {
  Array<double> poses_a, poses_b, sizes_a, sizes_b;
  Array<int64_t> places;
  npy_intp count = 0;
  Rows rows{};
};

// Read (poses_a, poses_b, sizes_a, sizes_b); `places` None, or the pairs (n, 2).
bool read_pairs(PyObject* const* args, PyObject* places, PairArrays& pairs) {
  if (!read(args[0], "poses_a", {any_length, 7}, pairs.poses_a)) return false;
  npy_intp poses = pairs.poses_a.length(0);
  if (!read(args[1], "poses_b", {poses, 7}, pairs.poses_b) ||
      !read(args[2], "sizes_a", {any_length, 3}, pairs.sizes_a) ||
      !read(args[3], "sizes_b", {any_length, 3}, pairs.sizes_b))
    return false;
  for (const Array<double>* sizes : {&pairs.sizes_a, &pairs.sizes_b})
    if (sizes->length(0) != 1 && sizes->length(0) != poses)
      return fail(PyExc_ValueError, "sizes must be as many as poses, or one");
  auto step = [](const Array<double>& sizes) { return sizes.length(0) == 1 ? 0L : 3L; };
  pairs.rows = {pairs.poses_a.numbers,
                pairs.poses_b.numbers,
                pairs.sizes_a.numbers,
                pairs.sizes_b.numbers,
                step(pairs.sizes_a),
                step(pairs.sizes_b),
                nullptr,
                poses};
  pairs.count = poses;
  if (places == Py_None) return true;
  if (!read(places, "pairs", {any_length, 2}, pairs.places)) return false;
  pairs.count = pairs.places.length(0);
  pairs.rows.pairs = pairs.places.numbers;
  for (npy_intp k = 0; k < 2 * pairs.count; ++k)
    if (pairs.places.numbers[k] < 0 || pairs.places.numbers[k] >= poses) {
      PyErr_Format(PyExc_ValueError, "pairs[%zd] has the place %lld, which no pose has", k / 2,
                   (long long)pairs.places.numbers[k]);
      return false;
    }
  return true;
}

// Whether a weight is believed: trained ones stay below 1e2, a flipped exponent bit does not.
bool is_weight(float number) { return std::fabs(number) <= 1e4F; }

// A network from a float32 array. Leaves `network` empty for None.
bool read_network(PyObject* object, std::vector<float>& network) {
  if (object == Py_None) return true;
  Array<float> array;
  if (!read(object, "network", {any_length}, array)) return false;
  if (!std::all_of(array.numbers, array.numbers + array.length(0), is_weight))
    return fail(PyExc_ValueError, "the network has a weight that is not within -1e4 to 1e4");
  network.assign(array.numbers, array.numbers + array.length(0));
  return true;
}

// --- Contacts -----------------------------------------------------------------------------------

// A new tuple of a type; takes over the fields, and some of them may be nullptr.
template <Py_ssize_t count>
PyObject* new_tuple(PyTypeObject* type, PyObject* const (&fields)[count]) {
  bool complete = true;
  for (PyObject* field : fields) complete &= field != nullptr;
  PyObject* tuple = complete ? type->tp_alloc(type, count) : nullptr;
  for (Py_ssize_t k = 0; k < count; ++k) {
    if (tuple) {
      PyTuple_SET_ITEM(tuple, k, fields[k]);
    } else {
      Py_XDECREF(fields[k]);
    }
  }
  return tuple;
}

// A new array of 3, or of 3 × 3 numbers.
PyObject* new_array(const double* numbers, int dimensions) {
  npy_intp shape[] = {3, 3};
  PyObject* array = PyArray_SimpleNew(dimensions, shape, NPY_DOUBLE);
  if (array)
    std::memcpy(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array)), numbers,
                (dimensions == 1 ? 3 : 9) * sizeof(double));
  return array;
}

PyObject* new_contact(const bc_contact& contact) {
  PyObject* const fields[] = {
      PyBool_FromLong(contact.colliding), PyFloat_FromDouble(contact.separation),
      new_array(contact.normal, 1),       new_array(contact.point, 1),
      PyFloat_FromDouble(contact.volume), new_array(contact.covariance[0], 2),
      PyLong_FromLong(contact.axis)};
  return new_tuple(contact_type, fields);
}

// Arrays of a row for each pair.
struct ContactArrays {
  Array<bool> colliding;
  Array<double> separation, normal, point, volume, covariance;
  Array<int32_t> axis;

  bool make_for(npy_intp count, bool patch) {
    return make({count}, colliding) && make({count}, separation) && make({count, 3}, normal) &&
           make({count, 3}, point) && make({count}, volume) && make({count}, axis) &&
           (patch ? make({count, 3, 3}, covariance) : make_unknown(count));
  }
  Results results(bool patch) const {
    return {colliding.numbers,
            separation.numbers,
            normal.numbers,
            point.numbers,
            patch ? volume.numbers : nullptr,
            patch ? covariance.numbers : nullptr,
            axis.numbers,
            0.0};
  }
  // Without a patch, the volume of pairs in contact is unknown.
  void fill_volumes(npy_intp count) {
    for (npy_intp row = 0; row < count; ++row)
      volume.numbers[row] = colliding.numbers[row] ? unknown : 0.0;
  }
  PyObject* release(PyTypeObject* type) {
    PyObject* const fields[] = {colliding.object.release(), separation.object.release(),
                                normal.object.release(),    point.object.release(),
                                volume.object.release(),    covariance.object.release(),
                                axis.object.release()};
    return new_tuple(type, fields);
  }

 private:
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  // One NaN, seen in all places: read-only.
  bool make_unknown(npy_intp count) {
    npy_intp shape[] = {count, 3, 3}, steps[] = {0, 0, 0};
    covariance.take(PyArray_New(&PyArray_Type, 3, shape, NPY_DOUBLE, steps,
                                const_cast<double*>(&unknown), 0, NPY_ARRAY_ALIGNED, nullptr));
    return bool(covariance.object);
  }
};

// --- PairSolver ---------------------------------------------------------------------------------

// Who answers, the sizes of the boxes, and how many contacts took another way than most.
struct Setup {
  Model model = Model::exact;
  double size_a[3], size_b[3];  // full extents [m]
  double margin = 0.0;          // [m]
  std::vector<float> network;   // of model `mlp`
  std::atomic<long> clipped{0};

  Solver solver() const { return {kernel, model, network.data()}; }
  detail::PairNumbers pair(const double* pose_a, const double* pose_b) const {
    return {pose_a, pose_b, size_a, size_b};
  }
  Rows rows(const double* poses_a, const double* poses_b) const {
    return {poses_a, poses_b, size_a, size_b, 0, 0, nullptr};
  }
  void count(const Counts& counts) {
    if (counts.clipped) clipped += counts.clipped;
  }
};

struct PairSolver {
  PyObject_HEAD std::shared_ptr<Setup> setup;  // none: Python answers
  bool is_made;
};

PairSolver* self_of(PyObject* object) { return reinterpret_cast<PairSolver*>(object); }

PyObject* call_method(PyObject* self, PyObject* name, PyObject* args, PyObject* keywords) {
  Owned method(PyObject_GetAttr(self, name));
  return method ? PyObject_Call(method.get(), args, keywords) : nullptr;
}

PyObject* solver_call(PyObject* self, PyObject* args, PyObject* keywords) {
  Setup* setup = self_of(self)->setup.get();
  if (setup && !keywords && PyTuple_GET_SIZE(args) == 2) {
    double copy_a[7], copy_b[7];
    const double* a = numbers_of(PyTuple_GET_ITEM(args, 0), 7, copy_a);
    const double* b = a ? numbers_of(PyTuple_GET_ITEM(args, 1), 7, copy_b) : nullptr;
    bc_contact contact;
    Counts counts{};
    if (b && detail::solve_pair(setup->solver(), setup->pair(a, b), BC_COVARIANCE, setup->margin,
                                contact, counts)) {
      setup->count(counts);
      return new_contact(contact);
    }
  }
  return call_method(self, name_call_general, args, keywords);
}

// Solve rows without Python's lock. Returns the first row that is refused, or −1.
long solve(Setup& setup, const Rows& rows, npy_intp count, Results results, long threads) {
  Counts counts{};
  results.margin = setup.margin;
  long refused = without_lock([&] {
    return detail::solve_rows(setup.solver(), rows, long(count), results, threads, counts);
  });
  if (refused < 0) setup.count(counts);
  return refused;
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
    return !overflow && threads >= 1;
  }
  bool read_sizes(PyObject* value, const double*& sizes, long& step) {
    if (value == Py_None) return true;
    sizes = plain_rows(value, count, 3);
    step = 3;
    return sizes != nullptr;
  }
};

PyObject* solver_batch(PyObject* self, PyObject* args, PyObject* keywords) {
  std::shared_ptr<Setup> setup = self_of(self)->setup;
  PlainBatch plain;
  if (setup && plain.read(args, keywords, *setup)) {
    ContactArrays found;
    if (!found.make_for(plain.count, plain.patch)) return nullptr;
    long refused =
        solve(*setup, plain.rows, plain.count, found.results(plain.patch), plain.threads);
    if (!plain.patch) found.fill_volumes(plain.count);
    if (refused < 0) return found.release(contacts_type);
  }
  return call_method(self, name_batch_general, args, keywords);
}

// Whether a model has the network that it needs. A network of `mlp` has the groups of each hidden
// layer, then groups of eight units: their biases, and their weights for each input (mlp/network.hpp).
bool fits(Model model, const std::vector<float>& network) {
  if (model == Model::exact) return network.empty();
  constexpr long most = detail::network_units_max / 8;
  if (network.size() < 2) return false;
  float first = network[0], second = network[1];
  if (!(first >= 1.0F && first <= most && second >= 1.0F && second <= most)) return false;
  long groups = long(first), next = long(second);
  long units = 8 * (1 + detail::network_features) * groups + 8 * (1 + 8 * groups) * next;
  return long(network.size()) == 2 + units + 8 * (1 + 8 * next);
}

// Sizes, model and network, as `PairSolver` takes them. No network: the shipped one.
bool read_setup(PyObject* args, PyObject* keywords, Setup& setup, bool& has_model) {
  PyObject *name, *weights = Py_None;
  double *a = setup.size_a, *b = setup.size_b;
  static const char* names[] = {"model", "size_a", "size_b", "network", "margin", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O(ddd)(ddd)|Od", const_cast<char**>(names),
                                   &name, a, a + 1, a + 2, b, b + 1, b + 2, &weights,
                                   &setup.margin) ||
      !read_network(weights, setup.network))
    return false;
  auto is = [name](const char* one) {
    return PyUnicode_Check(name) && PyUnicode_CompareWithASCIIString(name, one) == 0;
  };
  has_model = name != Py_None;
  setup.model = is("mlp") ? Model::mlp : Model::exact;
  if (setup.model == Model::mlp && weights == Py_None)
    setup.network.assign(std::begin(detail::shipped_network), std::end(detail::shipped_network));
  if ((is("mlp") || is("exact") || !has_model) && fits(setup.model, setup.network))
    return has_kernel();
  return fail(PyExc_ValueError, "model is 'exact', 'mlp', or None; the network fits");
}

int solver_init(PyObject* self, PyObject* args, PyObject* keywords) {
  auto setup = std::make_shared<Setup>();
  bool has_model;
  if (!read_setup(args, keywords, *setup, has_model)) return -1;
  // Other threads may be using it.
  if (self_of(self)->is_made)
    return fail(PyExc_RuntimeError, "a solver is made once: make another"), -1;
  if (has_model) self_of(self)->setup = std::move(setup);
  self_of(self)->is_made = true;
  return 0;
}

PyObject* solver_new(PyTypeObject* type, PyObject*, PyObject*) {
  PyObject* self = type->tp_alloc(type, 0);
  if (self) new (&self_of(self)->setup) std::shared_ptr<Setup>();
  return self;
}

void solver_dealloc(PyObject* self) {
  PyTypeObject* type = Py_TYPE(self);
  self_of(self)->setup.~shared_ptr();
  type->tp_free(self);
  Py_DECREF(type);  // an object of a heap type keeps its type alive
}

PyObject* solver_solve(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  std::shared_ptr<Setup> setup = self_of(self)->setup;
  if (count < 5 || count > 7 || !setup)
    return fail(PyExc_TypeError,
                "solve(poses_a, poses_b, sizes_a, sizes_b, threads, patch=True, pairs=None)");
  PairArrays pairs;
  long threads = PyLong_AsLong(args[4]);
  if (threads == -1 && PyErr_Occurred()) return nullptr;
  int patch = count > 5 ? PyObject_IsTrue(args[5]) : 1;
  if (patch < 0) return nullptr;
  if (threads < 1) return fail(PyExc_ValueError, "threads must be 1 or more");
  if (!read_pairs(args, count > 6 ? args[6] : Py_None, pairs)) return nullptr;
  ContactArrays found;
  if (!found.make_for(pairs.count, patch)) return nullptr;
  long refused = solve(*setup, pairs.rows, pairs.count, found.results(patch), threads);
  if (!patch) found.fill_volumes(pairs.count);
  Owned contacts(found.release(&PyTuple_Type));
  return contacts ? Py_BuildValue("(Ol)", contacts.get(), refused) : nullptr;
}

PyObject* solver_clipped(PyObject* self, void*) {
  const auto& setup = self_of(self)->setup;
  return PyLong_FromLong(setup ? setup->clipped.load() : 0);
}

PyMethodDef solver_methods[] = {
    {"solve", method<solver_solve>(), METH_FASTCALL,
     "solve(poses_a, poses_b, sizes_a, sizes_b, threads, patch=True, pairs=None)\n--\n\n"
     "Return (colliding, separation, normal, point, volume, covariance, axis), and the first "
     "refused "
     "row or -1.\n\n"
     "poses (m, 7), sizes (m, 3) or (1, 3) full extents [m]; frame: that of the poses. pairs (n, "
     "2): "
     "places of the boxes of each row."},
    {"batch", method<solver_batch>(), METH_VARARGS | METH_KEYWORDS,
     "batch($self, poses_a, poses_b=None, *, size_a=None, size_b=None, sizes=None, pairs=None, "
     "threads=1, patch=True)\n--\n\n"
     "Return the contacts of n pairs: row i is what a single call gives for row i.\n\n"
     "poses_a, poses_b are (n, 7); size_a, size_b replace the solver's sizes, (3,) for all rows\n"
     "or (n, 3) for every row its own. Or poses are (m, 7), sizes (3,) or (m, 3), and the rows of\n"
     "pairs (n, 2) are the places of their boxes A and B. `threads` share the rows; no bit "
     "depends\n"
     "on their number. Without `patch` volume and covariance are not computed, and are NaN; "
     "points\n"
     "then have the same error bounds, not always the same bits."},
    {nullptr, nullptr, 0, nullptr}};
PyGetSetDef solver_attributes[] = {{"clipped", Guarded<solver_clipped>::call, nullptr,
                                    "Contacts of model exact that were clipped.", nullptr},
                                   {nullptr, nullptr, nullptr, nullptr, nullptr}};

PyType_Slot solver_slots[] = {
    {Py_tp_doc,
     const_cast<char*>(
         "PairSolver(model, size_a, size_b, network=None, margin=0.0)\n--\n\n"
         "Solve pairs of boxes by model 'exact' or 'mlp'; None leaves all to Python.\n\n"
         "A call with two poses (7,) returns a Contact, and batch(poses_a, poses_b) returns "
         "Contacts. What is no plain array, tuple or list of numbers, and what is refused, goes to "
         "self._call_general(pose_a, pose_b) and self._batch_general(...).")},
    {Py_tp_new, slot<solver_new>()},
    {Py_tp_init, slot<solver_init>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(solver_dealloc)},
    {Py_tp_call, slot<solver_call>()},
    {Py_tp_methods, solver_methods},
    {Py_tp_getset, solver_attributes},
    {0, nullptr}};

// --- Functions ----------------------------------------------------------------------------------

PyObject* use_contact_types(PyObject*, PyObject* const* args, Py_ssize_t count) {
  bool tuples = count == 2;
  for (Py_ssize_t k = 0; tuples && k < count; ++k)
    tuples = PyType_Check(args[k]) &&
             PyType_IsSubtype(reinterpret_cast<PyTypeObject*>(args[k]), &PyTuple_Type);
  if (!tuples) return fail(PyExc_TypeError, "two named tuple types are needed");
  for (auto [place, type] : {std::pair{&contact_type, args[0]}, {&contacts_type, args[1]}}) {
    Owned before(reinterpret_cast<PyObject*>(*place));
    *place = reinterpret_cast<PyTypeObject*>(Py_NewRef(type));
  }
  Py_RETURN_NONE;
}

PyObject* stages(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 5 || !PySequence_Check(args[4]))
    return fail(PyExc_TypeError, "stages(poses_a, poses_b, sizes_a, sizes_b, names)");
  PairArrays pairs;
  if (!has_kernel() || !read_pairs(args, Py_None, pairs)) return nullptr;
  Owned found(PyDict_New());
  if (!found) return nullptr;
  StageArrays arrays;
  bool filled = true;
  arrays.each([&](const char* name, auto*& place, std::initializer_list<npy_intp> shape) {
    using Number = std::decay_t<decltype(*place)>;
    if (!filled) return;
    Owned key(PyUnicode_FromString(name));
    int asked = key ? PySequence_Contains(args[4], key.get()) : -1;
    if (asked <= 0) {
      filled = asked == 0;
      return;
    }
    npy_intp dimensions[4] = {pairs.count};
    std::copy(shape.begin(), shape.end(), dimensions + 1);
    Array<Number> array;
    array.take(PyArray_SimpleNew(1 + int(shape.size()), dimensions, numpy_type<Number>));
    filled = array.object && PyDict_SetItem(found.get(), key.get(), array.object.get()) == 0;
    if (filled) place = array.numbers;
  });
  if (!filled) return nullptr;
  long refused = without_lock([&] {
    for (long row = 0; row < pairs.count; ++row)
      if (!kernel->fill_stages(pairs.rows, row, arrays)) return row;
    return -1L;
  });
  return Py_BuildValue("(Nl)", found.release(), refused);
}

PyObject* instruction_sets(PyObject*, PyObject*) {
  const auto& kernels = detail::kernels();
  Owned names(PyTuple_New(Py_ssize_t(kernels.count)));
  for (size_t k = 0; names && k < kernels.count; ++k) {
    PyObject* name = PyUnicode_FromString(kernels.all[k]->name);
    if (!name) return nullptr;
    PyTuple_SET_ITEM(names.get(), Py_ssize_t(k), name);
  }
  return names.release();
}

PyMethodDef module_methods[] = {
    {"instruction_sets", method<instruction_sets>(), METH_NOARGS,
     "instruction_sets()\n--\n\n"
     "Return the instruction sets that were built and that this machine can run, best last."},
    {"use_contact_types", method<use_contact_types>(), METH_FASTCALL,
     "use_contact_types(single, many)\n--\n\nSet the named tuples that calls and batches return."},
    {"stages", method<stages>(), METH_FASTCALL, "See core.stages."},
    {"message_numbers", method<message_numbers>(), METH_FASTCALL,
     "message_numbers(point, normal, separation, volume, covariance)\n--\n\n"
     "Return rows (n, 15) of contacts: point, normal, depth, volume, area, upper covariance."},
    {"patch_areas", method<patch_areas>(), METH_FASTCALL,
     "patch_areas(normal, covariance)\n--\n\n"
     "Return areas (n,) of normals (n, 3), covariances (n, 3, 3)."},
    {nullptr, nullptr, 0, nullptr}};

struct Whole {
  const char* name;
  long value;
};
constexpr Whole wholes[] = {{"NETWORK_FORMAT", detail::network_format},
                            {"FEATURES", detail::network_features},
                            {"OUTPUTS", detail::network_outputs},
                            {"UNITS_MAX", detail::network_units_max}};
struct Constant {
  const char* name;
  double value;
};
constexpr Constant constants[] = {
    {"LENGTH_MIN", length_min},         {"LENGTH_MAX", length_max},
    {"QUATERNION_MIN", quaternion_min}, {"QUATERNION_MAX", quaternion_max},
    {"CONTACT_ULPS", contact_ulps},     {"DEPTH_FLOOR", depth_floor}};

bool add(PyObject* module, const char* name, PyObject* value) {
  Owned owned(value);
  return value && PyModule_AddObjectRef(module, name, value) == 0;
}

PyType_Spec solver_spec = {"box_contact_ros.core._native.PairSolver", sizeof(PairSolver), 0,
                           Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, solver_slots};
PyModuleDef module_definition = {PyModuleDef_HEAD_INIT,
                                 "_native",
                                 "The native core.",
                                 -1,
                                 module_methods,
                                 nullptr,
                                 nullptr,
                                 nullptr,
                                 nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__native() {
  import_array();
  kernel = detail::chosen_kernel();
  for (auto place : {&contact_type, &contacts_type})
    *place = reinterpret_cast<PyTypeObject*>(Py_NewRef(&PyTuple_Type));
  name_call_general = PyUnicode_InternFromString("_call_general");
  name_batch_general = PyUnicode_InternFromString("_batch_general");
  Owned module(PyModule_Create(&module_definition));
  if (!name_call_general || !name_batch_general || !module) return nullptr;
  bool added =
      add(module.get(), "kernel", PyUnicode_FromString(kernel ? kernel->name : "")) &&
      add(module.get(), "instruction_set", PyUnicode_FromString(kernel ? kernel->title : "")) &&
      add(module.get(), "lanes", PyLong_FromLong(kernel ? kernel->lanes : 0)) &&
      add(module.get(), "compiler", PyUnicode_FromString(__VERSION__)) &&
      add(module.get(), "PairSolver", PyType_FromSpec(&solver_spec)) &&
      add(module.get(), "BroadPhase", PyType_FromSpec(&broad_phase_spec)) &&
      add(module.get(), "PatchForces", PyType_FromSpec(&forces_spec));
  for (const Whole& whole : wholes)
    added = added && add(module.get(), whole.name, PyLong_FromLong(whole.value));
  for (const Constant& constant : constants)
    added = added && add(module.get(), constant.name, PyFloat_FromDouble(constant.value));
  return added ? module.release() : nullptr;
}
