// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The columns between one lower face of Q and the reference face, and their moments.
//
// A point of the face is o + a e + b g, 0 ≤ a ≤ length_a, 0 ≤ b ≤ length_b. It lies under the water
// if its height a e_z + b g_z is at most 1, and it counts where P's side faces x = low_x … leave it.
// Seven lines bound this region: the far edges a = length_a and b = length_b, the waterline, and four
// lines of P's side faces. The lines through o drop out: the moments are sums over triangles from o
// to a piece of each line. On a triangle all integrands are polynomials, and 2-point Gauss-Legendre
// quadrature along the piece is exact.
//
// A line runs along b (u = b, w = a), or along a (u = a, w = b), whichever changes faster along it
// relative to the face's edges. The width of a sliver may be 1e-9 of its length.
// Two lines that are nearly parallel then run alike, and compute their crossing by the same formula.
// So their pieces meet in one point, however it is rounded, and also if both lines coincide.
//
// Everything is float32. Lengths are in a unit of the pair, heights in that of the origin's depth.
#pragma once

#include "../lanes/float_lanes.hpp"

namespace box_contact::BOX_CONTACT_SET {

// Along one coordinate: a face's edges and P's two side faces.
template <class F>
struct Across {
  F e, g;        // components of the edges
  F by_e, by_g;  // their reciprocals
  F low, high;   // P's side faces, seen from o
};

template <class F>
struct LowerFace {
  Across<F> x, y;
  F ez, gz, by_ez, by_gz;  // heights per length
  F by_nx, by_ny, by_nz;   // reciprocals of the components of e × g
  F length_a, length_b;
};

// Moments of the columns over one face, per unit of its Jacobian. h: height above the face.
template <class F>
struct FaceMoments {
  F volume, a, b, h, aa, bb, ab, ah, bh, hh;
  F gross;  // sum of the magnitudes that the triangles are differences of; `volume` is their sum
};

namespace lower_face {

// One piece of a line: in coordinates of the face, from one end to the other, and twice the area of
// its triangle with o.
template <class F>
struct Piece {
  F a_middle, b_middle, a_half, b_half, twice_area;  // half: half the way between Gauss points
  F magnitude;  // of the two terms whose difference `twice_area` is
};

constexpr float gauss = 0.57735026919F;  // 1/√3
constexpr float nearly = 1.0F + 0x1p-20F;

// How far along its line a piece is, if there is one but for rounding.
template <class F>
BC_INLINE F reach(F from, F to) {
  return select<F>(from <= nearly * to, to, F{});
}

// Sums of weight times monomials over all pieces; `azz` is that of a z².
template <class F>
struct Sums {
  F one, z, zz, zzz, a, az, azz, b, bz, bzz, aa, aaz, ab, abz, bb, bbz, gross;
};

// Add the two Gauss points of a piece.
template <class F>
BC_INLINE void add(const LowerFace<F>& face, const Piece<F>& piece, Sums<F>& sums) {
  F weight = 0.5F * piece.twice_area;
#pragma GCC unroll 2
  for (int n = 0; n < 2; ++n) {
    F a = n ? piece.a_middle + piece.a_half : piece.a_middle - piece.a_half;
    F b = n ? piece.b_middle + piece.b_half : piece.b_middle - piece.b_half;
    F z = a * face.ez + b * face.gz;
    F wz = weight * z, wzz = wz * z, wa = weight * a, waz = wa * z, wb = weight * b, wbz = wb * z;
    sums.z += wz;
    sums.zz += wzz;
    sums.zzz += wzz * z;
    sums.a += wa;
    sums.az += waz;
    sums.azz += waz * z;
    sums.b += wb;
    sums.bz += wbz;
    sums.bzz += wbz * z;
    sums.aa += wa * a;
    sums.aaz += waz * a;
    sums.ab += wa * b;
    sums.abz += waz * b;
    sums.bb += wb * b;
    sums.bbz += wbz * b;
  }
  sums.one += piece.twice_area;
  sums.gross += piece.magnitude;
}
// Add a piece of the waterline, where z = 1.
template <class F>
BC_INLINE void add_waterline(const Piece<F>& piece, Sums<F>& sums) {
  F w = piece.twice_area, wa = w * piece.a_middle, wb = w * piece.b_middle;
  F wp = w * piece.a_half, wq = w * piece.b_half;
  F waa = wa * piece.a_middle + wp * piece.a_half, wbb = wb * piece.b_middle + wq * piece.b_half;
  F wab = wa * piece.b_middle + wp * piece.b_half;
  sums.one += w;
  sums.z += w;
  sums.zz += w;
  sums.zzz += w;
  sums.a += wa;
  sums.az += wa;
  sums.azz += wa;
  sums.b += wb;
  sums.bz += wb;
  sums.bzz += wb;
  sums.aa += waa;
  sums.aaz += waa;
  sums.ab += wab;
  sums.abz += wab;
  sums.bb += wbb;
  sums.bbz += wbb;
  sums.gross += piece.magnitude;
}

// A column from height z to 1 over a point that is a share r of the way from o to its place has the
// height 1 − r z, and triangles have 2 r dr. So each monomial is integrated over r.
template <class F>
BC_INLINE FaceMoments<F> moments_of(const Sums<F>& s) {
  FaceMoments<F> found;
  found.volume = 0.5F * s.one - (1.0F / 3) * s.z;
  found.a = (1.0F / 3) * s.a - 0.25F * s.az;
  found.b = (1.0F / 3) * s.b - 0.25F * s.bz;
  found.h = (0.25F * s.one - (1.0F / 3) * s.z) + 0.125F * s.zz;
  found.aa = 0.25F * s.aa - 0.2F * s.aaz;
  found.ab = 0.25F * s.ab - 0.2F * s.abz;
  found.bb = 0.25F * s.bb - 0.2F * s.bbz;
  found.ah = ((1.0F / 6) * s.a - 0.25F * s.az) + 0.1F * s.azz;
  found.bh = ((1.0F / 6) * s.b - 0.25F * s.bz) + 0.1F * s.bzz;
  found.hh = ((1.0F / 6) * s.one - (1.0F / 3) * s.z) + (0.25F * s.zz - (1.0F / 15) * s.zzz);
  found.gross = 0.5F * s.gross;
  return found;
}

// A line p a + q b = r in its own coordinates: w = (r − minor · u) / major.
template <class F>
struct Line {
  Mask<F> along_b;
  F major, minor, by_major, by_minor, u_most, w_most;

  BC_INLINE Line(F p, F q, F by_p, F by_q, const LowerFace<F>& face)
      : along_b(abs(p) * face.length_a >= abs(q) * face.length_b),
        major(select<F>(along_b, p, q)),
        minor(select<F>(along_b, q, p)),
        by_major(select<F>(along_b, by_p, by_q)),
        by_minor(select<F>(along_b, by_q, by_p)),
        u_most(select<F>(along_b, face.length_b, face.length_a)),
        w_most(select<F>(along_b, face.length_a, face.length_b)) {}

  // What the face leaves of the line.
  BC_INLINE void within_face(F r, F& from, F& to) const {
    F at_0 = r * by_minor, at_most = (r - w_most * major) * by_minor;
    from = max(min(at_0, at_most), F{});
    to = min(max(at_0, at_most), u_most);
  }
  BC_INLINE Piece<F> piece(F r, F from, F to, F signed_r) const {
    // Nothing is left where `to` ≤ `from`. Both may then be huge, which must not give 0 · ∞.
    Mask<F> is_there = to > from;
    F length = select<F>(is_there, to - from, F{}), half = (0.5F * gauss) * length;
    F middle = select<F>(is_there, 0.5F * (from + to), F{}), w_half = (minor * by_major) * half;
    F w_middle = select<F>(is_there, (r - minor * middle) * by_major, F{});
    F by_length = signed_r * abs(by_major);
    return {select<F>(along_b, w_middle, middle),
            select<F>(along_b, middle, w_middle),
            select<F>(along_b, -w_half, half),
            select<F>(along_b, half, -w_half),
            by_length * length,
            abs(by_length) * reach(from, to)};
  }
};

// Add the pieces of the lines of P's two side faces across x or y. `by_corner` and `by_water`: the
// reciprocal determinants with the other coordinate and with the height.
template <class F>
BC_INLINE void add_sides(const LowerFace<F>& face, const Across<F>& own, const Across<F>& other,
                         F by_corner, F by_water, Sums<F>& sums) {
  Line<F> line(own.e, own.g, own.by_e, own.by_g, face);
  F corner = select<F>(line.along_b, by_corner, -by_corner);
  F water = select<F>(line.along_b, by_water, -by_water);
  F other_w = select<F>(line.along_b, other.e, other.g);
  F z_w = select<F>(line.along_b, face.ez, face.gz);
  Mask<F> rises = water * line.by_major > F{};
  F low_end = line.major * other.low, high_end = line.major * other.high;
#pragma GCC unroll 2
  for (int n = 0; n < 2; ++n) {
    F r = n ? own.high : own.low, from, to;
    line.within_face(r, from, to);
    F at_low = (low_end - other_w * r) * corner, at_high = (high_end - other_w * r) * corner;
    from = max(from, min(at_low, at_high));
    to = min(to, max(at_low, at_high));
    F at_water = (line.major - z_w * r) * water;
    to = select<F>(rises, min(to, at_water), to);
    from = select<F>(rises, from, max(from, at_water));
    add(face, line.piece(r, from, to, n ? r : -r), sums);
  }
}

// Cut what a side face's two planes leave of a line at the heights of `line`.
template <class F>
BC_INLINE void cut_water(const Line<F>& line, const Across<F>& across, F by_water, F& from, F& to) {
  F water = select<F>(line.along_b, by_water, -by_water);
  F own_w = select<F>(line.along_b, across.e, across.g);
  F at_low = (own_w - line.major * across.low) * water;
  F at_high = (own_w - line.major * across.high) * water;
  from = max(from, min(at_low, at_high));
  to = min(to, max(at_low, at_high));
}

template <class F>
BC_INLINE void cut_slab(F position, F by_step, F low, F high, F& from, F& to) {
  F at_low = (low - position) * by_step, at_high = (high - position) * by_step;
  from = max(from, min(at_low, at_high));
  to = min(to, max(at_low, at_high));
}

}  // namespace lower_face

// Not inlined: three faces share one copy.
template <class F>
[[gnu::noinline]] FaceMoments<F> moments_over(const LowerFace<F>& face) {
  using namespace lower_face;
  Sums<F> sums{};
  // e × g = (e_y g_z − e_z g_y, e_z g_x − e_x g_z, e_x g_y − e_y g_x).
  add_sides(face, face.x, face.y, face.by_nz, -face.by_ny, sums);
  add_sides(face, face.y, face.x, -face.by_nz, face.by_nx, sums);
  {
    F one = splat<F>(1.0F), from, to;
    Line<F> line(face.ez, face.gz, face.by_ez, face.by_gz, face);
    line.within_face(one, from, to);
    cut_water(line, face.x, -face.by_ny, from, to);
    cut_water(line, face.y, face.by_nx, from, to);
    add_waterline(line.piece(one, from, to, one), sums);
  }
#pragma GCC unroll 2
  for (int n = 0; n < 2; ++n) {
    // The far edge a = length_a, and b = length_b.
    F at = n ? face.length_b : face.length_a, most = n ? face.length_a : face.length_b;
    auto across = [&](const Across<F>& c) { return n ? c.g : c.e; };
    F from{}, to = most, z = n ? face.gz : face.ez;
    // Most are above the water.
    if (!any(at * z < 1.0F)) continue;
    cut_slab(at * across(face.x), n ? face.x.by_e : face.x.by_g, face.x.low, face.x.high, from, to);
    cut_slab(at * across(face.y), n ? face.y.by_e : face.y.by_g, face.y.low, face.y.high, from, to);
    to = min(to, (1.0F - at * z) * (n ? face.by_ez : face.by_gz));
    Mask<F> is_there = to > from;
    F length = select<F>(is_there, to - from, F{}), half = (0.5F * gauss) * length;
    F middle = select<F>(is_there, 0.5F * (from + to), F{});
    Piece<F> piece{n ? middle : at, n ? at : middle, n ? half : F{},
                   n ? F{} : half,  at * length,     at * reach(from, to)};
    add(face, piece, sums);
  }
  return moments_of(sums);
}

}  // namespace box_contact::BOX_CONTACT_SET
