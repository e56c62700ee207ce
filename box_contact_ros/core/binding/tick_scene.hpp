// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What a tick is answered by, from arguments of Python's: boxes, and what their pairs are called.
#pragma once

#include <string_view>
#include <unordered_map>
#include <vector>

#include "index.hpp"
#include "pair_solver.hpp"

namespace box_contact::binding {

inline PyTypeObject* solver_type = nullptr;

// UTF-8 that lives as long as the text.
inline std::string_view utf8_of(PyObject* text) {
  Py_ssize_t length;
  const char* begin = PyUnicode_AsUTF8AndSize(text, &length);
  return begin ? std::string_view(begin, size_t(length)) : throw PythonError{};
}

// A tuple of any objects: what is no text is refused where it is written.
inline Owned tuple_of(PyObject* given, const char* name, npy_intp length) {
  if (PyTuple_Check(given) && PyTuple_GET_SIZE(given) == length) return Owned(Py_NewRef(given));
  PyErr_Format(PyExc_ValueError, "%s must be a tuple of %zd", name, length);
  throw PythonError{};
}

// The boxes of a scene, and what is known of their pairs by name. Nothing changes from tick to tick
// but the poses of what moves.
struct TickScene {
  Owned movers, solver;
  double margin;                // [m]
  Py_ssize_t most_near;         // pairs that are left to the model
  std::vector<double> sizes;    // (n, 3) [m]
  std::vector<double> poses;    // (m, 7) of boxes, of bodies, and of what moves no more
  std::vector<int64_t> moving;  // rows of `poses` that a tick has, in its order
  std::vector<int64_t> bodies;  // (n,) rows of the boxes' bodies, or −1
  std::vector<double> local;    // (n, 7) the boxes' poses in the bodies' frames
  Owned names, labels, topics, frame_id;
  struct Pair {
    PyObject* label = nullptr;   // of a listed one
    PyObject* topics = nullptr;  // what the caller knows its topics by
    int64_t movers[2] = {};      // places in a tick of what moves its boxes; −1: fixed
  };
  std::unordered_map<uint64_t, Pair> pairs;  // of those that have a label or topics
  unsigned int epoch;
  unsigned long long revision;

  npy_intp count() const { return npy_intp(sizes.size() / 3); }
  static uint64_t key_of(const int64_t* pair) {
    return uint64_t(pair[0]) << 32 | uint64_t(pair[1]);
  }
  const Pair* find(const int64_t* pair) const {
    auto found = pairs.empty() ? pairs.end() : pairs.find(key_of(pair));
    return found == pairs.end() ? nullptr : &found->second;
  }
  PyObject* name(int64_t box) const { return PyTuple_GET_ITEM(names.get(), box); }
};

template <class Number>
std::vector<Number> copy_of(const Array<Number>& array) {
  return {array.numbers, array.numbers + PyArray_SIZE(array.array())};
}
inline void check_places(const Array<int64_t>& places, const char* name, int64_t low, int64_t end) {
  for (int64_t place : copy_of(places))
    if (place < low || place >= end) {
      PyErr_Format(PyExc_ValueError, "%s has %lld, which is no place", name, (long long)place);
      throw PythonError{};
    }
}

// Read the arguments of a TickWriter.
inline TickScene read_scene(PyObject* args) {
  PyObject *movers, *solver, *sizes_given, *poses_given, *moving_given, *bodies_given;
  PyObject *local_given, *names, *listed_given, *labels, *watched_given, *topics, *frame_id;
  TickScene scene;
  if (!PyArg_ParseTuple(args, "O!O!dnOOOOOOOOOOUIK:TickWriter", movers_type, &movers,
                        solver_type, &solver, &scene.margin, &scene.most_near, &sizes_given,
                        &poses_given, &moving_given, &bodies_given, &local_given, &names,
                        &listed_given, &labels, &watched_given, &topics, &frame_id,
                        &scene.epoch, &scene.revision))
    throw PythonError{};
  npy_intp count = Holder<Movers>::of(movers).count;
  auto sizes = read<double>(sizes_given, "sizes", {count, 3});
  auto poses = read<double>(poses_given, "poses", {any_length, 7});
  npy_intp rows = poses.length(0);
  auto moving = read<int64_t>(moving_given, "moving", {any_length});
  auto bodies = read<int64_t>(bodies_given, "bodies", {any_length});
  auto local = read<double>(local_given, "local", {bodies.length(0), 7});
  if (rows < count || bodies.length(0) > count)
    fail(PyExc_ValueError, "poses are fewer than boxes, or bodies more");
  auto listed = read<int64_t>(listed_given, "listed", {any_length, 2});
  auto watched = read<int64_t>(watched_given, "watched", {any_length, 4});
  check_places(moving, "moving", 0, rows);
  check_places(bodies, "bodies", -1, rows);
  check_places(listed, "listed", 0, count);
  scene.names = tuple_of(names, "names", count);
  scene.labels = tuple_of(labels, "labels", listed.length(0));
  scene.topics = tuple_of(topics, "topics", watched.length(0));
  for (npy_intp k = 0; k < listed.length(0); ++k)
    scene.pairs[TickScene::key_of(listed.numbers + 2 * k)].label = PyTuple_GET_ITEM(labels, k);
  for (npy_intp k = 0; k < watched.length(0); ++k) {
    const int64_t* row = watched.numbers + 4 * k;
    TickScene::Pair& pair = scene.pairs[TickScene::key_of(row)];
    pair.topics = PyTuple_GET_ITEM(topics, k);
    std::copy_n(row + 2, 2, pair.movers);
  }
  scene.movers.reset(Py_NewRef(movers));
  scene.solver.reset(Py_NewRef(solver));
  scene.frame_id.reset(Py_NewRef(frame_id));
  scene.sizes = copy_of(sizes);
  scene.poses = copy_of(poses);
  scene.moving = copy_of(moving);
  scene.bodies = copy_of(bodies);
  scene.local = copy_of(local);
  return scene;
}

}  // namespace box_contact::binding
