// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Class `NamedPoses`: the poses of what moves from the bytes of messages that name it.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cdr.hpp"
#include "tick_scene.hpp"

namespace box_contact::binding {

class NamedPoses {
 public:
  // names: of all that moves, in the order of the rows of `read`. most: names of a message.
  NamedPoses(Owned names, Py_ssize_t most) : names_(std::move(names)), most_(most) {
    for (Py_ssize_t row = 0; row < PyTuple_GET_SIZE(names_.get()); ++row)
      row_of_.emplace(utf8_of(PyTuple_GET_ITEM(names_.get(), row)), row);
  }

  // Return poses (m, 7), frame_id, stamp [ns] and names that move nothing, of the bytes of a
  // MultiDOFJointState. Or None: it is refused, or is in the other order of bytes. Python reads it
  // then, or says what is wrong (stream/read_poses.py).
  PyObject* read(PyObject* given) {
    constexpr size_t pose_size = 7 * sizeof(double), six_numbers = 6 * sizeof(double);
    CdrReader message(given);
    int64_t stamp = message.stamp();
    std::string_view frame = message.text(frame_id_max);
    uint32_t count = message.number();
    // Before any name is read: what a count promises may be seconds of work.
    if (count > most_ || !message.has(count * (sizeof count + pose_size))) Py_RETURN_NONE;
    if (!read_names(message, count)) Py_RETURN_NONE;
    const char* transforms = message.rows(pose_size);
    bool is_whole = message.count() == count;
    message.rows(six_numbers);  // twists
    message.rows(six_numbers);  // wrenches
    if (!message.is_at_end() || !is_whole) Py_RETURN_NONE;
    auto poses = make<double>({npy_intp(row_of_.size()), 7});
    std::fill_n(poses.numbers, 7 * row_of_.size(), std::numeric_limits<double>::quiet_NaN());
    for (size_t k = 0; k < count; ++k)
      if (rows_[k] >= 0)
        std::memcpy(poses.numbers + 7 * rows_[k], transforms + k * pose_size, pose_size);
    PyObject* frame_id = PyUnicode_DecodeUTF8(frame.data(), Py_ssize_t(frame.size()), nullptr);
    if (!frame_id && PyErr_ExceptionMatches(PyExc_UnicodeDecodeError)) {
      PyErr_Clear();
      Py_RETURN_NONE;
    }
    return Py_BuildValue("(NNLO)", poses.object.release(), made(frame_id), (long long)stamp,
                         unknown_.get());
  }

 private:
  // Find the rows that names move. Equal names, as in most messages, cost one compare. The bytes
  // between names may be anything, so names that are not equal bytes may be equal still.
  bool read_names(CdrReader& message, uint32_t count) {
    if (count == rows_.size() && message.skip(names_before_)) return true;
    size_t begin = message.at();
    size_t equal = 0;  // of the first names, those that are as before
    std::vector<int64_t> rows;
    std::vector<std::string_view> texts;
    for (uint32_t k = 0; k < count && message.is_good(); ++k) {
      size_t at = message.at() - begin;
      std::string_view text = message.text();
      bool is_equal = equal == k && k < rows_.size() &&
                      text == text_at(names_before_, (at + 3) / 4 * 4);
      equal += is_equal;
      if (is_equal) {
        rows.push_back(rows_[k]);
      } else {
        auto found = row_of_.find(text);
        rows.push_back(found == row_of_.end() ? -1 : found->second);
      }
      texts.push_back(text);
    }
    if (!message.is_good()) return false;
    if (equal < count || count < rows_.size()) {
      std::vector<uint8_t> is_named(row_of_.size(), 0);
      for (int64_t row : rows)
        if (row >= 0 && is_named[size_t(row)]++) return false;  // twice
      name_unknown(rows, texts);
    }
    rows_ = std::move(rows);
    names_before_ = std::string(message.since(begin));
    return true;
  }
  void name_unknown(const std::vector<int64_t>& rows, const std::vector<std::string_view>& texts) {
    Owned unknown(made(PyList_New(0)));
    for (size_t k = 0; k < rows.size(); ++k) {
      if (rows[k] >= 0) continue;
      Owned text(made(
          PyUnicode_DecodeUTF8(texts[k].data(), Py_ssize_t(texts[k].size()), "backslashreplace")));
      if (PyList_Append(unknown.get(), text.get()) < 0) throw PythonError{};
    }
    unknown_.reset(made(PyList_AsTuple(unknown.get())));
  }
  // The text at a place of names that were read before, or one that no name is.
  static std::string_view text_at(const std::string& names, size_t at) {
    uint32_t length;
    if (at + sizeof length > names.size()) return {"\0", 1};
    std::memcpy(&length, names.data() + at, sizeof length);
    if (!length || at + sizeof length + length > names.size()) return {"\0", 1};
    return {names.data() + at + sizeof length, length - 1};
  }

  Owned names_;
  Py_ssize_t most_;
  std::unordered_map<std::string_view, int64_t> row_of_;
  std::string names_before_;   // as they were in the last message
  std::vector<int64_t> rows_;  // of these names; −1: moves nothing
  Owned unknown_{made(PyTuple_New(0))};
};

inline PyObject* named_poses_new(PyTypeObject* type, PyObject* args, PyObject*) {
  PyObject* names;
  Py_ssize_t most;
  if (!PyArg_ParseTuple(args, "O!n:NamedPoses", &PyTuple_Type, &names, &most)) return nullptr;
  return Holder<NamedPoses>::make(type, NamedPoses(Owned(Py_NewRef(names)), most));
}

inline PyObject* named_poses_read(PyObject* self, PyObject* data) {
  return Holder<NamedPoses>::of(self).read(data);
}

inline PyMethodDef named_poses_methods[] = {
    {"read", method<named_poses_read>(), METH_O,
     "read(data)\n--\n\n"
     "Return poses (m, 7), frame_id, stamp [ns] and unknown names of a message, or None."},
    {nullptr, nullptr, 0, nullptr}};

inline PyType_Slot named_poses_slots[] = {
    {Py_tp_doc, const_cast<char*>("NamedPoses(names, most)\n--\n\n"
                                  "Read MultiDOFJointState messages; see named_poses.hpp.")},
    {Py_tp_new, slot<named_poses_new>()},
    {Py_tp_dealloc, reinterpret_cast<void*>(Holder<NamedPoses>::dealloc)},
    {Py_tp_methods, named_poses_methods},
    {0, nullptr}};
inline PyType_Spec named_poses_spec = {"box_contact_ros.core._native.NamedPoses",
                                       sizeof(Holder<NamedPoses>), 0, Py_TPFLAGS_DEFAULT,
                                       named_poses_slots};

}  // namespace box_contact::binding
