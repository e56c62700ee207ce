// The core as a Python extension. It is compiled once for each instruction set, under the name
// BOX_CONTACT_MODULE; core/__init__.py imports the best one that the machine can run.
//
// Arrays are checked here for kind and shape only. Words about refused values are made in Python,
// which is told the row.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <system_error>
#include <thread>

#include "../src/mlp.hpp"
#include "arrays.hpp"  // first, as Python.h wants
#include "bounding_boxes.hpp"
#include "stages.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::binding;

#if defined(__AVX512F__)
constexpr int lanes = 8;
constexpr const char* instruction_set = "AVX-512";
#elif defined(__AVX2__)
constexpr int lanes = 4;
constexpr const char* instruction_set = "AVX2";
#else
constexpr int lanes = 2;
#if defined(__aarch64__)
constexpr const char* instruction_set = "NEON";
#else
constexpr const char* instruction_set = "baseline";
#endif
#endif
using Block = Lanes<double, lanes>;

// Rows that a thread takes at a time: some 100 µs of work, and whole blocks.
constexpr long rows_per_chunk = 512;
static_assert(rows_per_chunk % (2 * lanes) == 0, "rows share vectors as in one thread");

PyTypeObject* contact_type = nullptr;  // the NamedTuple that `use_contact_type` was given
PyObject* name_converted = nullptr;    // of the method for poses that are no plain arrays

// The numbers of a float64 array (n,) that lies in order, or nullptr.
const double* plain_numbers(PyObject* object, npy_intp n) {
  if (!PyArray_Check(object)) return nullptr;
  auto* array = reinterpret_cast<PyArrayObject*>(object);
  bool plain = PyArray_TYPE(array) == NPY_DOUBLE && PyArray_NDIM(array) == 1 &&
               PyArray_DIM(array, 0) == n && PyArray_ISCARRAY_RO(array);
  return plain ? static_cast<const double*>(PyArray_DATA(array)) : nullptr;
}

// Rows of pairs, as arrays that stay alive.
struct PairArrays {
  Array<double> poses_a, poses_b, sizes_a, sizes_b;
  npy_intp count = 0;
  Rows rows{};
};

bool read_pairs(PyObject* const* args, PairArrays& pairs) {
  if (!read(args[0], "poses_a", {any_length, 7}, pairs.poses_a)) return false;
  pairs.count = pairs.poses_a.length(0);
  if (!read(args[1], "poses_b", {pairs.count, 7}, pairs.poses_b) ||
      !read(args[2], "sizes_a", {any_length, 3}, pairs.sizes_a) ||
      !read(args[3], "sizes_b", {any_length, 3}, pairs.sizes_b))
    return false;
  for (const Array<double>* sizes : {&pairs.sizes_a, &pairs.sizes_b})
    if (sizes->length(0) != 1 && sizes->length(0) != pairs.count)
      return fail(PyExc_ValueError, "sizes must be as many as poses, or one");
  auto step = [](const Array<double>& sizes) { return sizes.length(0) == 1 ? 0L : 3L; };
  pairs.rows = {pairs.poses_a.numbers, pairs.poses_b.numbers, pairs.sizes_a.numbers,
                pairs.sizes_b.numbers, step(pairs.sizes_a),   step(pairs.sizes_b)};
  return true;
}

// A network from a float32 array: the outputs' biases, then the numbers of each unit. Leaves
// `network` empty for None.
bool read_network(PyObject* object, std::unique_ptr<Network>& network) {
  if (object == Py_None) return true;
  Array<float> array;
  if (!read(object, "network", {any_length}, array)) return false;
  constexpr npy_intp per_unit = sizeof(Network::Unit) / sizeof(float);
  npy_intp of_units = array.length(0) - site_outputs;
  if (of_units < 0 || of_units % per_unit != 0)
    return fail(PyExc_ValueError, "a network has 7 + 20 · units numbers");
  network = std::make_unique<Network>();
  network->units.resize(of_units / per_unit);
  std::memcpy(network->output_bias, array.numbers, sizeof(network->output_bias));
  std::memcpy(network->units.data(), array.numbers + site_outputs, of_units * sizeof(float));
  return true;
}

// --- PairSolver ---------------------------------------------------------------------------------

enum class Model { none, exact, mlp, mlp_by_edges };

struct PairSolver {
  PyObject_HEAD Model model;
  Vec<double> half_a, half_b;  // of single calls
  Network* network;
  std::atomic<long> clipped, exact;
};

// Call `run` with the solver's model, which is not `none`.
template <class Run>
auto with_model(const PairSolver& solver, Run run) {
  switch (solver.model) {
    case Model::mlp:
      return run(MlpModel{*solver.network});
    case Model::mlp_by_edges:
      return run(MlpModelBy<Network::Bounds::edges>{*solver.network});
    default:
      return run(ExactModel{});
  }
}

PairSolver* solver_of(PyObject* object) { return reinterpret_cast<PairSolver*>(object); }

// A new array of 3, or of 3 × 3 numbers.
PyObject* new_array(const double* numbers, int dimensions) {
  npy_intp shape[] = {3, 3};
  PyObject* array = PyArray_SimpleNew(dimensions, shape, NPY_DOUBLE);
  if (array)
    std::memcpy(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array)), numbers,
                (dimensions == 1 ? 3 : 9) * sizeof(double));
  return array;
}

PyObject* new_contact(const Contact& contact) {
  PyObject* fields[] = {PyBool_FromLong(contact.colliding), PyFloat_FromDouble(contact.separation),
                        new_array(contact.normal.v, 1),     new_array(contact.point.v, 1),
                        PyFloat_FromDouble(contact.volume), new_array(contact.covariance[0], 2)};
  constexpr Py_ssize_t count = sizeof(fields) / sizeof(fields[0]);
  PyObject* tuple = contact_type->tp_alloc(contact_type, count);
  for (Py_ssize_t k = 0; k < count; ++k) {
    if (!tuple || !fields[k]) {
      for (Py_ssize_t rest = k; rest < count; ++rest) Py_XDECREF(fields[rest]);
      Py_XDECREF(tuple);
      return nullptr;
    }
    PyTuple_SET_ITEM(tuple, k, fields[k]);
  }
  return tuple;
}

PyObject* solver_call(PyObject* self, PyObject* args, PyObject* keywords) {
  auto* solver = solver_of(self);
  if (solver->model != Model::none && !keywords && PyTuple_GET_SIZE(args) == 2) {
    const double* a = plain_numbers(PyTuple_GET_ITEM(args, 0), 7);
    const double* b = plain_numbers(PyTuple_GET_ITEM(args, 1), 7);
    if (a && b) {
      Contact contact;
      Counts counts;
      bool solved = with_model(*solver, [&](const auto& model) {
        return solve_one(model, a, b, solver->half_a, solver->half_b, contact, counts);
      });
      if (counts.clipped) solver->clipped += counts.clipped;
      if (counts.exact) solver->exact += counts.exact;
      if (solved) return new_contact(contact);
    }
  }
  Owned method(PyObject_GetAttr(self, name_converted));
  return method ? PyObject_Call(method.get(), args, keywords) : nullptr;
}

int solver_init(PyObject* self, PyObject* args, PyObject* keywords) {
  const char* model;
  double a[3], b[3];
  PyObject* weights = Py_None;
  static const char* names[] = {"model", "size_a", "size_b", "network", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "z(ddd)(ddd)|O", const_cast<char**>(names),
                                   &model, a, a + 1, a + 2, b, b + 1, b + 2, &weights))
    return -1;
  std::unique_ptr<Network> network;
  if (!read_network(weights, network)) return -1;
  std::string name = model ? model : "";
  Model chosen = name == "exact"       ? Model::exact
                 : name == "mlp"       ? Model::mlp
                 : name == "mlp-edges" ? Model::mlp_by_edges
                                       : Model::none;
  bool known = name.empty() || chosen != Model::none;
  if (!known || bool(network) != (chosen == Model::mlp || chosen == Model::mlp_by_edges)) {
    fail(PyExc_ValueError, "model is 'exact', 'mlp' or 'mlp-edges' with a network, or None");
    return -1;
  }
  auto* solver = solver_of(self);
  solver->model = chosen;
  for (int k = 0; k < 3; ++k) solver->half_a[k] = 0.5 * a[k], solver->half_b[k] = 0.5 * b[k];
  delete solver->network;
  solver->network = network.release();
  solver->clipped = solver->exact = 0;
  return 0;
}

void solver_dealloc(PyObject* self) {
  PyTypeObject* type = Py_TYPE(self);
  delete solver_of(self)->network;
  type->tp_free(self);
  Py_DECREF(type);  // an object of a heap type keeps its type alive
}

// Solve all rows, in as many threads as are asked for and worth it. Each takes the next chunk until
// none is left: a thread that starts late costs little. Rows are independent, so no bit depends on
// the number of threads. Returns the first row that is refused, or −1.
template <class M>
long solve_in_threads(const M& model, const PairArrays& pairs, const Results& results, long threads,
                      Counts& counts) {
  long chunks = (pairs.count + rows_per_chunk - 1) / rows_per_chunk;
  threads = std::max(1L, std::min(threads, chunks));
  std::vector<Counts> counts_of(threads);
  std::vector<long> refused_of(threads, pairs.count);
  std::atomic<long> next{0};
  auto work = [&](long thread) {
    for (long chunk = next++; chunk < chunks; chunk = next++) {
      long begin = chunk * rows_per_chunk,
           end = std::min(begin + rows_per_chunk, long(pairs.count));
      long refused = solve_rows<Block>(model, pairs.rows, begin, end, results, counts_of[thread]);
      if (refused >= 0) refused_of[thread] = std::min(refused_of[thread], refused);
    }
  };
  std::vector<std::thread> others;
  try {
    for (long thread = 1; thread < threads; ++thread) others.emplace_back(work, thread);
  } catch (const std::system_error&) {
    // No more threads are to be had: those that run take all chunks.
  }
  work(0);
  for (std::thread& other : others) other.join();
  for (const Counts& part : counts_of) counts += part;
  long refused = *std::min_element(refused_of.begin(), refused_of.end());
  return refused < pairs.count ? refused : -1;
}

PyObject* solver_solve(PyObject* self, PyObject* const* args, Py_ssize_t count) {
  auto* solver = solver_of(self);
  if (count != 5 || solver->model == Model::none) {
    return fail(PyExc_TypeError, "solve(poses_a, poses_b, sizes_a, sizes_b, threads)");
  }
  PairArrays pairs;
  long threads = PyLong_AsLong(args[4]);
  if ((threads == -1 && PyErr_Occurred()) || !read_pairs(args, pairs)) return nullptr;
  Array<bool> colliding;
  Array<double> separation, normal, point, volume, covariance;
  if (!make({pairs.count}, colliding) || !make({pairs.count}, separation) ||
      !make({pairs.count, 3}, normal) || !make({pairs.count, 3}, point) ||
      !make({pairs.count}, volume) || !make({pairs.count, 3, 3}, covariance))
    return nullptr;
  Results results{colliding.numbers, separation.numbers, normal.numbers,
                  point.numbers,     volume.numbers,     covariance.numbers};
  Counts counts;
  long refused;
  Py_BEGIN_ALLOW_THREADS;
  refused = with_model(*solver, [&](const auto& model) {
    return solve_in_threads(model, pairs, results, threads, counts);
  });
  Py_END_ALLOW_THREADS;
  if (refused < 0) solver->clipped += counts.clipped, solver->exact += counts.exact;
  return Py_BuildValue("(NNNNNNl)", colliding.object.release(), separation.object.release(),
                       normal.object.release(), point.object.release(), volume.object.release(),
                       covariance.object.release(), refused);
}

PyObject* solver_clipped(PyObject* self, void*) {
  return PyLong_FromLong(solver_of(self)->clipped);
}
PyObject* solver_exact(PyObject* self, void*) { return PyLong_FromLong(solver_of(self)->exact); }

PyMethodDef solver_methods[] = {
    {"solve", fastcall(solver_solve), METH_FASTCALL,
     "solve(poses_a, poses_b, sizes_a, sizes_b, threads)\n--\n\n"
     "Return colliding, separation, normal, point, volume, covariance, and the first refused row "
     "or -1.\n\n"
     "poses (n, 7), sizes (n, 3) or (1, 3) full extents [m]; frame: that of the poses."},
    {nullptr, nullptr, 0, nullptr}};
PyGetSetDef solver_attributes[] = {
    {"clipped", solver_clipped, nullptr, "Contacts of model exact that were clipped.", nullptr},
    {"answered_exactly", solver_exact, nullptr, "Contacts of model mlp outside its range.",
     nullptr},
    {nullptr, nullptr, nullptr, nullptr, nullptr}};

PyType_Slot solver_slots[] = {
    {Py_tp_doc, const_cast<char*>(
                    "PairSolver(model, size_a, size_b, network=None)\n--\n\n"
                    "Solve pairs of boxes by model 'exact' or 'mlp'; None leaves all to Python.\n\n"
                    "A call with two poses, float64 (7,), returns a Contact. For other poses, and "
                    "for those that are refused, it returns self.converted(pose_a, pose_b).")},
    {Py_tp_new, reinterpret_cast<void*>(PyType_GenericNew)},
    {Py_tp_init, reinterpret_cast<void*>(solver_init)},
    {Py_tp_dealloc, reinterpret_cast<void*>(solver_dealloc)},
    {Py_tp_call, reinterpret_cast<void*>(solver_call)},
    {Py_tp_methods, solver_methods},
    {Py_tp_getset, solver_attributes},
    {0, nullptr}};

// --- functions ----------------------------------------------------------------------------------

PyObject* use_contact_type(PyObject*, PyObject* type) {
  if (!PyType_Check(type) ||
      !PyType_IsSubtype(reinterpret_cast<PyTypeObject*>(type), &PyTuple_Type)) {
    return fail(PyExc_TypeError, "a named tuple type is needed");
  }
  Py_INCREF(type);
  Py_XDECREF(reinterpret_cast<PyObject*>(contact_type));
  contact_type = reinterpret_cast<PyTypeObject*>(type);
  Py_RETURN_NONE;
}

PyObject* stages(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 7 || !PySequence_Check(args[5])) {
    return fail(PyExc_TypeError,
                "stages(poses_a, poses_b, sizes_a, sizes_b, network, names, by_edges)");
  }
  PairArrays pairs;
  std::unique_ptr<Network> network;
  int by_edges = PyObject_IsTrue(args[6]);
  if (by_edges < 0 || !read_pairs(args, pairs) || !read_network(args[4], network)) return nullptr;
  Owned found(PyDict_New());
  if (!found) return nullptr;
  StageArrays arrays;
  bool filled = true;
  arrays.each([&](const char* name, auto*& place, std::initializer_list<npy_intp> shape) {
    using Number = std::decay_t<decltype(*place)>;
    Owned key(PyUnicode_FromString(name));
    int asked = key ? PySequence_Contains(args[5], key.get()) : -1;
    if (asked <= 0) {
      filled &= asked == 0;
      return;
    }
    npy_intp dimensions[4] = {pairs.count};
    std::copy(shape.begin(), shape.end(), dimensions + 1);
    Array<Number> array;
    array.take(PyArray_SimpleNew(1 + int(shape.size()), dimensions, numpy_type<Number>));
    filled =
        filled && array.object && PyDict_SetItem(found.get(), key.get(), array.object.get()) == 0;
    if (filled) place = array.numbers;
  });
  if (!filled) return nullptr;
  long refused = -1;
  Py_BEGIN_ALLOW_THREADS;
  for (long row = 0; row < pairs.count && refused < 0; ++row) {
    bool filled_row =
        by_edges ? fill_stages<Network::Bounds::edges>(pairs.rows, row, network.get(), arrays)
                 : fill_stages<Network::Bounds::slab>(pairs.rows, row, network.get(), arrays);
    if (!filled_row) refused = row;
  }
  Py_END_ALLOW_THREADS;
  return Py_BuildValue("(Nl)", found.release(), refused);
}

// A writable array of a type, or nullptr with a Python error.
PyArrayObject* in_place(PyObject* object, int type) {
  if (PyArray_Check(object)) {
    auto* array = reinterpret_cast<PyArrayObject*>(object);
    if (PyArray_TYPE(array) == type && PyArray_ISCARRAY(array)) return array;
  }
  fail(PyExc_TypeError, "near_pairs works in place on arrays of its own types");
  return nullptr;
}

PyObject* near_pairs(PyObject*, PyObject* const* args, Py_ssize_t count) {
  constexpr int types[] = {NPY_DOUBLE, NPY_DOUBLE, NPY_INT64, NPY_DOUBLE, NPY_DOUBLE,
                           NPY_BOOL,   NPY_INT64,  NPY_INT64, NPY_INT64,  NPY_INT64};
  if (count != 10) {
    return fail(PyExc_TypeError,
                "near_pairs(poses, sizes, moved, low, high, known, first, second, near, unknown)");
  }
  PyArrayObject* arrays[10];
  for (int k = 0; k < 10; ++k)
    if (!(arrays[k] = in_place(args[k], types[k]))) return nullptr;
  auto numbers = [&](int k) { return static_cast<double*>(PyArray_DATA(arrays[k])); };
  auto integers = [&](int k) { return static_cast<int64_t*>(PyArray_DATA(arrays[k])); };
  BoundingBoxes boxes{numbers(0), numbers(1), numbers(3), numbers(4)};
  const bool* known = static_cast<const bool*>(PyArray_DATA(arrays[5]));
  const int64_t *moved = integers(2), *first = integers(6), *second = integers(7);
  int64_t *near = integers(8), *unknown = integers(9);
  npy_intp left = 0, left_out = 0;
  for (npy_intp i = 0; i < PyArray_SIZE(arrays[2]); ++i)
    if (known[moved[i]] && !boxes.update(moved[i])) return Py_BuildValue("(iL)", -1, moved[i]);
  for (npy_intp i = 0; i < PyArray_SIZE(arrays[6]); ++i) {
    if (!known[first[i]] || !known[second[i]]) {
      unknown[left_out++] = i;
    } else if (boxes.are_near(first[i], second[i])) {
      near[left++] = i;
    }
  }
  return Py_BuildValue("(nn)", left, left_out);
}

// near_boxes(low, high, known, moves): all near pairs of boxes, whichever are listed.
PyObject* near_boxes(PyObject*, PyObject* const* args, Py_ssize_t count) {
  Array<double> low, high;
  Array<bool> known, moves;
  if (count != 4) return fail(PyExc_TypeError, "near_boxes(low, high, known, moves)");
  if (!read(args[0], "low", {any_length, 3}, low)) return nullptr;
  npy_intp n = low.length(0);
  if (!read(args[1], "high", {n, 3}, high) || !read(args[2], "known", {n}, known) ||
      !read(args[3], "moves", {n}, moves))
    return nullptr;
  std::vector<int64_t> boxes, found;
  for (npy_intp box = 0; box < n; ++box)
    if (known.numbers[box]) boxes.push_back(box);
  BoundingBoxes{nullptr, nullptr, low.numbers, high.numbers}.sweep(
      boxes, moves.numbers, [&](int64_t a, int64_t b) {
        found.push_back(std::min(a, b));
        found.push_back(std::max(a, b));
      });
  Array<int64_t> pairs;
  if (!make({npy_intp(found.size() / 2), 2}, pairs)) return nullptr;
  std::copy(found.begin(), found.end(), pairs.numbers);
  return pairs.object.release();
}

// Names of the modules that this machine can run, best last.
PyObject* supported(PyObject*, PyObject*) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
    return Py_BuildValue("(sss)", "baseline", "avx2", "avx512");
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return Py_BuildValue("(ss)", "baseline", "avx2");
#endif
  return Py_BuildValue("(s)", "baseline");
}

PyMethodDef module_methods[] = {
    {"supported", supported, METH_NOARGS,
     "supported()\n--\n\nReturn the instruction sets that this machine can run, best last."},
    {"use_contact_type", use_contact_type, METH_O,
     "use_contact_type(type)\n--\n\nSet the named tuple that single calls return."},
    {"stages", fastcall(stages), METH_FASTCALL, "See core.stages."},
    {"near_pairs", fastcall(near_pairs), METH_FASTCALL,
     "near_pairs(poses, sizes, moved, low, high, known, first, second, near, unknown)\n--\n\n"
     "Write numbers of pairs that may touch, and of those without poses; return how many.\n\n"
     "Boxes `moved` are bounded anew in low, high (boxes, 3). Returns -1 and the box for no pose."},
    {"near_boxes", fastcall(near_boxes), METH_FASTCALL,
     "near_boxes(low, high, known, moves)\n--\n\n"
     "Return the pairs (n, 2) of known boxes that may touch and of which one moves, in no order.\n\n"
     "low, high (boxes, 3): bounding boxes as near_pairs leaves them."},
    {nullptr, nullptr, 0, nullptr}};

struct Constant {
  const char* name;
  double value;
};
constexpr Constant constants[] = {
    {"LENGTH_MIN", length_min},         {"LENGTH_MAX", length_max},
    {"QUATERNION_MIN", quaternion_min}, {"QUATERNION_MAX", quaternion_max},
    {"CONTACT_ULPS", contact_ulps},     {"DEPTH_FLOOR", depth_floor},
    {"ASPECT_MAX", aspect_max},         {"SIZE_RATIO_MAX", size_ratio_max},
    {"DEPTH_MAX", depth_max},           {"CENTROID_REACH", centroid_reach}};

bool add(PyObject* module, const char* name, PyObject* value) {
  Owned owned(value);
  return value && PyModule_AddObjectRef(module, name, value) == 0;
}

#define STRING_OF(name) #name
#define STRING(name) STRING_OF(name)
#define JOIN_OF(one, other) one##other
#define JOIN(one, other) JOIN_OF(one, other)

PyType_Spec solver_spec = {"box_contact_ros.core." STRING(BOX_CONTACT_MODULE) ".PairSolver",
                           sizeof(PairSolver), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                           solver_slots};
PyModuleDef module_definition = {PyModuleDef_HEAD_INIT,
                                 STRING(BOX_CONTACT_MODULE),
                                 "The native core for one instruction set.",
                                 -1,
                                 module_methods,
                                 nullptr,
                                 nullptr,
                                 nullptr,
                                 nullptr};

}  // namespace

PyMODINIT_FUNC JOIN(PyInit_, BOX_CONTACT_MODULE)() {
  import_array();
  name_converted = PyUnicode_InternFromString("converted");
  Owned module(PyModule_Create(&module_definition));
  if (!name_converted || !module) return nullptr;
  bool added = add(module.get(), "PairSolver", PyType_FromSpec(&solver_spec)) &&
               add(module.get(), "instruction_set", PyUnicode_FromString(instruction_set)) &&
               add(module.get(), "lanes", PyLong_FromLong(lanes)) &&
               add(module.get(), "compiler", PyUnicode_FromString(__VERSION__));
  for (const Constant& constant : constants)
    added = added && add(module.get(), constant.name, PyFloat_FromDouble(constant.value));
  return added ? module.release() : nullptr;
}
