// Model `mlp`: SAT decides and gives normal and depth; a multilayer perceptron gives the point.
//
// 1. `overlap_bounds`: the bounding box of A∩B in one of the boxes' frames, and a point inside.
// 2. `describe` and `forward`: where in this bounding box the centroid is. Only
//    these run in float32.
// 3. `place`: the answer is cut to where a centroid can be, the middle half of the bounding box
//    (Bonnesen and Fenchel 1934, §34), and the way there from the inside point is shortened where it
//    would leave the other box. It starts inside A∩B, so it ends in both boxes whatever the weights,
//    as long as they are finite.
//
// Outside the range that the network was trained for the answer is the exact one, and counted.
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

// Farthest a centroid can be from the middle of its bounding box, in half extents.
constexpr double centroid_reach = 0.5;

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

// The cut cube in float32, for lanes F; `slant[f]` is the normal of the pair of faces f.
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

// The cut cube in float64. Faces are as wide as `overlap_bounds` took them: one in a plane with the
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

// The same for a single pair: the sites are the lanes, four to a vector, f by q; the last is unused.
inline void forward(const Network& network, const SiteFeatures<float>& features,
                    SiteOutputs<float>& outputs) {
  using F = Lanes<float, 4>;
  F faces[3][4], axes[4], sites[3][4], found[3][site_outputs];
  for (int f = 0; f < 3; ++f)
    for (int k = 0; k < 4; ++k) {
      faces[f][k] = splat<F>(features.of_faces[f][k]);
      sites[f][k] = F{features.of_site[f][0][k], features.of_site[f][1][k],
                      features.of_site[f][2][k], 0.0F};
    }
  for (int k = 0; k < 4; ++k)
    axes[k] = F{features.of_axis[0][k], features.of_axis[1][k], features.of_axis[2][k], 0.0F};
  for (auto& one : found)
    for (int k = 0; k < site_outputs; ++k) one[k] = splat<F>(network.output_bias[k]);
  for (const Network::Unit& unit : network.units) {
    F of_axis = weighted_sum(F{}, unit.of_axis, axes);
#pragma GCC unroll 3
    for (int f = 0; f < 3; ++f)
      add_unit(unit, weighted_sum(splat<F>(unit.bias), unit.of_faces, faces[f]), of_axis, sites[f],
               found[f]);
  }
  for (int f = 0; f < 3; ++f)
    for (int q = 0; q < 3; ++q)
      for (int k = 0; k < site_outputs; ++k) outputs.at[f][q][k] = found[f][k][q];
}

// Float32 lanes for float64 lanes.
template <class T>
using Narrow =
    typename std::conditional_t<is_scalar<T>, NumberOf<float>, LanesOf<float, width<T>>>::type;
template <class T>
[[gnu::always_inline]] inline Narrow<T> narrow(T x) {
  if constexpr (is_scalar<T>) {
    return float(x);
  } else {
    return __builtin_convertvector(x, Narrow<T>);
  }
}
template <class T>
[[gnu::always_inline]] inline T widen(Narrow<T> x) {
  if constexpr (is_scalar<T>) {
    return x;
  } else {
    return __builtin_convertvector(x, T);
  }
}

// --- The point ---

// The network's answer: the centroid from the middle of its bounding box, in half extents.
template <class T>
[[gnu::always_inline]] inline Vec<T> ask(const Network& network, const CutCube<T>& exact_cube) {
  CutCube<Narrow<T>> cube;
  for (int f = 0; f < 3; ++f) {
    for (int k = 0; k < 3; ++k) cube.slant[f][k] = narrow(exact_cube.slant[f][k]);
    cube.cut[f] = narrow(exact_cube.cut[f]);
    cube.push[f] = narrow(exact_cube.push[f]);
  }
  SiteFeatures<Narrow<T>> features;
  SiteVectors<Narrow<T>> vectors;
  SiteOutputs<Narrow<T>> outputs;
  describe(cube, features, vectors);
  forward(network, features, outputs);
  Vec<T> answer{};
  for (int q = 0; q < 3; ++q)
    for (int f = 0; f < 3; ++f) {
      const auto&out = outputs.at[f][q], &along = vectors.along[f][q];
      answer[q] += widen<T>((out[0] * along[0] + out[1] * along[1]) + out[2] * along[2]);
    }
  return answer;
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

// The point for the network's answer, in A's frame, inside both boxes.
template <class T>
[[gnu::always_inline]] inline Vec<T> place(const Pair<T>& pair, const OverlapBounds<T>& bounds,
                                           const Vec<T>& answer) {
  Vec<T> way = (bounds.middle + within_reach(bounds, answer)) - bounds.inside;
  Vec<T> from_middle = bounds.inside - bounds.middle;
  T share = splat<T>(1.0);
  for (int f = 0; f < 3; ++f) {
    Vec<T> n = row(bounds.other_axes, f);
    T start = bounds.other_offset[f] + dot(n, from_middle), step = dot(n, way);
    T room = max(bounds.other_half[f] + select<T>(step >= 0.0, -start, start), T{});
    step = abs(step);
    share = min(share, select<T>(step > room, room / step, splat<T>(1.0)));
  }
  return point_in_frame_a(pair, bounds, bounds.inside + share * way);
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

struct MlpModel {
  const Network& network;

  // Contact points in A's frame [m], for the pairs that touch.
  template <class T>
  [[gnu::always_inline]] Vec<T> points(const Query<T>& q, Counts& counts) const {
    Pair<T> pair = q.pair;
    press(pair, q.axis);
    OverlapBounds<T> bounds = overlap_bounds(pair);
    Vec<T> points = place(pair, bounds, ask(network, cut_cube(bounds, pair.size)));
    Mask<T> fallback = (in_range(pair, q.axis.separation, bounds) == 0) & q.touching;
    if (any(fallback)) {
      for (int i = 0; i < width<T>; ++i) {
        if (!lane(fallback, i)) continue;
        ++counts.exact;
        Counts unused;
        set_lane(points, i, ExactModel{}.points(lane(q, i), unused));
      }
    }
    return points;
  }
};

}  // namespace box_contact
