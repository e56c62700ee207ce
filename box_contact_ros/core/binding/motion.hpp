// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Boxes on their ways as Python asks for them: one pair, or rows of arrays.
#pragma once

#include "nearest.hpp"

namespace box_contact::binding {

// Return time, closing speed and Nearest of one pair; clearance None: of the least distance. None for what
// Python has to convert or to refuse.
inline PyObject* approach(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 10)
    fail(PyExc_TypeError,
         "approach(start_a, end_a, start_b, end_b, size_a, size_b, centre_a, centre_b, clearance, "
         "tolerance)");
  bc_sweep boxes[2] = {};
  auto take = [](PyObject* given, int n, double* to) {
    double copy[7];
    const double* numbers = numbers_of(given, n, copy);
    if (numbers) std::copy_n(numbers, n, to);
    return numbers != nullptr;
  };
  for (int of = 0; of < 2; ++of) {
    bc_sweep& box = boxes[of];
    npy_intp sizes = 1;
    const double* size = plain_rows<double>(args[4 + of], sizes, 3);
    bool is_plain = size && take(args[2 * of], 7, box.start.position) &&
                    take(args[2 * of + 1], 7, box.end.position) &&
                    (args[6 + of] == Py_None || take(args[6 + of], 3, box.centre));
    if (!is_plain) Py_RETURN_NONE;
    std::copy_n(size, 3, box.size.extent);
  }
  bool is_least = args[8] == Py_None;
  if (!PyFloat_CheckExact(args[9]) || (!is_least && !PyFloat_CheckExact(args[8]))) Py_RETURN_NONE;
  double tolerance = PyFloat_AS_DOUBLE(args[9]);
  bc_approach found{};
  found.size = sizeof found;
  bc_status status = is_least
                         ? bc_least_distance(&boxes[0], &boxes[1], tolerance, &found)
                         : bc_time_of_impact(&boxes[0], &boxes[1], PyFloat_AS_DOUBLE(args[8]),
                                             tolerance, &found);
  if (status != BC_OK) Py_RETURN_NONE;
  return Py_BuildValue("(ddN)", found.time, found.closing_speed,
                       made(Nearest::make(nearest_type, std::move(found.nearest))));
}

// Return the numbers of approaches, a row for each pair; clearance None: their least distances.
inline PyObject* approaches(PyObject*, PyObject* const* args, Py_ssize_t count) {
  if (count != 12)
    fail(PyExc_TypeError,
         "approaches(starts_a, starts_b, sizes_a, sizes_b, ends_a, ends_b, centres_a, centres_b, "
         "clearance, tolerance, threads, pairs)");
  PairArrays starts(args, args[11]);
  npy_intp poses = starts.poses_a.length(0), rows = starts.count;
  auto ends_a = read<double>(args[4], "ends_a", {poses, 7});
  auto ends_b = read<double>(args[5], "ends_b", {poses, 7});
  auto centres_a = read_given<double>(args[6], "centres_a", {poses, 3});
  auto centres_b = read_given<double>(args[7], "centres_b", {poses, 3});
  bool is_least = args[8] == Py_None;
  double clearance = is_least ? 0.0 : number_of(args[8], "clearance");
  double tolerance = number_of(args[9], "tolerance");
  int threads = int(whole_of(args[10]));
  auto pose = [](const double* numbers) { return reinterpret_cast<const bc_pose*>(numbers); };
  auto size = [](const double* numbers) { return reinterpret_cast<const bc_size*>(numbers); };
  const bc_sweep_rows asked{sizeof(bc_sweep_rows),
                            {sizeof(bc_rows), rows, poses, pose(starts.rows.poses_a),
                             pose(starts.rows.poses_b), size(starts.rows.sizes_a),
                             size(starts.rows.sizes_b), starts.sizes_a.length(0),
                             starts.sizes_b.length(0), starts.rows.pairs},
                            pose(ends_a.numbers), pose(ends_b.numbers),
                            centres_a.numbers, centres_b.numbers, nullptr};
  auto time = make<double>({rows}), closing_speed = make<double>({rows});
  auto colliding = make<bool>({rows});
  auto distance = make<double>({rows}), normal = make<double>({rows, 3});
  auto point_a = make<double>({rows, 3}), point_b = make<double>({rows, 3});
  const bc_approach_results found{
      sizeof(bc_approach_results), time.numbers, closing_speed.numbers,
      {sizeof(bc_nearest_results), colliding.numbers, distance.numbers, normal.numbers,
       point_a.numbers, point_b.numbers}};
  check(without_lock([&] {
    return is_least ? bc_least_distance_rows(&asked, tolerance, &found, threads, nullptr)
                    : bc_time_of_impact_rows(&asked, clearance, tolerance, &found, threads, nullptr);
  }));
  return pack(&PyTuple_Type, time, closing_speed, colliding, distance, normal, point_a, point_b);
}

}  // namespace box_contact::binding
