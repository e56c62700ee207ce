// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The network of model `mlp` for box_contact/inline.hpp, from a weights file.
#pragma once

#include "inline.hpp"
#if __has_include("detail/library/weights_file.hpp")
#include "detail/library/weights_file.hpp"
#else
#include "../../src/library/weights_file.hpp"
#endif

namespace box_contact {
inline namespace BOX_CONTACT_SET {

// Read the weights of model `mlp`: weights/mlp.safetensors. Throws std::runtime_error with path and
// cause.
inline Network read_network(const std::string& path) {
  const std::vector<float> numbers = detail::read_numbers(path);
  Network network;
  network.units.resize((numbers.size() - site_outputs) * sizeof(float) / sizeof(Network::Unit));
  std::memcpy(network.output_bias, numbers.data(), sizeof network.output_bias);
  std::memcpy(network.units.data(), numbers.data() + site_outputs,
              (numbers.size() - site_outputs) * sizeof(float));
  return network;
}

}  // namespace BOX_CONTACT_SET
}  // namespace box_contact
