// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Class `TickWriter`: one tick of a scene in one call, from stamped poses to the bytes of messages.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "cdr.hpp"
#include "message_numbers.hpp"
#include "tick_scene.hpp"

namespace box_contact::binding {

// Numbers of pairs, in memory that is used again.
struct TickMemory {
  std::unique_ptr<bool[]> colliding;
  std::vector<double> separation, normal, point, volume, covariance;
  std::vector<double> distance, near_normal, point_a, point_b;
  std::vector<int64_t> near_pairs, stale, stamps;
  size_t room = 0;  // of `colliding`

  detail::Results results(size_t count, double margin) {
    if (count > room) colliding.reset(new bool[room = 2 * count]);
    separation.resize(count);
    volume.resize(count);
    normal.resize(3 * count);
    point.resize(3 * count);
    covariance.resize(9 * count);
    return {colliding.get(), separation.data(), normal.data(), point.data(),
            volume.data(),   covariance.data(), nullptr,       margin};
  }
  detail::NearestResults nearest_results(size_t count) {
    distance.resize(count);
    for (auto* vectors : {&near_normal, &point_a, &point_b}) vectors->resize(3 * count);
    return {nullptr, distance.data(), near_normal.data(), point_a.data(), point_b.data()};
  }
};

// Contacts of a model in Python.
struct ContactsOfPython {
  Owned object;
  npy_intp count;
  Array<uint8_t> colliding = field<uint8_t>("colliding", {count});
  Array<double> point = field<double>("point", {count, 3});
  Array<double> normal = field<double>("normal", {count, 3});
  Array<double> separation = field<double>("separation", {count});
  Array<double> volume = field<double>("volume", {count});
  Array<double> covariance = field<double>("covariance", {count, 3, 3});

 private:
  template <class Number>
  Array<Number> field(const char* name, Shape shape) const {
    Owned array(made(PyObject_GetAttrString(object.get(), name)));
    return read<Number>(array.get(), name, shape);
  }
};

class TickWriter {
 public:
  explicit TickWriter(TickScene&& scene) : scene_(std::move(scene)) {}

  // Answer the stamped poses of all that moves. Returns the message of all contacts, the topics of
  // pairs in contact with their messages, how many pairs are in contact, and the stale ones. Or
  // None: the poses are refused, and the solver says why.
  PyObject* answer(PyObject* poses) {
    if (is_busy_) fail(PyExc_RuntimeError, "a tick is answered already");
    struct Busy {
      bool& flag;
      explicit Busy(bool& f) : flag(f) { flag = true; }
      ~Busy() { flag = false; }
    } busy(is_busy_);
    if (!read_poses(poses)) Py_RETURN_NONE;
    double* rows = scene_.poses.data();
    const auto& bodies = scene_.bodies;
    if (place_boxes_of_bodies(rows, bodies.data(), npy_intp(bodies.size()), scene_.local.data()) >=
        0)
      Py_RETURN_NONE;
    bc_near near{};
    near.size = sizeof near;
    near.refused = -1;
    bc_status status =
        bc_movers_find(Holder<Movers>::of(scene_.movers.get()).made.get(),
                            reinterpret_cast<const bc_pose*>(rows), scene_.most_near, &near);
    if (near.refused < 0 || status == BC_NO_MEMORY) check(status);
    if (near.refused >= 0 || near.count > scene_.most_near) Py_RETURN_NONE;
    memory_.stale.assign(near.stale, near.stale + 2 * near.stale_count);
    return solve(near.pairs, npy_intp(near.count));
  }

 private:
  // Take the poses (7,) or None of all that moves; or one array (n, 7).
  bool read_poses(PyObject* given) {
    if (!PyList_Check(given)) fail(PyExc_TypeError, "poses are a list");
    auto streams = size_t(PyList_GET_SIZE(given));
    frame_id_ = utf8_of(scene_.frame_id.get());
    bool has_frame = !frame_id_.empty();
    memory_.stamps.assign(streams, earliest);
    newest_ = earliest;
    for (size_t k = 0; k < streams; ++k) {
      PyObject* pose = PyList_GET_ITEM(given, Py_ssize_t(k));
      PyObject* numbers = Py_None;
      if (pose != Py_None) {
        if (!PyTuple_Check(pose) || PyTuple_GET_SIZE(pose) != 3)
          fail(PyExc_TypeError, "a pose is numbers, frame_id and stamp");
        numbers = PyTuple_GET_ITEM(pose, 0);
        std::string_view frame_id = utf8_of(PyTuple_GET_ITEM(pose, 1));
        if (!has_frame) frame_id_ = frame_id, has_frame = true;
        if (frame_id != frame_id_) return false;
        int64_t stamp = memory_.stamps[k] = PyLong_AsLongLong(PyTuple_GET_ITEM(pose, 2));
        if (stamp == -1 && PyErr_Occurred()) throw PythonError{};
        newest_ = std::max(newest_, stamp);
      }
      if (!take(numbers, k, streams)) return false;
    }
    return true;
  }
  bool take(PyObject* numbers, size_t k, size_t streams) {
    const auto& moving = scene_.moving;
    auto count = npy_intp(moving.size());
    const double* rows = streams == 1 ? plain_rows<double>(numbers, count, 7) : nullptr;
    if (!rows && streams != moving.size()) return false;
    double copy[7];
    std::fill_n(copy, 7, std::numeric_limits<double>::quiet_NaN());
    if (!rows) rows = numbers == Py_None ? copy : numbers_of(numbers, 7, copy);
    if (!rows) return false;
    for (size_t row = k; row < k + moving.size() / streams; ++row)
      std::copy_n(rows + 7 * (row - k), 7, scene_.poses.data() + 7 * moving[row]);
    return true;
  }

  PyObject* solve(const int64_t* pairs, npy_intp count) {
    Setup* setup = Holder<PairSolver>::of(scene_.solver.get()).setup.get();
    bool are_sizes_known = setup && setup->has_size_a && setup->has_size_b;
    Rows rows{scene_.poses.data(),
              scene_.poses.data(),
              scene_.sizes.data(),
              scene_.sizes.data(),
              3,
              3,
              pairs,
              long(scene_.count())};
    if (!setup || (setup->model->kind == Model::paper && !are_sizes_known))
      return solve_in_python(rows, count);
    if (are_sizes_known)
      rows.sizes_a = setup->size_a, rows.sizes_b = setup->size_b,
      rows.size_step_a = rows.size_step_b = 0;
    auto results = memory_.results(size_t(count), scene_.margin);
    if (detail::solve_rows(setup->model->solver(), rows, long(count), results, 1) >= 0)
      Py_RETURN_NONE;
    return write(
        rows, count, results.colliding, setup->model->kind != Model::paper,
        {results.point, results.normal, results.separation, results.volume, results.covariance});
  }
  PyObject* solve_in_python(Rows& rows, npy_intp count) {
    // Its code may ask the movers, whose pairs are others then.
    auto pairs = array_of_pairs(rows.pairs, count);
    auto poses = make<double>({scene_.count(), 7}), sizes = make<double>({scene_.count(), 3});
    std::copy_n(scene_.poses.data(), 7 * scene_.count(), poses.numbers);
    std::copy_n(scene_.sizes.data(), 3 * scene_.count(), sizes.numbers);
    Owned batch(made(PyObject_GetAttrString(scene_.solver.get(), "batch")));
    Owned args(made(PyTuple_Pack(1, poses.object.get())));
    Owned keywords(
        made(Py_BuildValue("{sOsO}", "sizes", sizes.object.get(), "pairs", pairs.object.get())));
    ContactsOfPython found{Owned(made(PyObject_Call(batch.get(), args.get(), keywords.get()))),
                           count};
    rows.pairs = pairs.numbers;
    return write(rows, count, found.colliding.numbers, false,
                 {found.point.numbers, found.normal.numbers, found.separation.numbers,
                  found.volume.numbers, found.covariance.numbers});
  }

  // is_of_axis: normals are those of the separating axes.
  template <class Flag>
  PyObject* write(const Rows& rows, npy_intp count, const Flag* colliding, bool is_of_axis,
                  const ContactRows& contacts) {
    Owned heads(made(PyList_New(0)));
    message_.begin(newest_, frame_id_);
    message_.number(uint32_t(scene_.epoch));
    message_.number(uint64_t(scene_.revision));
    auto touching = std::count_if(colliding, colliding + count, [](Flag flag) { return flag; });
    message_.number(uint32_t(touching));
    memory_.near_pairs.clear();
    for (npy_intp row = 0; row < count; ++row) {
      const int64_t* pair = rows.pairs + 2 * row;
      if (!colliding[row]) {
        if (scene_.margin > 0.0 && contacts.separation[row] <= scene_.margin)
          memory_.near_pairs.insert(memory_.near_pairs.end(), pair, pair + 2);
        continue;
      }
      const TickScene::Pair* known = scene_.find(pair);
      write_names(pair, known);
      double numbers[message_numbers_count];
      const double* normal = is_of_axis ? contacts.normal + 3 * row : nullptr;
      contacts.write(row, face_area(rows, row, normal), numbers);
      message_.numbers(numbers, message_numbers_count);
      if (known && known->topics) append_heads(heads.get(), *known, numbers);
    }
    write_near(rows);
    Owned stale(write_stale());
    return Py_BuildValue("(NNnN)", message_.message(), heads.release(), Py_ssize_t(touching),
                         stale.release());
  }
  // What a pair is called.
  void write_label(const int64_t* pair, const TickScene::Pair* known) {
    if (known && known->label)
      message_.text({utf8_of(known->label)});
    else
      message_.text({utf8_of(scene_.name(pair[0])), "_", utf8_of(scene_.name(pair[1]))});
  }
  void write_names(const int64_t* pair, const TickScene::Pair* known) {
    write_label(pair, known);
    for (int k = 0; k < 2; ++k) message_.text({utf8_of(scene_.name(pair[k]))});
  }
  // Point and normal of a pair have the newer stamp of its own poses.
  void append_heads(PyObject* heads, const TickScene::Pair& pair, const double* numbers) {
    int64_t stamp = earliest;
    for (int64_t mover : pair.movers)
      if (mover >= 0 && size_t(mover) < memory_.stamps.size())
        stamp = std::max(stamp, memory_.stamps[size_t(mover)]);
    PyObject* both[2];
    for (int k = 0; k < 2; ++k) {
      head_.begin(stamp == earliest ? newest_ : stamp, frame_id_);
      head_.numbers(numbers + 3 * k, 3);
      both[k] = head_.message();
    }
    Owned head(made(Py_BuildValue("(ONN)", pair.topics, both[0], both[1])));
    if (PyList_Append(heads, head.get()) < 0) throw PythonError{};
  }
  // The separation is at most the distance, so few pairs are asked for it.
  void write_near(Rows rows) {
    rows.pairs = memory_.near_pairs.data();
    size_t count = memory_.near_pairs.size() / 2;
    auto results = memory_.nearest_results(count);
    if (count) detail::nearest_rows(*kernel, rows, long(count), results, 1);
    auto is_near = [&](double distance) { return distance <= scene_.margin; };
    message_.number(uint32_t(std::count_if(results.distance, results.distance + count, is_near)));
    for (size_t row = 0; row < count; ++row) {
      if (!is_near(results.distance[row])) continue;
      const int64_t* pair = rows.pairs + 2 * row;
      write_names(pair, scene_.find(pair));
      message_.number(results.distance[row]);
      for (const double* vectors : {results.normal, results.point_a, results.point_b})
        message_.numbers(vectors + 3 * row, 3);
    }
  }
  PyObject* write_stale() {
    const auto& stale = memory_.stale;
    Owned rows(made(PyList_New(Py_ssize_t(stale.size() / 2))));
    message_.number(uint32_t(stale.size() / 2));
    for (size_t k = 0; k < stale.size(); k += 2) {
      const int64_t* pair = stale.data() + k;
      if (pair[1] < 0)
        message_.text({utf8_of(scene_.name(pair[0]))});
      else
        write_label(pair, scene_.find(pair));
      PyList_SET_ITEM(rows.get(), Py_ssize_t(k / 2),
                      made(Py_BuildValue("(LL)", (long long)pair[0], (long long)pair[1])));
    }
    return rows.release();
  }

  static constexpr int64_t earliest = std::numeric_limits<int64_t>::min();

  TickScene scene_;
  TickMemory memory_;
  CdrWriter message_, head_;
  std::string frame_id_;       // of the tick
  int64_t newest_ = earliest;  // its stamp [ns]
  bool is_busy_ = false;       // a model in Python may ask for another tick
};

inline PyObject* tick_writer_new(PyTypeObject* type, PyObject* args, PyObject*) {
  return Holder<TickWriter>::make(type, TickWriter(read_scene(args)));
}

inline PyObject* tick_writer_call(PyObject* self, PyObject* args, PyObject* keywords) {
  PyObject* poses;
  static const char* names[] = {"poses", nullptr};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O:TickWriter", const_cast<char**>(names),
                                   &poses))
    return nullptr;
  return Holder<TickWriter>::of(self).answer(poses);
}

inline PyType_Slot tick_writer_slots[] = {
    {Py_tp_doc,
     const_cast<char*>("TickWriter(movers, solver, margin, most_near, sizes, poses, moving, "
                       "bodies, local, names, listed, labels, watched, topics, frame_id, epoch, "
                       "revision)"
                       "\n--\n\n"
                       "Answer ticks of a scene as the bytes of messages; see write_contacts.hpp.")},
    {Py_tp_new, slot<tick_writer_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<TickWriter>::dealloc)},
    {Py_tp_call, slot<tick_writer_call>()},
    {0, nullptr}};
inline PyType_Spec tick_writer_spec = {"box_contact_ros.core._native.TickWriter",
                                       sizeof(Holder<TickWriter>), 0, Py_TPFLAGS_DEFAULT,
                                       tick_writer_slots};

}  // namespace box_contact::binding
