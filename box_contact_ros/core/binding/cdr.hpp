// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A ROS message as the bytes that are sent (CDR), in memory that is used again.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "arrays.hpp"

namespace box_contact::binding {

class CdrWriter {
 public:
  // The second byte of a message in the order of bytes of this machine.
  static constexpr char kind = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__;

  // Begin a message with its header: the stamp [ns] and the frame.
  void begin(int64_t stamp, std::string_view frame_id) {
    constexpr int64_t second = 1'000'000'000;
    int64_t sec = stamp / second, nanosec = stamp % second;
    if (nanosec < 0) --sec, nanosec += second;
    bytes_.assign({0, kind, 0, 0});
    number(int32_t(sec));
    number(uint32_t(nanosec));
    text({frame_id});
  }

  // Numbers are aligned to their size, behind the encapsulation.
  template <class Number>
  void number(Number value) {
    numbers(&value, 1);
  }
  template <class Number>
  void numbers(const Number* values, size_t count) {
    align(sizeof(Number));
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(Number));
  }
  // A string of some parts.
  void text(std::initializer_list<std::string_view> parts) {
    size_t length = 1;
    for (std::string_view part : parts) length += part.size();
    number(uint32_t(length));
    for (std::string_view part : parts) bytes_.append(part);
    bytes_.push_back('\0');
  }

  // The message, padded to a multiple of four.
  PyObject* message() {
    align(4);
    return made(PyBytes_FromStringAndSize(bytes_.data(), Py_ssize_t(bytes_.size())));
  }

 private:
  static constexpr size_t encapsulation = 4;

  void align(size_t size) {
    size_t past = (bytes_.size() - encapsulation) % size;
    if (past) bytes_.append(size - past, '\0');
  }

  std::string bytes_;
};

}  // namespace box_contact::binding
