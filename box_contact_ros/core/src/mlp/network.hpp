// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The network: one hidden layer of rectified units and one bounded output.
#pragma once

#include "../lanes/lanes.hpp"
#include "../kernel.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::network_features;

struct Network {
  struct Unit {
    float bias, of_features[network_features], to_output;
  };
  const float* output_bias;
  const Unit* units;
  long count;
};

static_assert(sizeof(Network::Unit) == detail::unit_numbers * sizeof(float));

// A network of `count` numbers: the bias of the output, then those of each unit.
inline Network view(const float* numbers, long count) {
  return {numbers, reinterpret_cast<const Network::Unit*>(numbers + 1),
          count / detail::unit_numbers};
}

// A number from 0 to 1, for any weights that are finite.
template <class F>
BC_INLINE F answer(const Network& network, const F (&features)[network_features]) {
  F sum = splat<F>(*network.output_bias);
  for (const Network::Unit* unit = network.units; unit < network.units + network.count; ++unit) {
    F hidden = splat<F>(unit->bias);
    for (int k = 0; k < network_features; ++k) hidden += unit->of_features[k] * features[k];
    sum += unit->to_output * max(hidden, F{});
  }
  // tanh, but for 2 %: it reaches ±1 at ±3.
  F x = min(splat<F>(3.0F), max(splat<F>(-3.0F), sum)), x2 = x * x;
  return 0.5F + 0.5F * (x * (27.0F + x2) / (27.0F + 9.0F * x2));
}

}  // namespace box_contact::BOX_CONTACT_SET
