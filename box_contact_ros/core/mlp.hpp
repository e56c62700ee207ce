// Model `mlp`: SAT decides and gives normal and depth; a multilayer perceptron gives the point.
//
// 1. `bounds_by_slab`: a box about A∩B in one of the boxes' frames (overlap_bounds.hpp).
// 2. `describe` and `forward`: where in these bounds the centroid is. Only these run in float32.
// 3. `place`: the point is moved into both boxes.
//
// Guarantee: the point lies in both boxes, to 2⁻⁴⁶ of the size, whatever the weights are. `place`
// ends with a clamp to the box of the bounds' frame, and then tests the point against the other box.
// A point that fails the test, NaN included, is replaced by the exact centroid, and counted. With
// trained weights none of 600,000 points of the pose sets fails.
//
// Outside the range that the network was trained for the answer is the exact one, too.
#pragma once

#include <vector>

#include "contact.hpp"
#include "overlap_bounds.hpp"

namespace box_contact {

// The range: longest by shortest edge of either box, longest edge of one box by the other's, depth
// by the shortest edge of both. The limits belong to it, rounding included.
constexpr double aspect_max = 20.0, size_ratio_max = 20.0, depth_max = 0.1;
constexpr double range_slack = 1.0 + 1e-9;

// Half extent of the overlap's bounding box [of the size] below which pressing gave it no volume.
constexpr double flat = 0.25 * depth_floor;

// Farthest that an answer is from the middle of the bounds, in half extents. The centroid of a convex
// body lies in the middle half of its exact bounding box (Bonnesen and Fenchel 1934, §34), and so
// within 0.5; bounds by the slab may be larger on one side.
constexpr double centroid_reach = 0.75;

// The point of `place` may lie outside the other box by this fraction of the size.
constexpr double place_tolerance = 0x1p-46;

// --- Features ---
//
// Scaled to its bounding box, A∩B is the cube [−1, 1]³ cut by the six faces of the other box. Two
// opposite faces f share their unit normal in these coordinates (`slant`, unit in the sum of the
// absolute components), cut into the cube by so much (`cut`), and push the centroid along the
// normal by the difference of the two (`push`). Sizes, units and the depth have gone.
//
// The network is asked at nine sites, a pair of faces f by an axis q of the cube. A site has twelve
// features: four of its own, four of its faces, four of its axis. All are invariant under the
// cube's 48 symmetries, which only take one site to another. Its three outputs multiply the
// components q of three vectors that turn along (Villar et al., Scalars are universal, 2021).

constexpr int site_count = 9, site_features = 12, site_outputs = 3;

// The cut cube, for lanes F of either precision; `slant[f]` is the normal of the pair of faces f.
template <class F>
struct CutCube {
  Mat<F> slant;
  Vec<F> cut;   // how far both faces f cut into the cube, 0 (they miss it) to 2 (nothing is left)
  Vec<F> push;  // how much further the lower face cuts than the upper one
};

// Features that the sites of a pair of faces, of an axis, and one site have.
template <class F>
struct SiteFeatures {
  F of_faces[3][4];     // cut, |push|, push · push of the others along it, cut of all faces
  F of_axis[3][4];      // Σ slant · cut, |Σ slant · push|, the larger of the former along the other
                        // axes, |Σ slant · push| summed over the axes
  F of_site[3][3][4];   // [f][q]: |slant · cut|, |slant · push|, slant · push · that of the others,
                        // larger slant along another axis · cut
};
// What the outputs of site (f, q) multiply: the push of the faces f along their normal; the push of
// the others along these faces, times their cut; what the others' normals have of this push.
template <class F>
struct SiteVectors {
  F along[3][3][site_outputs];
};

// Slants and pushes are shortened by this. It is far below float32's rounding of what they are added
// to; rounded zeros of float64 would make denormal products, which take a hundred times as long.
constexpr double least_slant = 1e-9;

template <class T>
[[gnu::always_inline]] inline T shortened(T x) {
  T length = max(abs(x) - least_slant, T{});
  return select<T>(x >= 0.0, length, -length);
}

// The cut cube in float64. Faces are as wide as the bounds took them: one in a plane with the
// cube's face cuts nothing.
template <class T>
[[gnu::always_inline]] inline CutCube<T> cut_cube(const OverlapBounds<T>& bounds, T size) {
  CutCube<T> cube;
  for (int f = 0; f < 3; ++f) {
    T half = bounds.other_half[f] + flush * size, offset = bounds.other_offset[f];
    Vec<T> n;
    for (int k = 0; k < 3; ++k) n[k] = bounds.other_axes[f][k] * bounds.half[k];
    T inverse = 1.0 / ((abs(n[0]) + abs(n[1])) + abs(n[2]));
    T upper = min(splat<T>(2.0), max(T{}, 1.0 - (half - offset) * inverse));
    T lower = min(splat<T>(2.0), max(T{}, 1.0 - (half + offset) * inverse));
    for (int k = 0; k < 3; ++k) cube.slant[f][k] = shortened(n[k] * inverse);
    cube.cut[f] = upper + lower;
    cube.push[f] = shortened(lower - upper);
  }
  return cube;
}

template <class F>
[[gnu::always_inline]] inline void describe(const CutCube<F>& cube, SiteFeatures<F>& features,
                                            SiteVectors<F>& vectors) {
  const Mat<F>& slant = cube.slant;
  const Vec<F>&cut = cube.cut, &push = cube.push;
  F cosine[3];  // of pairs of faces 1 2, 2 0, 0 1
  for (int f = 0; f < 3; ++f) cosine[f] = dot(row(slant, (f + 1) % 3), row(slant, (f + 2) % 3));
  Vec<F> shift, shifts, slanted;
  for (int q = 0; q < 3; ++q) {
    shift[q] = dot(column(slant, q), push);
    shifts[q] = abs(shift[q]);
    slanted[q] = dot(abs(column(slant, q)), cut);
  }
  F whole_cut = (cut[0] + cut[1]) + cut[2], whole_shift = (shifts[0] + shifts[1]) + shifts[2];
  for (int f = 0; f < 3; ++f) {
    int g = (f + 1) % 3, h = (f + 2) % 3;
    F along = cosine[h] * push[g] + cosine[g] * push[h];  // the others' push along these faces
    F faces[4] = {cut[f], abs(push[f]), push[f] * along, whole_cut};
    F axis[4] = {slanted[f], shifts[f], max(slanted[g], slanted[h]), whole_shift};
    for (int k = 0; k < 4; ++k) features.of_faces[f][k] = faces[k];
    for (int k = 0; k < 4; ++k) features.of_axis[f][k] = axis[k];
    for (int q = 0; q < 3; ++q) {
      F s = slant[f][q], pushed = s * push[f];
      F larger = max(abs(slant[f][(q + 1) % 3]), abs(slant[f][(q + 2) % 3]));
      F site[4] = {abs(s) * cut[f], abs(pushed), pushed * (shift[q] - pushed), larger * cut[f]};
      for (int k = 0; k < 4; ++k) features.of_site[f][q][k] = site[k];
      F passed = push[f] * (slant[g][q] * (cosine[h] * cut[g]) + slant[h][q] * (cosine[g] * cut[h]));
      vectors.along[f][q][0] = pushed;
      vectors.along[f][q][1] = s * (cut[f] * along);
      vectors.along[f][q][2] = passed;
    }
  }
}

// --- The network ---

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

// w · x + y, rounded once where the machine can: networks alone may do so.
template <class F>
[[gnu::always_inline]] inline F multiply_add(float w, F x, F y) {
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
[[gnu::always_inline]] inline F weighted_sum(F start, const float (&weights)[4],
                                             const F (&features)[4]) {
  for (int k = 0; k < 4; ++k) start = multiply_add(weights[k], features[k], start);
  return start;
}

template <class F>
[[gnu::always_inline]] inline void add_unit(const Network::Unit& unit, F of_faces, F of_axis,
                                            const F (&site)[4], F (&outputs)[site_outputs]) {
  F hidden = max(weighted_sum(of_faces + of_axis, unit.of_site, site), F{});
  for (int k = 0; k < site_outputs; ++k)
    outputs[k] = multiply_add(unit.to_outputs[k], hidden, outputs[k]);
}

template <class F>
struct SiteOutputs {
  F at[3][3][site_outputs];
};

// The outputs at all sites of W pairs. What sites share is summed once.
template <class F>
inline void forward(const Network& network, const SiteFeatures<F>& features,
                    SiteOutputs<F>& outputs) {
  for (auto& faces : outputs.at)
    for (auto& site : faces)
      for (int k = 0; k < site_outputs; ++k) site[k] = splat<F>(network.output_bias[k]);
  for (const Network::Unit& unit : network.units) {
    F of_faces[3], of_axis[3];
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) {
      of_faces[k] = weighted_sum(splat<F>(unit.bias), unit.of_faces, features.of_faces[k]);
      of_axis[k] = weighted_sum(F{}, unit.of_axis, features.of_axis[k]);
    }
#pragma GCC unroll 3
    for (int f = 0; f < 3; ++f)
#pragma GCC unroll 3
      for (int q = 0; q < 3; ++q)
        add_unit(unit, of_faces[f], of_axis[q], features.of_site[f][q], outputs.at[f][q]);
  }
}

// Lanes that hold the sites of a single pair.
#if defined(__AVX512F__)
constexpr int site_lanes = 16;
#elif defined(__AVX2__)
constexpr int site_lanes = 8;
#else
constexpr int site_lanes = 4;
#endif
constexpr int site_vectors = (site_count + site_lanes - 1) / site_lanes;

// The same for a single pair, with the sites f · 3 + q as lanes: the same sums in the same order.
inline void forward(const Network& network, const SiteFeatures<float>& features,
                    SiteOutputs<float>& outputs) {
  using F = Lanes<float, site_lanes>;
  constexpr int padded = site_lanes * site_vectors;
  alignas(sizeof(F)) float numbers[3][4][padded]{};
  for (int f = 0; f < 3; ++f)
    for (int q = 0; q < 3; ++q)
      for (int k = 0; k < 4; ++k) {
        numbers[0][k][3 * f + q] = features.of_faces[f][k];
        numbers[1][k][3 * f + q] = features.of_axis[q][k];
        numbers[2][k][3 * f + q] = features.of_site[f][q][k];
      }
  F of_faces[site_vectors][4], of_axis[site_vectors][4], of_site[site_vectors][4];
  F found[site_vectors][site_outputs];
  for (int v = 0; v < site_vectors; ++v) {
    for (int k = 0; k < 4; ++k) {
      std::memcpy(&of_faces[v][k], &numbers[0][k][site_lanes * v], sizeof(F));
      std::memcpy(&of_axis[v][k], &numbers[1][k][site_lanes * v], sizeof(F));
      std::memcpy(&of_site[v][k], &numbers[2][k][site_lanes * v], sizeof(F));
    }
    for (int k = 0; k < site_outputs; ++k) found[v][k] = splat<F>(network.output_bias[k]);
  }
  for (const Network::Unit& unit : network.units)
#pragma GCC unroll 3
    for (int v = 0; v < site_vectors; ++v)
      add_unit(unit, weighted_sum(splat<F>(unit.bias), unit.of_faces, of_faces[v]),
               weighted_sum(F{}, unit.of_axis, of_axis[v]), of_site[v], found[v]);
  for (int s = 0; s < site_count; ++s)
    for (int k = 0; k < site_outputs; ++k)
      outputs.at[s / 3][s % 3][k] = found[s / site_lanes][k][s % site_lanes];
}

// Float32 lanes for a group of float64 lanes: as wide in bytes.
template <class T>
using Narrow =
    typename std::conditional_t<is_scalar<T>, NumberOf<float>, LanesOf<float, 2 * width<T>>>::type;

[[gnu::always_inline]] inline float narrow(const double& x) { return float(x); }
template <class T>
[[gnu::always_inline]] inline Narrow<T> narrow(const T& low, const T& high) {
  using Half = Lanes<float, width<T>>;
  Half halves[2] = {__builtin_convertvector(low, Half), __builtin_convertvector(high, Half)};
  Narrow<T> joined;
  std::memcpy(&joined, halves, sizeof(joined));
  return joined;
}
template <class T>
[[gnu::always_inline]] inline T widen(const Narrow<T>& x, int half) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    using Half = Lanes<float, width<T>>;
    Half halves[2];
    std::memcpy(halves, &x, sizeof(x));
    return __builtin_convertvector(halves[half], T);
  }
}

// The network's answers for a group of cubes: centroids from the middles of their bounding boxes, in
// half extents.
template <class T, int group>
[[gnu::always_inline]] inline void ask(const Network& network, const CutCube<T> (&cubes)[group],
                                       Vec<T> (&answers)[group]) {
  using F = Narrow<T>;
  auto joined = [&](auto part) -> F {
    if constexpr (group == 1) {
      return narrow(part(cubes[0]));
    } else {
      return narrow<T>(part(cubes[0]), part(cubes[1]));
    }
  };
  CutCube<F> cube;
  for (int f = 0; f < 3; ++f) {
    for (int k = 0; k < 3; ++k)
      cube.slant[f][k] = joined([&](const CutCube<T>& one) { return one.slant[f][k]; });
    cube.cut[f] = joined([&](const CutCube<T>& one) { return one.cut[f]; });
    cube.push[f] = joined([&](const CutCube<T>& one) { return one.push[f]; });
  }
  SiteFeatures<F> features;
  SiteVectors<F> vectors;
  SiteOutputs<F> outputs;
  describe(cube, features, vectors);
  forward(network, features, outputs);
  for (int q = 0; q < 3; ++q) {
    F sum{};
    for (int f = 0; f < 3; ++f) {
      const auto&out = outputs.at[f][q], &along = vectors.along[f][q];
      sum += (out[0] * along[0] + out[1] * along[1]) + out[2] * along[2];
    }
    for (int g = 0; g < group; ++g) answers[g][q] = widen<T>(sum, g);
  }
}

// The answer [m] from the middle of the bounding box, cut to where a centroid can be.
template <class T>
[[gnu::always_inline]] inline Vec<T> within_reach(const OverlapBounds<T>& bounds,
                                                  const Vec<T>& answer) {
  Vec<T> found;
  for (int k = 0; k < 3; ++k)
    found[k] = bounds.half[k] *
               min(splat<T>(centroid_reach), max(splat<T>(-centroid_reach), answer[k]));
  return found;
}

// A point in the bounds' frame [m], and whether it lies in both boxes.
template <class T>
struct Placed {
  Vec<T> point;
  Mask<T> inside;
};

// Move the network's answer into both boxes: twice to the nearest point of the other box, and back
// to the nearest point of the box whose frame it is.
template <class T>
[[gnu::always_inline]] inline Placed<T> place(const OverlapBounds<T>& bounds, const Vec<T>& answer,
                                              T size) {
  auto in_other = [&](const Vec<T>& point) {
    return bounds.other_offset + bounds.other_axes * (point - bounds.middle);
  };
  Vec<T> point = clamp(bounds.middle + within_reach(bounds, answer), bounds.own_half);
#pragma GCC unroll 2
  for (int round = 0; round < 2; ++round) {
    Vec<T> at = in_other(point), back = clamp(at, bounds.other_half) - at;
    point = clamp(point + transposed_times(bounds.other_axes, back), bounds.own_half);
  }
  // Each comparison fails for NaN.
  Vec<T> beyond = abs(in_other(point)) - bounds.other_half;
  Mask<T> inside = beyond[0] <= place_tolerance * size;
  inside &= beyond[1] <= place_tolerance * size;
  inside &= beyond[2] <= place_tolerance * size;
  return {point, inside};
}

// Whether the network may be asked: the pair is of the kind that it was trained for, and the
// overlap has a volume.
template <class T>
[[gnu::always_inline]] inline Mask<T> in_range(const Pair<T>& pair, T separation,
                                               const OverlapBounds<T>& bounds) {
  T long_a = largest(pair.half_a), short_a = smallest(pair.half_a);
  T long_b = largest(pair.half_b), short_b = smallest(pair.half_b);
  // Each quantity by its limit: 1 at the border of the range.
  T excess = max(long_a / (aspect_max * short_a), long_b / (aspect_max * short_b));
  excess = max(excess, max(long_a, long_b) / (size_ratio_max * min(long_a, long_b)));
  excess = max(excess, -separation / (2.0 * depth_max * min(short_a, short_b)));
  return (excess <= range_slack) & (smallest(bounds.half) >= flat * pair.size);
}

// The model for bounds of one method.
template <Network::Bounds method>
struct MlpModelBy {
  const Network& network;

  // How many queries of T it takes at once: float32 lanes are twice as many.
  template <class T>
  static constexpr int group = is_scalar<T> ? 1 : 2;

  // The bounds of a pressed pair.
  template <class T>
  [[gnu::always_inline]] static OverlapBounds<T> bounds_of(const Pair<T>& pair,
                                                           const SeparatingAxis<T>& axis) {
    if constexpr (method == Network::Bounds::edges) {
      return bounds_by_edges(pair);
    } else {
      return bounds_by_slab(pair, axis.normal, max(-axis.separation, depth_floor * pair.size));
    }
  }

  // Contact points in A's frame [m], for the pairs that touch.
  template <class T, int count>
  [[gnu::always_inline]] void points(const Query<T> (&queries)[count], Vec<T> (&found)[count],
                                     Counts& counts) const {
    OverlapBounds<T> bounds[count];
    CutCube<T> cubes[count];
    Vec<T> answers[count], pressed_offset[count];
    for (int g = 0; g < count; ++g) {
      Pair<T> pair = queries[g].pair;
      press(pair, queries[g].axis);
      pressed_offset[g] = pair.offset_a;
      bounds[g] = bounds_of(pair, queries[g].axis);
      cubes[g] = cut_cube(bounds[g], pair.size);
    }
    ask(network, cubes, answers);
    for (int g = 0; g < count; ++g) {
      const Query<T>& q = queries[g];
      Placed<T> placed = place(bounds[g], answers[g], q.pair.size);
      found[g] = select(bounds[g].in_b, pressed_offset[g] + q.pair.rotation * placed.point,
                        placed.point);
      Mask<T> answered = in_range(q.pair, q.axis.separation, bounds[g]) & placed.inside;
      Mask<T> fallback = (answered == 0) & q.touching;
      if (any(fallback)) {
        for (int i = 0; i < width<T>; ++i) {
          if (!lane(fallback, i)) continue;
          ++counts.exact;
          Counts unused;
          set_lane(found[g], i, ExactModel{}.points(lane(q, i), unused));
        }
      }
    }
  }
};
// The model that is shipped. Bounds by the edges are kept as a measured baseline.
using MlpModel = MlpModelBy<Network::Bounds::slab>;

}  // namespace box_contact
