// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The network: one hidden layer of rectified units, asked at nine sites.
#pragma once

#include <vector>

#include "cut_cube.hpp"

namespace box_contact::BOX_CONTACT_SET {

// One hidden layer of rectified units, asked at each site.
struct Network {
  // What the features describe: bounds by the slab, or by the edges. A network knows one of them.
  enum class Bounds { slab, edges };
  struct Unit {
    float bias, of_faces[4], of_axis[4], of_site[4], to_outputs[site_outputs];
  };
  float output_bias[site_outputs]{};
  std::vector<Unit> units;
};

// The numbers of a network in memory.
struct NetworkView {
  const float* output_bias;
  const Network::Unit* units;
  long count;
};
inline NetworkView view(const Network& network) {
  return {network.output_bias, network.units.data(), long(network.units.size())};
}

// w · x + y, rounded once where the machine can: networks alone may do so.
template <class F>
BC_INLINE F multiply_add(float w, F x, F y) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<F, Lanes<float, 16>>)
    return (F)_mm512_fmadd_ps(_mm512_set1_ps(w), (__m512)x, (__m512)y);
#endif
#if defined(__FMA__)
  if constexpr (std::is_same_v<F, Lanes<float, 8>>)
    return (F)_mm256_fmadd_ps(_mm256_set1_ps(w), (__m256)x, (__m256)y);
  if constexpr (std::is_same_v<F, Lanes<float, 4>>)
    return (F)_mm_fmadd_ps(_mm_set1_ps(w), (__m128)x, (__m128)y);
#endif
  return w * x + y;
}

template <class F>
BC_INLINE Vec<F> multiply_add(float w, const Vec<F>& x, const Vec<F>& y) {
  return {multiply_add(w, x[0], y[0]), multiply_add(w, x[1], y[1]), multiply_add(w, x[2], y[2])};
}

template <class Three>
BC_INLINE Three weighted_sum(Three start, const float (&weights)[4], const Three (&features)[4]) {
  for (int k = 0; k < 4; ++k) start = multiply_add(weights[k], features[k], start);
  return start;
}

template <class F>
struct SiteOutputs {
  Triple<F> at[3][site_outputs];  // [q], by f
};

// Units whose shared sums are kept at a time: they stay in the first cache.
constexpr int units_at_once = 32;
// Outputs that are summed at a time: three lanes of each stay in sixteen registers.
constexpr int outputs_at_once = 4;

// Add what hidden units give to the outputs from `first` to before `last`, at the sites of one axis.
template <int first, int last, class Three>
BC_INLINE void add_outputs(const Network::Unit* unit, int units, const Three* hidden,
                           Three* outputs) {
  Three sums[last - first];  // not in `outputs`: for all the compiler knows, the weights are there
  for (int k = first; k < last; ++k) sums[k - first] = outputs[k];
  for (int n = 0; n < units; ++n)
    for (int k = first; k < last; ++k)
      sums[k - first] = multiply_add(unit[n].to_outputs[k], hidden[n], sums[k - first]);
  for (int k = first; k < last; ++k) outputs[k] = sums[k - first];
}

// The first `count` outputs at all sites. What sites share is summed once. The sites of one axis
// come one after the other, so that the sums of their outputs stay in registers.
template <int count, class F>
inline void forward(const NetworkView& network, const SiteFeatures<F>& features,
                    SiteOutputs<F>& outputs) {
  for (auto& axis : outputs.at)
    for (int k = 0; k < count; ++k) axis[k] = uniform(splat<F>(network.output_bias[k]));
  const Network::Unit *unit = network.units, *end = unit + network.count;
  for (; unit < end; unit += units_at_once) {
    Triple<F> of_faces[units_at_once], of_axis[units_at_once];
    int units = end - unit < units_at_once ? int(end - unit) : units_at_once;
    for (int n = 0; n < units; ++n) {
      of_faces[n] =
          weighted_sum(uniform(splat<F>(unit[n].bias)), unit[n].of_faces, features.of_faces);
      of_axis[n] = weighted_sum(Triple<F>{}, unit[n].of_axis, features.of_axis);
    }
#pragma GCC unroll 3
    for (int q = 0; q < 3; ++q) {
      Triple<F> hidden[units_at_once];
      for (int n = 0; n < units; ++n) {
        Triple<F> shared = of_faces[n] + spread(of_axis[n], q);
        hidden[n] = max(weighted_sum(shared, unit[n].of_site, features.of_site[q]), Triple<F>{});
      }
      constexpr int middle = count < outputs_at_once ? count : outputs_at_once;
      add_outputs<0, middle>(unit, units, hidden, outputs.at[q]);
      add_outputs<middle, count>(unit, units, hidden, outputs.at[q]);
    }
  }
}

// Float32 lanes for a group of float64 lanes: as wide in bytes.
template <class T>
using Narrow =
    typename std::conditional_t<is_scalar<T>, NumberOf<float>, LanesOf<float, 2 * width<T>>>::type;

template <class T>
BC_INLINE Narrow<T> narrow(const T& low, const T& high) {
  using Half = Lanes<float, width<T>>;
  Half halves[2] = {__builtin_convertvector(low, Half), __builtin_convertvector(high, Half)};
  Narrow<T> joined;
  std::memcpy(&joined, halves, sizeof(joined));
  return joined;
}
template <class T>
BC_INLINE T half_of(const Narrow<T>& x, int half) {
  using Half = Lanes<float, width<T>>;
  Half halves[2];
  std::memcpy(halves, &x, sizeof(x));
  return __builtin_convertvector(halves[half], T);
}

// Triples of a group as one of float32, and back.
template <class T>
BC_INLINE Vec<Narrow<T>> narrow(const Vec<T> (&group)[2]) {
  return {narrow(group[0][0], group[1][0]), narrow(group[0][1], group[1][1]),
          narrow(group[0][2], group[1][2])};
}
template <class T>
BC_INLINE Triple<float> narrow(const Triple<T> (&group)[1]) {
  const Triple<T>& x = group[0];
  if constexpr (packed<T>) {
    return __builtin_convertvector(x, Triple<float>);
  } else {
    return triple(Vec<float>{float(x[0]), float(x[1]), float(x[2])});
  }
}
template <class T>
BC_INLINE Triple<T> widen(const Triple<Narrow<T>>& x, int half) {
  if constexpr (packed<T>) {
    return __builtin_convertvector(x, Triple<T>);
  } else if constexpr (is_scalar<T>) {
    return {x[0], x[1], x[2]};
  } else {
    return {half_of<T>(x[0], half), half_of<T>(x[1], half), half_of<T>(x[2], half)};
  }
}

template <class T, int group>
BC_INLINE CutCube<Narrow<T>> narrow(const CutCube<T> (&cubes)[group]) {
  auto joined = [&](auto part) {
    Triple<T> parts[group];
    for (int g = 0; g < group; ++g) parts[g] = part(cubes[g]);
    return narrow<T>(parts);
  };
  CutCube<Narrow<T>> cube;
  for (int k = 0; k < 3; ++k)
    cube.slant[k] = joined([&](const CutCube<T>& c) { return c.slant[k]; });
  cube.cut = joined([](const CutCube<T>& c) { return c.cut; });
  cube.push = joined([](const CutCube<T>& c) { return c.push; });
  return cube;
}

}  // namespace box_contact::BOX_CONTACT_SET
