// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A ROS message as the bytes that are sent (CDR), in memory that is used again.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "arrays.hpp"

namespace box_contact::binding {

constexpr size_t frame_id_max = 255;  // bytes

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

// Reads the bytes of a message in the order of bytes of this machine. What is not there is read as 0,
// and the message is not good any more.
class CdrReader {
 public:
  explicit CdrReader(PyObject* given) {
    if (!PyBytes_CheckExact(given)) return;
    data_ = PyBytes_AS_STRING(given);
    size_ = size_t(PyBytes_GET_SIZE(given));
    is_good_ = size_ >= at_ && data_[0] == 0 && data_[1] == CdrWriter::kind;
  }

  bool is_good() const { return is_good_; }
  // Whether nothing follows but padding.
  bool is_at_end() const { return is_good_ && size_ - at_ <= padding_max; }
  // Whether so many more bytes are there.
  bool has(size_t size) const { return is_good_ && size <= size_ - at_; }
  size_t at() const { return at_; }
  std::string_view since(size_t begin) const { return {data_ + begin, at_ - begin}; }

  uint32_t number() {
    uint32_t value = 0;
    if (const char* from = take(sizeof value, sizeof value)) std::memcpy(&value, from, sizeof value);
    return value;
  }
  // The stamp of a header [ns].
  int64_t stamp() {
    auto sec = int32_t(number());
    uint32_t nanosec = number();
    is_good_ &= nanosec < 1'000'000'000;
    return sec * int64_t{1'000'000'000} + nanosec;
  }
  // A string of so many bytes at most, without its zero.
  std::string_view text(size_t most = SIZE_MAX) {
    uint32_t length = number();
    const char* begin = take(length, 1);
    if (!begin || length == 0) return {};
    is_good_ &= std::memchr(begin, '\0', length) == begin + length - 1 && length - 1 <= most;
    return {begin, length - 1};
  }
  // The bytes of so many doubles.
  const char* doubles(size_t count) { return take(count * sizeof(double), sizeof(double)); }
  // The bytes of a sequence of rows of doubles, each of so many bytes.
  const char* rows(size_t row_size) {
    count_ = number();
    return count_ ? take(count_ * row_size, sizeof(double)) : data_;
  }
  // How many rows the last sequence has.
  size_t count() const { return count_; }
  // Whether such bytes follow, which are passed over then.
  bool skip(std::string_view bytes) {
    if (!has(bytes.size()) || std::memcmp(data_ + at_, bytes.data(), bytes.size()) != 0)
      return false;
    at_ += bytes.size();
    return true;
  }

 private:
  static constexpr size_t encapsulation = 4, padding_max = 3;

  // The next bytes, which begin at a multiple of `alignment` behind the encapsulation; or nullptr.
  const char* take(size_t size, size_t alignment) {
    size_t begin = at_ + (alignment - (at_ - encapsulation) % alignment) % alignment;
    is_good_ = is_good_ && begin <= size_ && size <= size_ - begin;
    if (!is_good_) return nullptr;
    at_ = begin + size;
    return data_ + begin;
  }

  const char* data_ = nullptr;
  size_t size_ = 0, at_ = encapsulation, count_ = 0;
  bool is_good_ = false;
};

}  // namespace box_contact::binding
