// Model `mlp`: SAT decides and gives normal and depth; a multilayer perceptron gives the point, the
// volume and the covariance.
//
// 1. `bounds_by_slab`: a box about A∩B in one of the boxes' frames (overlap/bounds.hpp).
// 2. `describe`, `forward` and `ask`: centroid, volume and covariance in these bounds. Only these run
//    in float32.
// 3. `place`: the point is moved into both boxes.
//
// Guarantees, whatever the weights are:
//
// - The point lies in both boxes, to 2⁻⁴⁶ of the size. `place` ends with a clamp to the box of the
//   bounds' frame, and then tests the point against the other box.
// - The volume is positive, and at most that of the bounds. The covariance is positive definite, but
//   for rounding: it is the inverse of a matrix that is (`ask_for_patch`).
//
// Where the point fails its test, or volume or covariance is NaN, all three are the exact ones, and
// the contact is counted. With trained weights none of 600,000 points of the pose sets fails.
//
// Outside the range that the network was trained for the answer is the exact one, too.
#pragma once

#include <vector>

#include "contact.hpp"
#include "overlap/bounds.hpp"

namespace box_contact::BOX_CONTACT_SET {

// The range: longest by shortest edge of either box, longest edge of one box by the other's, depth
// by the shortest edge of both. The limits belong to it, rounding included.
constexpr double aspect_max = 20.0, size_ratio_max = 20.0, depth_max = 0.1;
constexpr double range_slack = 1.0 + 1e-9;

// Half extent of the overlap's bounding box [of the size] below which pressing gave it no volume.
constexpr double flat = 0.25 * depth_floor;

// Farthest that an answer is from the middle of the bounds, in half extents. The centroid of a convex
// body is within 0.5 of the middle of its exact bounding box (Bonnesen and Fenchel 1934, §34). Bounds
// by the slab may be larger on one side.
constexpr double centroid_reach = 0.75;

// The point of `place` may lie outside the other box by this fraction of the size.
constexpr double place_tolerance = 0x1p-46;

// --- Features ---
//
// Scaled to its bounding box, A∩B is the cube [−1, 1]³ cut by the six faces of the other box. Two
// opposite faces f have in these coordinates:
//
//   slant: their normal, whose absolute components add up to 1
//   cut: how far both cut into the cube
//   push: how much further the lower one cuts, which moves the centroid along the normal
//
// Sizes, units and the depth have gone.
//
// The network is asked at nine sites, a pair of faces f by an axis q of the cube. A site has twelve
// features: four of its own, four of its faces, four of its axis. All are invariant under the
// cube's 48 symmetries, which only take one site to another. Its outputs for the point multiply the
// components q of three vectors that turn along (Villar et al., Scalars are universal, 2021).
// `ask_for_patch` says what the four others do.

using detail::point_outputs;
using detail::site_count;
using detail::site_features;
using detail::site_outputs;
// Places of the other outputs.
constexpr int to_volume = 3, to_precision = 4, to_coupling = 5, to_push = 6;

// The cut cube, for lanes F of either precision. Rows of `slant` are the normals of the pairs of
// faces. So its columns, like the other triples, have one number for each pair of faces f.
template <class F>
struct CutCube {
  Columns<F> slant;
  Triple<F> cut;  // how far both faces f cut into the cube, 0 (they miss it) to 2 (nothing is left)
  Triple<F> push;  // how much further the lower face cuts than the upper one
};

// Features that the sites of a pair of faces, of an axis, and one site have.
template <class F>
struct SiteFeatures {
  // By f: cut, |push|, push · push of the others along it, cut of all faces.
  Triple<F> of_faces[4];
  // By q: Σ slant · cut, |Σ slant · push|, the larger of the former along the other axes,
  // |Σ slant · push| summed over the axes.
  Triple<F> of_axis[4];
  // [q], by f: |slant · cut|, |slant · push|, slant · push · that of the others, larger slant along
  // another axis · cut.
  Triple<F> of_site[3][4];
};
// What the three outputs of site (f, q) for the point multiply:
//
//   the push of the faces f along their normal
//   the push of the others along these faces, times their cut
//   what the others' normals have of this push
template <class F>
struct SiteVectors {
  Triple<F> along[3][point_outputs];  // [q], by f
};

// Slants and pushes are shortened by this. It is far below float32's rounding of what they are added
// to; rounded zeros of float64 would make denormal products, which take a hundred times as long.
constexpr double least_slant = 1e-9;

template <class T>
BC_INLINE T shortened(T x) {
  T length = max(abs(x) - least_slant, T{});
  return select<T>(x >= 0.0, length, -length);
}

// The cut cube in float64. Faces are as wide as the bounds took them: one in a plane with the
// cube's face cuts nothing.
template <class T>
BC_INLINE CutCube<T> cut_cube(const OverlapBounds<T>& bounds, T size) {
  Columns<T> normals;
  for (int k = 0; k < 3; ++k) normals[k] = spread(bounds.half, k) * bounds.other_axes[k];
  Triple<T> one = uniform(splat<T>(1.0));
  Triple<T> inverse = one / ((abs(normals[0]) + abs(normals[1])) + abs(normals[2]));
  auto cut_by = [&](const Triple<T>& reach) -> Triple<T> {
    return min(one + one, max(Triple<T>{}, one - reach * inverse));
  };
  Triple<T> half = bounds.other_half + flush * size;
  Triple<T> upper = cut_by(half - bounds.other_offset);
  Triple<T> lower = cut_by(half + bounds.other_offset);
  auto shorten = [](auto x) { return shortened(x); };
  CutCube<T> cube;
  for (int k = 0; k < 3; ++k) cube.slant[k] = each(shorten, normals[k] * inverse);
  cube.cut = upper + lower;
  cube.push = each(shorten, lower - upper);
  return cube;
}

template <class F>
BC_INLINE void describe(const CutCube<F>& cube, SiteFeatures<F>& features,
                        SiteVectors<F>& vectors) {
  const Columns<F>& slant = cube.slant;
  const Triple<F>&cut = cube.cut, &push = cube.push;
  // The numbers of the next pair of faces or axis, and of the one after it.
  auto next = [](const Triple<F>& x) { return rotated(x); };
  auto last = [](const Triple<F>& x) { return rotated(rotated(x)); };
  // By f: the cosine of the two others, and their push along these faces.
  Triple<F> cosine = (next(slant[0]) * last(slant[0]) + next(slant[1]) * last(slant[1])) +
                     next(slant[2]) * last(slant[2]);
  Triple<F> along = last(cosine) * next(push) + next(cosine) * last(push);
  Triple<F> next_cut = last(cosine) * next(cut), last_cut = next(cosine) * last(cut);
  // By q.
  Columns<F> normals = transpose(slant);
  Triple<F> shift = normals * push, shifts = abs(shift), slanted = abs(normals) * cut;

  features.of_faces[0] = cut;
  features.of_faces[1] = abs(push);
  features.of_faces[2] = push * along;
  features.of_faces[3] = total(cut);
  features.of_axis[0] = slanted;
  features.of_axis[1] = shifts;
  features.of_axis[2] = max(next(slanted), last(slanted));
  features.of_axis[3] = total(shifts);
  for (int q = 0; q < 3; ++q) {
    const Triple<F>& s = slant[q];
    Triple<F> pushed = s * push, larger = max(abs(slant[(q + 1) % 3]), abs(slant[(q + 2) % 3]));
    features.of_site[q][0] = abs(s) * cut;
    features.of_site[q][1] = abs(pushed);
    features.of_site[q][2] = pushed * (spread(shift, q) - pushed);
    features.of_site[q][3] = larger * cut;
    vectors.along[q][0] = pushed;
    vectors.along[q][1] = s * (cut * along);
    vectors.along[q][2] = push * (next(s) * next_cut + last(s) * last_cut);
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

// --- The answer ---

// eˣ for x from −80 to 80, to 2 ulp; NaN for NaN. For lanes F of float32.
template <class F>
BC_INLINE F exp(F x) {
  using Bits = std::conditional_t<is_scalar<F>, uint32_t, Mask<F>>;
  constexpr float rounder = 0x1.8p23F;  // added, it leaves a whole number in the low bits
  F shifted = x * 0x1.715476p0F + rounder, whole = shifted - rounder;
  F rest = (x - whole * 0x1.62ep-1F) - whole * 0x1.0bfbe8p-15F;  // x − whole · ln 2
  F series = splat<F>(1.0F / 720.0F);
  constexpr float factors[] = {1.0F / 120.0F, 1.0F / 24.0F, 1.0F / 6.0F, 0.5F, 1.0F, 1.0F};
  for (float factor : factors) series = series * rest + factor;
  Bits power;
  std::memcpy(&power, &shifted, sizeof power);
  power = (power << 23) + 0x3f800000;  // the bits of 2 to the power of the whole number
  F scale;
  std::memcpy(&scale, &power, sizeof scale);
  return series * scale;
}

// Volumes are at least this power of e by those of the bounds. Precisions along an axis are at most
// this power of e by that of an uncut cube.
constexpr float least_log_volume = -80.0F, most_stretch = 6.0F;

// Precision of an uncut cube along an axis: its variance is 1/3.
constexpr float cube_precision = 3.0F;

// Couplings are cut to this, four times what trained weights give. Scaled to a unit diagonal of its
// first term, the precision then has eigenvalues from 1 to 1,200. Cofactors in float32 err by at
// most 2⁻²¹ of the square of the latter, which keeps their matrix, of eigenvalues from 1 on,
// positive definite.
constexpr float coupling_reach = 12.0F;

// What the network says of a cut cube, in half extents.
template <class T>
struct CubeMoments {
  Triple<T> centroid;             // from the middle
  Triple<T> volume;               // by that of the cube, three times
  Triple<T> variance, covariant;  // of the covariance: xx, yy, zz, and yz, xz, xy
};

// The sums over the faces f of three numbers by f: [q] becomes q.
template <class F>
BC_INLINE Triple<F> over_faces(const Columns<F>& parts) {
  Columns<F> by_axis = transpose(parts);
  return (by_axis[0] + by_axis[1]) + by_axis[2];
}

// The inverse of the matrix P of a diagonal xx, yy, zz and the rest yz, xz, xy, by its cofactors.
template <class F>
BC_INLINE void invert(Triple<F>& diagonal, Triple<F>& rest) {
  auto next = [](const Triple<F>& x) { return rotated(x); };
  auto last = [](const Triple<F>& x) { return rotated(rotated(x)); };
  Triple<F> cofactors = next(diagonal) * last(diagonal) - rest * rest;
  Triple<F> others = next(rest) * last(rest) - diagonal * rest;
  F determinant = (diagonal[0] * cofactors[0] + rest[1] * others[1]) + rest[2] * others[2];
  Triple<F> inverse = uniform(splat<F>(1.0F) / determinant);
  diagonal = cofactors * inverse;
  rest = others * inverse;
}

// Volume and covariance from the outputs o at the sites (f, q), with slants s, cuts k, pushes p:
//
//   volume of the cube · exp(min(0, Σ_fq |s_fq| k_f o_volume))
//   covariance = P⁻¹,  P = diag(D) + Σ_f k_f b_f b_fᵀ + v vᵀ
//   D_q = 3 exp(Σ_f |s_fq| k_f o_precision) ≥ 3
//   b_f(q) = s_fq o_coupling,  v(q) = Σ_f s_fq p_f o_push
//
// A cut by two parallel planes adds to a Gaussian's precision along their normal, hence the form of
// P. It is positive definite, as k ≥ 0 and D > 0. An uncut cube is exact. A sign change of the faces
// f turns s_f and p_f, one of the axis q turns b(q) and v(q): the covariance turns along.
template <class F>
BC_INLINE void ask_for_patch(const CutCube<F>& cube, const SiteFeatures<F>& features,
                             const SiteVectors<F>& vectors, const SiteOutputs<F>& outputs,
                             CubeMoments<F>& said) {
  Triple<F> reach = uniform(splat<F>(coupling_reach));
  Columns<F> volumes, stretches, couplings, pushes, squares, products;
  for (int q = 0; q < 3; ++q) {
    const auto& out = outputs.at[q];
    const Triple<F>& slanted = features.of_site[q][0];
    volumes[q] = slanted * out[to_volume];
    stretches[q] = slanted * out[to_precision];
    couplings[q] = clamp(cube.slant[q] * out[to_coupling], reach);
    pushes[q] = vectors.along[q][0] * out[to_push];
  }
  for (int q = 0; q < 3; ++q) {
    squares[q] = cube.cut * (couplings[q] * couplings[q]);
    products[q] = cube.cut * (couplings[(q + 1) % 3] * couplings[(q + 2) % 3]);
  }
  F log_volume = total((volumes[0] + volumes[1]) + volumes[2])[0];
  said.volume = uniform(exp(min(F{}, max(splat<F>(least_log_volume), log_volume))));

  Triple<F> most = uniform(splat<F>(most_stretch));
  Triple<F> stretch = min(most, max(Triple<F>{}, over_faces(stretches)));
  Triple<F> push = clamp(over_faces(pushes), reach);
  Triple<F> own = cube_precision * each([](auto x) { return exp(x); }, stretch);
  said.variance = (own + over_faces(squares)) + push * push;
  said.covariant = over_faces(products) + rotated(push) * rotated(rotated(push));
  invert<F>(said.variance, said.covariant);
}

// What the network says of a group of cubes, by its first `asked` outputs.
template <int asked, class T, int group>
BC_INLINE void ask(const NetworkView& network, const CutCube<T> (&cubes)[group],
                   CubeMoments<T> (&answers)[group]) {
  using F = Narrow<T>;
  CutCube<F> cube = narrow(cubes);
  SiteFeatures<F> features;
  SiteVectors<F> vectors;
  SiteOutputs<F> outputs;
  describe(cube, features, vectors);
  forward<asked>(network, features, outputs);
  Columns<F> parts;  // [q], by f
  for (int q = 0; q < 3; ++q) {
    const auto& out = outputs.at[q];
    const auto& along = vectors.along[q];
    parts[q] = (out[0] * along[0] + out[1] * along[1]) + out[2] * along[2];
  }
  CubeMoments<F> said{};
  said.centroid = over_faces(parts);
  if constexpr (asked == site_outputs) ask_for_patch(cube, features, vectors, outputs, said);
  for (int g = 0; g < group; ++g)
    answers[g] = {widen<T>(said.centroid, g), widen<T>(said.volume, g), widen<T>(said.variance, g),
                  widen<T>(said.covariant, g)};
}

// The answer [m] from the middle of the bounding box, cut to where a centroid can be.
template <class T>
BC_INLINE Triple<T> within_reach(const OverlapBounds<T>& bounds, const Triple<T>& answer) {
  return bounds.half * clamp(answer, uniform(splat<T>(centroid_reach)));
}

// A point in the bounds' frame [m], and whether it lies in both boxes.
template <class T>
struct Placed {
  Triple<T> point;
  Mask<T> inside;
};

// Move the network's answer into both boxes: twice to the nearest point of the other box, and back
// to the nearest point of the box whose frame it is.
template <class T>
BC_INLINE Placed<T> place(const OverlapBounds<T>& bounds, const Triple<T>& answer, T size) {
  Columns<T> to_other = bounds.other_axes, from_other = transpose(to_other);
  auto in_other = [&](const Triple<T>& point) -> Triple<T> {
    return bounds.other_offset + to_other * (point - bounds.middle);
  };
  Triple<T> point = clamp(bounds.middle + within_reach(bounds, answer), bounds.own_half);
#pragma GCC unroll 2
  for (int round = 0; round < 2; ++round) {
    Triple<T> at = in_other(point), back = clamp(at, bounds.other_half) - at;
    point = clamp(point + from_other * back, bounds.own_half);
  }
  // Each comparison fails for NaN.
  Triple<T> beyond = abs(in_other(point)) - bounds.other_half;
  Mask<T> inside = beyond[0] <= place_tolerance * size;
  inside &= beyond[1] <= place_tolerance * size;
  inside &= beyond[2] <= place_tolerance * size;
  return {point, inside};
}

// Whether the network may be asked: the pair is of the kind that it was trained for, and the
// overlap has a volume.
template <class T>
BC_INLINE Mask<T> in_range(const Pair<T>& pair, T separation, const OverlapBounds<T>& bounds) {
  T long_a = largest(pair.half_a), short_a = smallest(pair.half_a);
  T long_b = largest(pair.half_b), short_b = smallest(pair.half_b);
  // Each quantity by its limit: 1 at the border of the range.
  T excess = max(long_a / (aspect_max * short_a), long_b / (aspect_max * short_b));
  excess = max(excess, max(long_a, long_b) / (size_ratio_max * min(long_a, long_b)));
  excess = max(excess, -separation / (2.0 * depth_max * min(short_a, short_b)));
  return (excess <= range_slack) & (smallest(components<T>(bounds.half)) >= flat * pair.size);
}

// Volume and covariance of the overlap, bounds' frame.
template <class T>
BC_INLINE void scale_patch(const OverlapBounds<T>& bounds, const CubeMoments<T>& said,
                           Moments<T>& found) {
  Vec<T> half = components<T>(bounds.half);
  found.volume = (8.0 * said.volume[0]) * (half[0] * half[1] * half[2]);
  for (int k = 0; k < 3; ++k) {
    found.covariance(k, k) = said.variance[k] * (half[k] * half[k]);
    int i = (k + 1) % 3, j = (k + 2) % 3;
    found.covariance(i, j) = said.covariant[k] * (half[i] * half[j]);
  }
}

// The model for bounds of one method. With `asks_patch` it gives all moments, else the centroid alone.
// By the edges it gives the centroid alone, as it did formerly.
template <Network::Bounds method, bool asks_patch = true>
struct MlpModelBy {
  NetworkView network;

  static constexpr bool gives_patch = asks_patch && method == Network::Bounds::slab;
  template <class T>
  using Found = std::conditional_t<gives_patch, Moments<T>, Vec<T>>;
  // How many queries of T it takes at once: float32 lanes are twice as many.
  template <class T>
  static constexpr int group = is_scalar<T> ? 1 : 2;

  // The bounds of a pressed pair.
  template <class T>
  BC_INLINE static OverlapBounds<T> bounds_of(const Pair<T>& pair, const SeparatingAxis<T>& axis) {
    if constexpr (method == Network::Bounds::edges) {
      return bounds_by_edges(pair);
    } else {
      return bounds_by_slab(pair, axis.normal, max(-axis.separation, depth_floor * pair.size));
    }
  }

  // What it finds, for the pairs that touch.
  template <class T, int count>
  BC_INLINE void solve(const Query<T> (&queries)[count], Found<T> (&found)[count],
                       Counts& counts) const {
    OverlapBounds<T> bounds[count];
    CutCube<T> cubes[count];
    CubeMoments<T> answers[count];
    Triple<T> pressed_offset[count];
    for (int g = 0; g < count; ++g) {
      Pair<T> pair = queries[g].pair;
      enforce_minimum_depth(pair, queries[g].axis);
      pressed_offset[g] = triple(pair.offset_a);
      bounds[g] = bounds_of(pair, queries[g].axis);
      cubes[g] = cut_cube(bounds[g], pair.size);
    }
    ask<gives_patch ? site_outputs : point_outputs>(network, cubes, answers);
    for (int g = 0; g < count; ++g) {
      const Query<T>& q = queries[g];
      Placed<T> placed = place(bounds[g], answers[g].centroid, q.pair.size);
      Mask<T> answered = in_range(q.pair, q.axis.separation, bounds[g]) & placed.inside;
      Moments<T> one;
      Triple<T> from_b = pressed_offset[g] + columns(q.pair.rotation) * placed.point;
      one.centroid = components<T>(select(bounds[g].in_b, from_b, placed.point));
      if constexpr (gives_patch) {
        scale_patch(bounds[g], answers[g], one);
        answered &= (one.volume > 0.0) & (trace(one.covariance) > 0.0);
        Mat<T> axes = select(bounds[g].in_b, q.pair.axes_b, q.pair.axes_a);
        one.covariance = rotated(axes, one.covariance);
      }
      Mask<T> fallback = (answered == 0) & q.touching;
      if (any(fallback)) {
        for (int i = 0; i < width<T>; ++i) {
          if (!lane(fallback, i)) continue;
          ++counts.exact;
          Counts unused;
          set_lane(one, i, exact_overlap(lane(q, i), unused));
        }
      }
      if constexpr (gives_patch) {
        found[g] = one;
      } else {
        found[g] = one.centroid;
      }
    }
  }
};
// The model that is shipped. Bounds by the edges are kept as a measured baseline.
using MlpModel = MlpModelBy<Network::Bounds::slab>;
using MlpPointModel = MlpModelBy<Network::Bounds::slab, false>;

}  // namespace box_contact::BOX_CONTACT_SET
