// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Multilayer perceptrons with two hidden layers, of rectified units or of tanh, and models that ask
// them. The last layer may read the inputs, too. The weights are in memory, so one function runs
// networks of all sizes.
#pragma once

#include "../query.hpp"
#include "format.hpp"

namespace box_contact::BOX_CONTACT_SET {

using detail::network_header;
using detail::network_units_max;

// Units are read in groups of eight: their biases, then for each input their weights for it. A group
// that is not full, and inputs up to a multiple of four, are padded with zeros.
struct Network {
  int inputs, first, second, outputs;  // units
  bool is_tanh, in_half_edges, has_path;
  const float* numbers;
};

// A network in memory: the fields of `Network`, and then the groups of all layers.
inline Network view(const float* numbers) {
  return {int(numbers[0]),    int(numbers[1]),    int(numbers[2]),    int(numbers[3]),
          numbers[4] != 0.0F, numbers[5] != 0.0F, numbers[6] != 0.0F, numbers + network_header};
}

BC_INLINE constexpr int up_to_fours(int units) { return (units + 3) & ~3; }
// Room for outputs: of a pair alone, a group is written as a whole.
BC_INLINE constexpr int up_to_eights(int units) { return (units + 7) & ~7; }

// tanh, to 1.2e-6: a rational function between ±7, fitted to the least largest error.
template <class F>
BC_INLINE F tanh(F x) {
  F most = splat<F>(7.0F), y = min(most, max(-most, x)), z = y * y;
  F above = 0.99999571F + z * (0.12302185F + z * (0.0022769901F + z * 3.9300148e-6F));
  return y * above / (1.0F + z * (0.45634034F + z * (0.021072187F + z * 1.4235084e-4F)));
}

enum class Activation { none, rectified, tanh };

template <class F>
BC_INLINE F activated(F x, Activation activation) {
  if (activation == Activation::none) return x;
  return activation == Activation::tanh ? tanh<F>(x) : max<F>(x, F{});
}

// The sums of a few units, in four parts: no addition waits for the one before it. `product(k, j)` is of
// input k and its weight for unit j. Not of so many units that their sums leave the registers.
template <int units, class F, class Product>
BC_INLINE void sum_up(const F (&biases)[units], int count, Product product, F (&found)[units]) {
  F sums[units][4];
  for (int j = 0; j < units; ++j) {
    sums[j][0] = biases[j] + product(0, j);
    for (int part = 1; part < 4; ++part) sums[j][part] = product(part, j);
  }
#pragma GCC unroll 1
  for (int k = 4; k < count; k += 4)
#pragma GCC unroll 4
    for (int part = 0; part < 4; ++part)
      for (int j = 0; j < units; ++j) sums[j][part] = sums[j][part] + product(k + part, j);
  for (int j = 0; j < units; ++j) found[j] = (sums[j][0] + sums[j][1]) + (sums[j][2] + sums[j][3]);
}

// A few units of pairs side by side: an input is loaded once for all of them.
#if defined(__AVX512F__)
constexpr int units_at_once = 4;
#else
constexpr int units_at_once = 2;
#endif
template <class F>
BC_INLINE void some_units(const float* weights, const F* inputs, int count, Activation activation,
                          F* outputs) {
  F biases[units_at_once], found[units_at_once];
  for (int j = 0; j < units_at_once; ++j) biases[j] = splat<F>(weights[j]);
  auto product = [&](int k, int j) { return inputs[k] * splat<F>(weights[8 * (1 + k) + j]); };
  sum_up(biases, count, product, found);
  for (int j = 0; j < units_at_once; ++j) outputs[j] = activated(found[j], activation);
}
// Eight units of a pair alone, in a vector.
BC_INLINE void some_units(const float* weights, const float* inputs, int count,
                          Activation activation, float* outputs) {
  using Eight = Lanes<float, 8>;
  auto eight = [&](int row) {
    Eight numbers;
    std::memcpy(&numbers, weights + 8 * row, sizeof numbers);
    return numbers;
  };
  Eight biases[1] = {eight(0)}, found[1];
  auto product = [&](int k, int) { return splat<Eight>(inputs[k]) * eight(1 + k); };
  sum_up(biases, count, product, found);
  found[0] = activated(found[0], activation);
  std::memcpy(outputs, found, sizeof found);
}

// One layer, of a multiple of four inputs. Returns the numbers of the next one.
template <class F>
BC_INLINE const float* layer(const float* numbers, const F* inputs, int count, int units,
                             Activation activation, F* outputs) {
  constexpr int step = is_scalar<F> ? 8 : units_at_once;
#pragma GCC unroll 1
  for (int u = 0; u < units; u += step) {
    const float* weights = numbers + 8 * (1 + count) * (u / 8) + u % 8;
    some_units(weights, inputs, count, activation, outputs + u);
  }
  return numbers + (1 + count) * up_to_eights(units);
}

// The first outputs, so many as are wanted. Inputs up to a multiple of four are zeros. Not inlined: all
// models share it.
template <class F>
[[gnu::noinline]] void answer(const Network& network, const F* inputs, int wanted, F* outputs) {
  F first[network_units_max], last[up_to_fours(detail::network_features) + network_units_max];
  Activation hidden = network.is_tanh ? Activation::tanh : Activation::rectified;
  int count = up_to_fours(network.inputs), units = up_to_fours(network.first);
  const float* numbers = layer(network.numbers, inputs, count, units, hidden, first);
  int path = network.has_path ? count : 0;
  for (int k = 0; k < path; ++k) last[k] = inputs[k];
  count = units, units = up_to_fours(network.second);
  numbers = layer(numbers, first, count, units, hidden, last + path);
  layer(numbers, last, path + units, wanted, Activation::none, outputs);
}

// A model that asks a network. `Way<T>` is made of a network and Queries<T>, and has
// write(block, Found&) for what it found.
template <template <class> class Way>
struct NetworkModel {
  static constexpr bool solves_two_blocks = true;

  Network network;

  template <class T>
  using Found = typename Way<T>::Found;

  BC_INLINE unsigned solve(const Query<double>& query, Found<double>& found) const {
    solve_blocks<double>({&query}, {&found});
    return 0;
  }
  template <class T>
  BC_INLINE void solve_two(const Query<T>& query, const Query<T>& other, Found<T>& found,
                           Found<T>& other_found) const {
    solve_blocks<T>({&query, &other}, {&found, &other_found});
  }

 private:
  template <class T>
  [[gnu::noinline]] void solve_blocks(Queries<T> queries,
                                      Found<T>* const (&found)[blocks_together<T>]) const {
    Way<T> way(network, queries);
    for (int n = 0; n < blocks_together<T>; ++n) way.write(n, *found[n]);
  }
};

}  // namespace box_contact::BOX_CONTACT_SET
