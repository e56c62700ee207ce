// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The multilayer perceptron: two hidden layers of rectified units, and seven outputs.
#pragma once

#include "../kernel.hpp"
#include "eight.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::network_features;
using detail::network_outputs;
using detail::network_units_max;

// Units are read in groups of eight: their biases, then for each input their weights for it. A group
// that is not full is padded with zeros.
struct Network {
  int groups[2];  // of each hidden layer
  const float* numbers;
};

// A network in memory: the number of groups of each hidden layer, and then the groups of all layers.
inline Network view(const float* numbers) {
  return {{int(numbers[0]), int(numbers[1])}, numbers + 2};
}

namespace mlp {

// One layer. Returns the numbers of the next one.
template <class F>
BC_INLINE const float* layer(const float* numbers, const F* inputs, int count, int groups,
                             bool rectified, F* outputs) {
  for (int g = 0; g < groups; ++g) {
    Eight<F> sum = eight<F>(numbers);
    numbers += 8;
    for (int k = 0; k < count; ++k, numbers += 8)
      sum = sum + eight<F>(inputs[k]) * eight<F>(numbers);
    if (rectified) sum = max(sum, eight<F>(F{}));
    for (int i = 0; i < 8; ++i) outputs[8 * g + i] = number<F>(sum, i);
  }
  return numbers;
}

template <class F>
BC_INLINE void answer(const Network& network, const F (&told)[network_features],
                      F (&answers)[8]) {
  F first[network_units_max], second[network_units_max];
  const float* numbers = network.numbers;
  numbers = layer(numbers, told, network_features, network.groups[0], true, first);
  numbers = layer(numbers, first, 8 * network.groups[0], network.groups[1], true, second);
  layer(numbers, second, 8 * network.groups[1], 1, false, answers);
}

}  // namespace mlp
}  // namespace box_contact::BOX_CONTACT_SET
