// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What the network says of a cut cube: centroid, volume and covariance.
#pragma once

#include "network.hpp"

namespace box_contact::BOX_CONTACT_SET {

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

}  // namespace box_contact::BOX_CONTACT_SET
