// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What the network is told of an overlap: its bounds as a cut cube, and the features of nine sites.
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
#pragma once

#include "../overlap/bounds.hpp"
#include "../rows.hpp"

namespace box_contact::BOX_CONTACT_SET {

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

}  // namespace box_contact::BOX_CONTACT_SET
