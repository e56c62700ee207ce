// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The numbers of the network of model `mlp` from a safetensors file.
//
// The file begins with 8 bytes, the little-endian length of a JSON header. The header gives dtype,
// shape and place of each tensor, and the tensors follow. The reader finds four tensors by name and
// knows no more of JSON. It needs a little-endian machine.
#pragma once

#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "../kernel.hpp"
#include "solver.hpp"

namespace box_contact::detail {

class WeightsFile {
 public:
  static constexpr size_t largest_file = size_t(1) << 24;  // header and tensors [bytes]

  // Throws std::runtime_error with path and cause, as `numbers` does.
  explicit WeightsFile(const std::string& path) : path_(path) {
    // To open a FIFO would wait for its writer.
    std::error_code unknown;
    if (auto kind = std::filesystem::status(path, unknown).type();
        kind != std::filesystem::file_type::regular)
      refuse(kind == std::filesystem::file_type::not_found ? "does not exist"
                                                           : "is no regular file");
    std::ifstream file(path, std::ios::binary);
    if (!file) refuse("cannot be opened");
    std::string bytes;
    for (char part[1 << 16]; file.read(part, sizeof part), file.gcount() > 0;) {
      bytes.append(part, size_t(file.gcount()));
      if (bytes.size() > largest_file) refuse("is larger than 16 MiB");
    }
    std::uint64_t length = 0;
    if (bytes.size() >= 8) std::memcpy(&length, bytes.data(), 8);
    if (bytes.size() < 8 || length > bytes.size() - 8) refuse("is no safetensors file");
    for (char c : bytes.substr(8, length))
      if (!std::isspace(static_cast<unsigned char>(c))) header_ += c;
    data_ = bytes.substr(8 + length);
  }

  // The bias of the output; then for each unit its bias, its weights for the features, and its weight
  // to the output.
  std::vector<float> numbers() const {
    // White space has gone from the header.
    const std::string format = std::to_string(network_format);
    if (header_.find(R"(\"format\":)" + format + ",") == std::string::npos)
      refuse("is not of format " + format);
    constexpr size_t features = network_features;
    size_t units = number(entry("share.0.bias"), R"("shape":[)");
    std::vector<float> bias = tensor("share.0.bias", {units});
    std::vector<float> first = tensor("share.0.weight", {units, features});
    std::vector<float> last = tensor("share.1.weight", {1, units});
    std::vector<float> found = tensor("share.1.bias", {1});
    for (size_t u = 0; u < units; ++u) {
      found.push_back(bias[u]);
      found.insert(found.end(), &first[features * u], &first[features * u] + features);
      found.push_back(last[u]);
    }
    for (float weight : found)
      if (!is_weight(weight))
        refuse("has a weight " + std::to_string(weight) + ", which is not within -1e4 to 1e4");
    return found;
  }

 private:
  // What the header tells of a tensor. Quotes within the model card are escaped, so none matches.
  std::string entry(const std::string& name) const {
    size_t place = header_.find('"' + name + R"(":{)");
    if (place == std::string::npos) refuse("has no tensor " + name);
    return header_.substr(place, header_.find('}', place) - place);
  }
  static size_t number(const std::string& entry, const std::string& key) {
    size_t place = entry.find(key);
    return place == std::string::npos
               ? 0
               : std::strtoull(entry.c_str() + place + key.size(), nullptr, 10);
  }
  std::vector<float> tensor(const std::string& name, std::initializer_list<size_t> shape) const {
    std::string told = entry(name), extents;
    size_t count = 1;
    for (size_t extent : shape) {
      extents += (extents.empty() ? "" : ",") + std::to_string(extent);
      if (extent > data_.size()) refuse("has a tensor " + name + " that is larger than the file");
      count *= extent;  // at most 16 MiB squared
    }
    const std::string key = R"("data_offsets":[)";
    size_t begin = number(told, key), end = number(told, key + std::to_string(begin) + ",");
    if (told.find(R"("dtype":"F32")") == std::string::npos ||
        told.find(R"("shape":[)" + extents + "]") == std::string::npos || begin > end ||
        end > data_.size() || end - begin != count * sizeof(float))
      refuse("has no tensor " + name + " of float32 and the shape [" + extents + "]");
    std::vector<float> numbers(count);
    std::memcpy(numbers.data(), data_.data() + begin, end - begin);
    return numbers;
  }
  [[noreturn]] void refuse(const std::string& cause) const {
    throw std::runtime_error("weights file " + path_ + " " + cause);
  }

  std::string path_, header_, data_;
};

// Read the weights of model `mlp`: weights/mlp.safetensors.
inline std::vector<float> read_numbers(const std::string& path) {
  return WeightsFile(path).numbers();
}

}  // namespace box_contact::detail
