// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The library as a Python extension: its functions and types.
#include "../src/force/rectangle.hpp"
#include "../src/library/force_limits.hpp"
#include "../src/minimum_depth.hpp"
#include "faces.hpp"
#include "forces.hpp"
#include "message_numbers.hpp"
#include "named_poses.hpp"
#include "motion.hpp"
#include "pair_solver.hpp"
#include "pose_faults.hpp"
#include "read_pose.hpp"
#include "write_contacts.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::binding;

PyObject* instruction_sets(PyObject*, PyObject*) {
  const auto& kernels = detail::kernels();
  Owned names(made(PyTuple_New(Py_ssize_t(kernels.count))));
  for (size_t k = 0; k < kernels.count; ++k)
    PyTuple_SET_ITEM(names.get(), Py_ssize_t(k), made(PyUnicode_FromString(kernels.all[k]->name)));
  return names.release();
}

PyMethodDef module_methods[] = {
    {"instruction_sets", method<instruction_sets>(), METH_NOARGS,
     "instruction_sets()\n--\n\n"
     "Return the instruction sets that were built and that this machine can run, best last."},
    {"use_contacts", method<use_contacts>(), METH_O,
     "use_contacts(type)\n--\n\nSet the class of what batches return: with a slot for each field."},
    {"use_nearests", method<use_nearests>(), METH_O,
     "use_nearests(type)\n--\n\nSet the same of `distance_batch`."},
    {"distances", method<distances>(), METH_FASTCALL,
     "distances(a, b, size_a, size_b, threads, pairs)\n--\n\n"
     "Return Nearests, and the first refused row or -1; arguments as of the models' `solve`."},
    {"approach", method<approach>(), METH_FASTCALL,
     "approach(start_a, end_a, start_b, end_b, size_a, size_b, centre_a, centre_b, clearance, "
     "tolerance)\n--\n\n"
     "Return time, closing_speed and Nearest of one pair, or None where Python has to convert.\n\n"
     "Clearance None: of the least distance. Sizes are (1, 3), centres (3,) or None."},
    {"approaches", method<approaches>(), METH_FASTCALL,
     "approaches(starts_a, starts_b, sizes_a, sizes_b, ends_a, ends_b, centres_a, centres_b, "
     "clearance, tolerance, threads, pairs)\n--\n\n"
     "Return arrays with a row for each pair: time, closing_speed, and the fields of Nearests.\n\n"
     "Clearance None: of the least distances. Centres and pairs may be None."},
    {"pose_fault", method<pose_fault>(), METH_O,
     "pose_fault(pose)\n--\n\nReturn why seven numbers are no pose, a PoseFault; 0 if they are."},
    {"pose_faults", method<pose_faults>(), METH_O,
     "pose_faults(poses)\n--\n\nReturn the same of poses (n, 7), (n,)."},
    {"read_pose", method<read_pose>(), METH_O,
     "read_pose(data)\n--\n\n"
     "Return seven numbers, frame_id and stamp [ns] of a PoseStamped's bytes, or None."},
    {"write_poses", method<write_poses>(), METH_FASTCALL,
     "write_poses(to, rows, poses)\n--\n\n"
     "Write a list of poses (7,), or None for NaN, to rows (n,) of an array (m, 7).\n\n"
     "Return False where one is no plain array, tuple or list of numbers, or poses no list of n."},
    {"place_boxes", method<place_boxes>(), METH_FASTCALL,
     "place_boxes(rows, bodies, local)\n--\n\n"
     "Write the poses of boxes of bodies to the first n rows of an array (m, 7).\n\n"
     "bodies (n,): the row of each box's body, or -1. local (n, 7): poses in the bodies' frames.\n"
     "Return the row of a body with a bad pose, or -1. Of one with seven NaN, boxes get NaN."},
    {"message_numbers", method<message_numbers>(), METH_FASTCALL,
     "message_numbers(point, normal, separation, volume, covariance, area)\n--\n\n"
     "Return rows (n, 15) of contacts: point, normal, depth, volume, area, upper covariance."},
    {"face_areas", method<face_areas>(), METH_FASTCALL,
     "face_areas(sizes, poses, pairs)\n--\n\n"
     "Return the areas (n,) by which faces meet as messages have them; 0 where edges do."},
    {"face_patches", method<face_patches>(), METH_FASTCALL,
     "face_patches(sizes, poses, pairs, normal, tolerance)\n--\n\n"
     "Return polygon (k, 9, 3), corner_count (k,), area (k,), centre (k, 3), rectangle (k, 4, 3)."},
    {"bed_pressures", method<bed_pressures>(), METH_FASTCALL,
     "bed_pressures(polygon, corner_count, at)\n--\n\n"
     "Return the greatest pressures (k,) of unit loads at points (k, 2) on polygons (k, 9, 2)."},
    {"hull", method<hull>(), METH_FASTCALL,
     "hull(points)\n--\n\n"
     "Return the corners (h, 2) of the hull of points (p, 2), counter-clockwise."},
    {"hull_depths", method<hull_depths>(), METH_FASTCALL,
     "hull_depths(points, first, at)\n--\n\n"
     "Return how far points (n, 2) are inside hulls of points (p, 2), row k from first[k] on."},
    {nullptr, nullptr, 0, nullptr}};

PyModuleDef module_definition = {PyModuleDef_HEAD_INIT,
                                 "_native",
                                 "The native core.",
                                 -1,
                                 module_methods,
                                 nullptr,
                                 nullptr,
                                 nullptr,
                                 nullptr};

PyObject* make_module() {
  import_array1(nullptr);
  kernel = detail::chosen_kernel();
  contact_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&contact_spec)));
  nearest_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&nearest_spec)));
  exact_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&exact_spec)));
  mlp_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&mlp_spec)));
  paper_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&paper_spec)));
  name_call_general = made(PyUnicode_InternFromString("_call_general"));
  name_batch_general = made(PyUnicode_InternFromString("_batch_general"));
  name_distance_general = made(PyUnicode_InternFromString("_distance_general"));
  name_distance_batch_general = made(PyUnicode_InternFromString("_distance_batch_general"));
  Owned module(made(PyModule_Create(&module_definition)));
  auto add = [&](const char* name, PyObject* value) {
    Owned owned(made(value));
    if (PyModule_AddObjectRef(module.get(), name, value) < 0) throw PythonError{};
  };
  add("kernel", PyUnicode_FromString(kernel ? kernel->name : ""));
  add("instruction_set", PyUnicode_FromString(kernel ? kernel->title : ""));
  add("lanes", PyLong_FromLong(kernel ? kernel->lanes : 0));
  add("compiler", PyUnicode_FromString(__VERSION__));
  add("Contact", Py_NewRef(contact_type));
  add("Nearest", Py_NewRef(nearest_type));
  add("Exact", Py_NewRef(exact_type));
  add("Mlp", Py_NewRef(mlp_type));
  add("Paper", Py_NewRef(paper_type));
  solver_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&solver_spec)));
  filter_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&filter_spec)));
  index_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&index_spec)));
  movers_type = reinterpret_cast<PyTypeObject*>(made(PyType_FromSpec(&movers_spec)));
  add("PairSolver", Py_NewRef(solver_type));
  add("Filter", Py_NewRef(filter_type));
  add("Index", Py_NewRef(index_type));
  add("Movers", Py_NewRef(movers_type));
  add("Path", PyType_FromSpec(&path_spec));
  add("NamedPoses", PyType_FromSpec(&named_poses_spec));
  add("TickWriter", PyType_FromSpec(&tick_writer_spec));
  add("PatchForces", PyType_FromSpec(&forces_spec));
  using Whole = std::pair<const char*, long>;
  for (auto [name, value] : {Whole{"NETWORK_FORMAT", detail::network_format},
                             {"FEATURES", detail::network_features},
                             {"OUTPUTS", detail::network_outputs},
                             {"UNITS_MAX", detail::network_units_max},
                             {"THREADS_MAX", detail::threads_max},
                             {"SUBSTEPS_MAX", detail::substeps_max}})
    add(name, PyLong_FromLong(value));
  using Real = std::pair<const char*, double>;
  for (auto [name, value] : {Real{"LENGTH_MIN", length_min},
                             {"LENGTH_MAX", length_max},
                             {"QUATERNION_MIN", quaternion_min},
                             {"QUATERNION_MAX", quaternion_max},
                             {"MASS_MIN", detail::mass_min},
                             {"MASS_MAX", detail::mass_max},
                             {"INERTIA_SLACK", detail::inertia_slack},
                             {"SQUARE_SLACK", force::square_slack},
                             {"CONTACT_ULPS", contact_ulps},
                             {"DEPTH_FLOOR", depth_floor}})
    add(name, PyFloat_FromDouble(value));
  return module.release();
}

}  // namespace

PyMODINIT_FUNC PyInit__native() { return Guarded<make_module>::call(); }
