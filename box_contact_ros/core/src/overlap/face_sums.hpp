// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The exact moments of the overlap A∩B without a branch, and a certificate that they are right.
//
// The overlap is bounded by parts of the twelve faces of both boxes. By the divergence theorem its
// volume and first moments are sums over these parts of their areas and first moments. By Stokes'
// theorem those are sums over the parts' edges. An edge of the overlap is a piece of one of the boxes'
// 24 edges, or of one of the 36 lines in which a face of A meets a face of B. Each piece is what
// slabs leave of a line (Kay and Kajiya 1986), a fixed sequence of multiplications and comparisons.
// The cost is the same for every pair.
//
// Rounding may decide twice, and differently, which face an edge meets first. Then a part of a face
// counts twice or not at all. Four steps make the sums sound:
//
// 1. `unflush` moves faces of B that lie in a plane with faces of A inwards, by a few roundings, so
//    that which one bounds the overlap is decided once.
// 2. Faces that cross at so small an angle that rounding is mirrored are left to clipping.
// 3. The origin is not the middle of the overlap, where mirrored errors would cancel.
// 4. The certificate: ∫ x nᵀ dA over the surface is the volume times the identity, and ∫ n dA is
//    zero. Twelve equations hold to a share of the accuracy that is asked of the centroid.
//
// In 36.5 million pairs of 29 families of hard poses, no centroid that passed was off by more than
// 0.14 of `centroid_error`. What does not pass is clipped.
#pragma once

#include "../separating_axis.hpp"
#include "clipping.hpp"
#include "edge_pieces.hpp"

namespace box_contact::BOX_CONTACT_SET {

// What is asked of the centroid: an error of size · max(1e-9, 1e-14 · size / depth).
constexpr double least_centroid_error = 1e-9, centroid_rounding = 1e-14;
// And of the covariance: max(1e-8, 1e-14 · size / depth) of its trace.
constexpr double least_covariance_error = 1e-8;

namespace face_sums {

// Squared sine below which two faces meet in no line.
constexpr double least_sine2 = 1e-26;

// `unflush`: faces within the rounding of their places count as in one plane, if that rounding is
// this small a part of the boxes' thickness there. Needles broke a limit by the size.
constexpr double place_rounding = 0x1p-47, flush_limit = 4e-10;
// Faces that cross at less than this share of the accuracy are left to clipping.
constexpr double mirrored_rounding = 1e-15;

// Rounding moves the areas of faces by about 2⁻⁵³ · size · L, with L the length of all edges, and so
// the centroid by L² / volume times that. In slivers cut off obliquely the areas of the end faces
// may be wrong by opposite amounts, which no equation shows. Of 255,227 slivers that passed without
// this limit, the 191 that were wrong moved by at least 80 times the accuracy by this measure.
// Overlaps of ordinary scenes stay below 0.3.
constexpr double area_rounding = 0x1p-53, sliver_limit = 24.0;

// Depth [of the size] below which the centroid may be outside a box by rounding. The centroid is at
// least 0.14 · depth from every face, and off by at most 1.4e-15 · size² / depth; the two are equal
// at a depth of 1e-7 of the size.
constexpr double safely_inside = 1e-6;
// Distance from a box [of the size] up to which rounding alone puts a point outside.
constexpr double outside_by_rounding = 0x1p-48;

// Squared sine below which rounding can leave a piece of the line of two faces far outside the
// overlap, where it hardly counts in the equations, but in squares. The line is known to
// 2⁻⁵³ · size / sine, so such pieces are within 2⁻⁵³ · size / sine² of it.
constexpr double far_sine2 = 1e-12;
// No point of a convex body is farther from its centroid than √15 times √trace of its covariance
// (Kannan, Lovász and Simonovits 1995). Rounded up.
constexpr double farthest_reach = 3.88;

// Shares of the accuracy that the twelve equations may be off by. The covariance of a wedge between
// faces that are almost parallel may be wrong by six times as much as the diagonal is.
constexpr double off_diagonal_share = 0.03, diagonal_share = 0.3, closure_share = 0.1;
constexpr double wedge_diagonal_share = 0.1;

// Weights of the edges' pieces in the mean, so that it is not the middle of a symmetric overlap.
constexpr EdgeWeights weights_a{0.058, 0.078, 0.043}, weights_b{0.023, 0.043, 0.013};

enum class Side { sigma, tau };

// Sums over the edges of the parts of a box's six faces, by the axis across the face. They are twice
// the area, and three times the first moments along the two axes that follow. `side` is the sign that
// tells a face from the opposite one. Terms of the other sign are added last, in the same order for
// one pair and for W.
template <class T, Side side>
struct FaceSums {
  Four<T> sums[3][3][steps<T>];

  // Number by number: g++ fills the array by string instructions, which take some per cent.
  BC_INLINE FaceSums() {
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i)
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k)
#pragma GCC unroll 4
        for (int n = 0; n < steps<T>; ++n) sums[i][k][n] = Four<T>{};
  }
  // Add a piece at step n, where the face's side is the sign `given`.
  template <Side given>
  BC_INLINE void add(int face, int n, Four<T> twice_area, Four<T> y, Four<T> z) {
    Four<T> terms[3] = {twice_area, twice_area * y, twice_area * z};
    int place = n;
    if constexpr (given != side) {  // σ and τ change places: steps or lanes 1 and 2
      if constexpr (is_scalar<T>) {
        for (Four<T>& term : terms) term = __builtin_shufflevector(term, term, 0, 2, 1, 3);
      } else {
        place = (n & 1) << 1 | n >> 1;
      }
    }
    for (int k = 0; k < 3; ++k) sums[face][k][place] += terms[k];
  }
  // The total of face −, sign 0, or +, sign 1, across an axis.
  BC_INLINE T operator()(int face, int sign, int what) const {
    auto term = [&](int n) -> T {
      if constexpr (is_scalar<T>) {
        return sums[face][what][0][n];
      } else {
        return sums[face][what][n];
      }
    };
    if constexpr (side == Side::sigma) {
      return term(sign) + term(sign + 2);
    } else {
      return term(2 * sign) + term(2 * sign + 1);
    }
  }
};

// Two numbers, for the signs − and + of one side: of a single pair side by side.
template <class T, bool = is_scalar<T>>
struct BothOf {
  T low, high;

  BC_INLINE T sum() const { return low + high; }
  BC_INLINE BothOf operator*(const BothOf& other) const {
    return {low * other.low, high * other.high};
  }
};
template <class T>
struct BothOf<T, true> {
  Lanes<T, 2> both;

  BC_INLINE BothOf(Lanes<T, 2> both) : both(both) {}
  BC_INLINE BothOf(T low, T high) : both{low, high} {}
  BC_INLINE T sum() const { return both[0] + both[1]; }
  BC_INLINE BothOf operator*(const BothOf& other) const { return both * other.both; }
};
template <class T>
using Both = BothOf<T>;

// Terms of the four signs, those with σ ≠ τ negative, summed for each sign of one side.
template <class T, Side side>
BC_INLINE Both<T> by_sign(const Four<T> (&terms)[steps<T>]) {
  constexpr int other = side == Side::sigma ? 2 : 1;  // where the other side's sign is + instead
  if constexpr (is_scalar<T>) {
    return __builtin_shufflevector(terms[0], terms[0], 0, 3) -
           __builtin_shufflevector(terms[0], terms[0], other, 3 - other);
  } else {
    return {terms[0] - terms[other], terms[3] - terms[3 - other]};
  }
}

// Second moments need no sums for each face. An edge belongs to two faces, and counts with the weight
//
//   c = Σ over both of (distance of the face) · (distance of the edge, in the face).
//
// `squares` is Σ c ∫ x xᵀ dl over all edges. With w = c · length, a piece of an edge has
// w · (middle · middleᵀ + length² / 12 · direction · directionᵀ) of it.

// Who wants no second moments passes these as `squares`: all that is only added here is not computed.
struct NoSquares {
  BC_INLINE NoSquares operator()(int, int) const { return {}; }
  template <class T>
  BC_INLINE void operator+=(const T&) const {}
  template <class T>
  BC_INLINE void operator-=(const T&) const {}
};

// Whether no piece of the four lines of a single pair is left. Their zeros change no sum. Of W pairs
// some piece is left almost always.
template <class T>
BC_INLINE bool adds_nothing(const Four<T>& lengths) {
  if constexpr (is_scalar<T>) {
    return !any(lengths != Four<T>{});
  } else {
    return false;
  }
}

// Add the pieces of a box's edges along its axis j. `origin`: in the box's frame.
template <class T, Side side, class Squares>
BC_INLINE void add_edges_along(int j, const EdgePieces<T>& pieces, const Vec<T>& half,
                               const Vec<T>& origin, FaceSums<T, side>& faces, Squares& squares) {
  int a = (j + 1) % 3, b = (j + 2) % 3;
  Four<T> w[steps<T>], w_g[steps<T>], w_x[steps<T>], w_xx[steps<T>], w_ll[steps<T>];
#pragma GCC unroll 4
  for (int n = 0; n < steps<T>; ++n) {
    Four<T> f = sigma<T>(n) * half[a] - origin[a], g = tau<T>(n) * half[b] - origin[b];
    Four<T> s = pieces.s[j][n], t = pieces.t[j][n];
    Four<T> length = max(t - s, Four<T>{}), middle = 0.5 * (s + t) - origin[j];
    if (adds_nothing<T>(length)) return;
    Four<T> by_f = length * f, by_g = length * g;
    faces.template add<Side::sigma>(a, n, tau<T>(n) * by_g, g, middle);
    faces.template add<Side::tau>(b, n, sigma<T>(n) * by_f, middle, f);
    // The distance of either face is the distance in the other.
    w[n] = by_f * (g + g);
    w_g[n] = w[n] * g;
    w_x[n] = w[n] * middle;
    w_xx[n] = w_x[n] * middle;
    w_ll[n] = (w[n] * length) * length;
  }
  Both<T> f{-half[a] - origin[a], half[a] - origin[a]};
  Both<T> g{-half[b] - origin[b], half[b] - origin[b]};
  squares(a, a) += (f * f * by_sign<T, Side::sigma>(w)).sum();
  squares(b, b) += (g * g * by_sign<T, Side::tau>(w)).sum();
  squares(a, b) += (f * by_sign<T, Side::sigma>(w_g)).sum();
  squares(a, j) += (f * by_sign<T, Side::sigma>(w_x)).sum();
  squares(b, j) += (g * by_sign<T, Side::tau>(w_x)).sum();
  squares(j, j) +=
      by_sign<T, Side::sigma>(w_xx).sum() + (1.0 / 12.0) * by_sign<T, Side::sigma>(w_ll).sum();
}

template <class T, Side side, class Squares>
BC_INLINE void add_edges(const EdgePieces<T>& pieces, const Vec<T>& half, const Vec<T>& origin,
                         FaceSums<T, side>& faces, Squares& squares) {
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) add_edges_along(j, pieces, half, origin, faces, squares);
}

// A piece of the line in which a face of A, at the sign σ of axis i, meets a face of B, at τ of axis
// j. Its points are p a_i + q b_j + t d from the origin, d = a_i × b_j, with t from `from` to `to`.
template <class T>
struct LinePiece {
  Four<T> f, g;  // the origin's distances from the faces, along a_i and b_j
  Four<T> p, q, at_y, at_z, at_k, at_l, from, to;
};

// The four lines of a pair of axes.
template <class T>
struct Lines {
  const Pair<T>& pair;
  const Vec<T>&origin_a, &origin_b;
  int i, y, z, j, k, l;
  T cosine, sine2, scale, sine2_or_one;
  T along_y, along_z, along_k, along_l, slab_y, slab_z, slab_k, slab_l;

  // `origin_a`, `origin_b`: the origin in A's frame and in B's.
  BC_INLINE Lines(const Pair<T>& pair, const Mat<T>& inverse, const Vec<T>& origin_a,
                  const Vec<T>& origin_b, int i, int j)
      : pair(pair),
        origin_a(origin_a),
        origin_b(origin_b),
        i(i),
        y((i + 1) % 3),
        z((i + 2) % 3),
        j(j),
        k((j + 1) % 3),
        l((j + 2) % 3) {
    const Mat<T>& r = pair.rotation;
    cosine = r[i][j];
    sine2 = r[y][j] * r[y][j] + r[z][j] * r[z][j];
    Mask<T> there = sine2 > least_sine2;
    sine2_or_one = select<T>(there, sine2, splat<T>(1.0));
    scale = 1.0 / sine2_or_one;
    sine2 = select<T>(there, sine2, T{});
    // Along d coordinates change by entries of R: −r_zj, r_yj in A, r_il, −r_ik in B.
    along_y = -inverse[z][j], along_z = inverse[y][j];
    along_k = inverse[i][l], along_l = -inverse[i][k];
    slab_y = pair.half_a[y] * abs(along_y), slab_z = pair.half_a[z] * abs(along_z);
    slab_k = pair.half_b[k] * abs(along_k), slab_l = pair.half_b[l] * abs(along_l);
  }
  BC_INLINE LinePiece<T> piece(int n) const {
    const Mat<T>& r = pair.rotation;
    LinePiece<T> line;
    line.f = sigma<T>(n) * pair.half_a[i] - origin_a[i];
    line.g = tau<T>(n) * pair.half_b[j] - origin_b[j];
    line.p = (line.f - cosine * line.g) * scale, line.q = (line.g - cosine * line.f) * scale;
    line.at_y = line.q * r[y][j], line.at_z = line.q * r[z][j];
    line.at_k = line.p * r[i][k], line.at_l = line.p * r[i][l];
    Four<T> y_by = (origin_a[y] + line.at_y) * along_y, z_by = (origin_a[z] + line.at_z) * along_z;
    Four<T> k_by = (origin_b[k] + line.at_k) * along_k, l_by = (origin_b[l] + line.at_l) * along_l;
    line.from = -min(min(slab_y + y_by, slab_z + z_by), min(slab_k + k_by, slab_l + l_by));
    line.to = min(min(slab_y - y_by, slab_z - z_by), min(slab_k - k_by, slab_l - l_by));
    return line;
  }
};

// Add the pieces of the lines in which faces of A across axis i meet faces of B. `squares` is in A's
// frame. `least`: the least squared sine of faces that meet.
template <class T, class Squares>
BC_INLINE void add_lines_of(int i, T& least, const Pair<T>& pair, const Mat<T>& inverse,
                            const Vec<T>& origin_a, const Vec<T>& origin_b,
                            FaceSums<T, Side::sigma>& faces_a, FaceSums<T, Side::tau>& faces_b,
                            Squares& squares) {
  const Mat<T>& r = pair.rotation;
  int y = (i + 1) % 3, z = (i + 2) % 3;
  Four<T> w_all[steps<T>]{}, w_y[steps<T>]{}, w_z[steps<T>]{};
  Four<T> w_yy[steps<T>]{}, w_yz[steps<T>]{}, w_zz[steps<T>]{};
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    Lines<T> lines(pair, inverse, origin_a, origin_b, i, j);
    least = min(least, lines.sine2_or_one);
    if constexpr (is_scalar<T>) {
      LinePiece<T> line = lines.piece(0);
      if (adds_nothing<T>(lines.sine2 * max(line.to - line.from, Four<T>{}))) continue;
    }
    int k = (j + 1) % 3, l = (j + 2) % 3;
    Four<T> along[steps<T>];
#pragma GCC unroll 4
    for (int n = 0; n < steps<T>; ++n) {
      LinePiece<T> line = lines.piece(n);
      Four<T> span = max(line.to - line.from, Four<T>{}), length = lines.sine2 * span;
      Four<T> middle = 0.5 * (line.from + line.to);
      Four<T> by_p = length * line.p, by_q = length * line.q;
      Four<T> at_y = line.at_y - middle * r[z][j], at_z = line.at_z + middle * r[y][j];
      faces_a.template add<Side::sigma>(i, n, tau<T>(n) * by_q, at_y, at_z);
      faces_b.template add<Side::tau>(j, n, sigma<T>(n) * by_p, line.at_k + middle * r[i][l],
                                      line.at_l - middle * r[i][k]);
      Four<T> w = line.f * by_q + line.g * by_p, by_y = w * at_y, by_z = w * at_z;
      w_all[n] += w;
      w_y[n] += by_y;
      w_z[n] += by_z;
      w_yy[n] += by_y * at_y;
      w_yz[n] += by_y * at_z;
      w_zz[n] += by_z * at_z;
      along[n] = w * (span * span);
    }
    // Along d, whose coordinates are 0, −r_zj and r_yj.
    T square = (1.0 / 12.0) * by_sign<T, Side::sigma>(along).sum();
    T by_y = square * r[y][j], by_z = square * r[z][j];
    squares(y, y) += by_z * r[z][j];
    squares(y, z) -= by_y * r[z][j];
    squares(z, z) += by_y * r[y][j];
  }
  Both<T> f{-pair.half_a[i] - origin_a[i], pair.half_a[i] - origin_a[i]};
  squares(i, i) += (f * f * by_sign<T, Side::sigma>(w_all)).sum();
  squares(i, y) += (f * by_sign<T, Side::sigma>(w_y)).sum();
  squares(i, z) += (f * by_sign<T, Side::sigma>(w_z)).sum();
  squares(y, y) += by_sign<T, Side::sigma>(w_yy).sum();
  squares(y, z) += by_sign<T, Side::sigma>(w_yz).sum();
  squares(z, z) += by_sign<T, Side::sigma>(w_zz).sum();
}

template <class T, class Squares>
BC_INLINE T add_lines(const Pair<T>& pair, const Mat<T>& inverse, const Vec<T>& origin_a,
                      const Vec<T>& origin_b, FaceSums<T, Side::sigma>& faces_a,
                      FaceSums<T, Side::tau>& faces_b, Squares& squares) {
  T least = splat<T>(1.0);
  if constexpr (is_scalar<T>) {
    add_lines_of(0, least, pair, inverse, origin_a, origin_b, faces_a, faces_b, squares);
    add_lines_of(1, least, pair, inverse, origin_a, origin_b, faces_a, faces_b, squares);
    add_lines_of(2, least, pair, inverse, origin_a, origin_b, faces_a, faces_b, squares);
  } else {
#pragma GCC unroll 1  // unrolled, the code would not fit the first cache
    for (int i = 0; i < 3; ++i)
      add_lines_of(i, least, pair, inverse, origin_a, origin_b, faces_a, faces_b, squares);
  }
  return least;
}

// The squared distance from the origin of the farthest piece that faces almost parallel leave.
template <class T>
[[gnu::noinline]] T farthest_piece2(const Pair<T>& pair, const Mat<T>& inverse,
                                    const Vec<T>& origin_a, const Vec<T>& origin_b) {
  Four<T> farthest2{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      Lines<T> lines(pair, inverse, origin_a, origin_b, i, j);
      T sine2 = lines.sine2, counts = select<T>(sine2 < far_sine2, splat<T>(1.0), T{});
      for (int n = 0; n < steps<T>; ++n) {
        LinePiece<T> line = lines.piece(n);
        Four<T> middle = 0.5 * (line.from + line.to);
        Four<T> distance2 = line.f * line.f + sine2 * (line.q * line.q + middle * middle);
        farthest2 = max(farthest2, select<Four<T>>((line.to > line.from) & (sine2 > Four<T>{}),
                                                   counts * distance2, Four<T>{}));
      }
    }
  if constexpr (is_scalar<T>) {
    return max(max(farthest2[0], farthest2[1]), max(farthest2[2], farthest2[3]));
  } else {
    return farthest2;
  }
}

// Over a box's six faces, in its own frame and about the origin.
template <class T, class Squares>
struct SurfaceIntegrals {
  Mat<T> x_n;      // ∫ x nᵀ dA; rows are components of x
  Vec<T> first;    // Σ distance of the face · ∫ x dA
  Squares second;  // four times Σ distance of the face · ∫ x xᵀ dA
  Vec<T> normal;   // 2 ∫ n dA
  Vec<T> area;     // of both faces across each axis, signed sums: about their area
};

// `squares` has a face's ∫ x xᵀ dA four times in the face's plane, three times where one x is across
// it, and twice where both are.
template <class T, Side side, class Squares>
BC_INLINE SurfaceIntegrals<T, Squares> integrate(const FaceSums<T, side>& faces,
                                                 const Squares& squares, const Vec<T>& half,
                                                 const Vec<T>& origin) {
  SurfaceIntegrals<T, Squares> sum;
  sum.first = {};
  sum.second = squares;
  for (int i = 0; i < 3; ++i) {
    int y = (i + 1) % 3, z = (i + 2) % 3;
    T low = -half[i] - origin[i], high = half[i] - origin[i];
    T area_low = faces(i, 0, 0), area_high = faces(i, 1, 0);
    T x_low = low * (0.5 * area_low), x_high = high * (0.5 * area_high);
    T y_low = faces(i, 0, 1) * (1.0 / 3.0), y_high = faces(i, 1, 1) * (1.0 / 3.0);
    T z_low = faces(i, 0, 2) * (1.0 / 3.0), z_high = faces(i, 1, 2) * (1.0 / 3.0);
    sum.x_n[i][i] = x_high - x_low;
    sum.x_n[y][i] = y_high - y_low;
    sum.x_n[z][i] = z_high - z_low;
    sum.first[i] += high * x_high - low * x_low;
    sum.first[y] += high * y_high - low * y_low;
    sum.first[z] += high * z_high - low * z_low;
    T low2 = low * low, high2 = high * high;
    sum.second(i, i) += 2.0 * (high2 * x_high - low2 * x_low);
    sum.second(i, y) += high2 * y_high - low2 * y_low;
    sum.second(i, z) += high2 * z_high - low2 * z_low;
    sum.normal[i] = area_high - area_low;
    sum.area[i] = 0.5 * abs(area_low + area_high);
  }
  return sum;
}

// Whether no face of B is nearly parallel to a face of A, for a single pair at once. The limits are
// those of `unflush`.
template <class T>
BC_INLINE bool is_far_from_flush(const Pair<T>& pair, T rounding, T mirrored) {
  if constexpr (packed<T>) {
    Columns<T> entry = abs(columns(pair.rotation));
    Triple<T> half_a = triple(pair.half_a);
    Mask<Triple<T>> near{};
    for (int j = 0; j < 3; ++j) {
      int k = (j + 1) % 3, l = (j + 2) % 3;
      Triple<T> thickness = min(half_a, splat<Triple<T>>(pair.half_b[j]));
      Triple<T> tolerance = rounding + (pair.half_b[k] * entry[k] + pair.half_b[l] * entry[l]);
      near |= tolerance <= flush_limit * thickness + 2.0 * rounding;
      near |= (entry[k] + entry[l]) * thickness < mirrored;
    }
    return !any(near);
  } else {
    return false;
  }
}

// Move faces of B that may lie in the plane of a face of A, and look the same way, inwards until
// they are clear of it. Returns where rounding may be mirrored instead.
template <class T>
BC_INLINE Mask<T> unflush(Pair<T>& pair, T depth) {
  T rounding = place_rounding * pair.size;
  T mirrored = mirrored_rounding *
               min(pair.size * (1.0 / least_centroid_error), (1.0 / centroid_rounding) * depth);
  Mask<T> risky = depth != depth;
  int faces_a = is_far_from_flush(pair, rounding, mirrored) ? 0 : 3;
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    int k = (j + 1) % 3, l = (j + 2) % 3;
    T plus = pair.half_b[j], minus = plus;
#pragma GCC unroll 3
    for (int i = 0; i < faces_a; ++i) {
      const T(&entry)[3] = pair.rotation.m[i];
      T thickness = min(pair.half_a[i], pair.half_b[j]);
      T tolerance = rounding + (pair.half_b[k] * abs(entry[k]) + pair.half_b[l] * abs(entry[l]));
      Mask<T> flat = tolerance <= flush_limit * thickness + 2.0 * rounding;
      Mask<T> doubtful = (abs(entry[k]) + abs(entry[l])) * thickness < mirrored;
      if (!any(flat | doubtful)) continue;
      T middle = pair.half_b[j] * abs(entry[j]) - pair.half_a[i];
      T shift = select<T>(entry[j] > 0.0, pair.offset_a[i], -pair.offset_a[i]);
      T beyond_plus = middle + shift, beyond_minus = middle - shift;
      Mask<T> flush_plus = abs(beyond_plus) <= tolerance,
              flush_minus = abs(beyond_minus) <= tolerance;
      risky |= (flush_plus | flush_minus) & doubtful & (flat == 0);
      plus = select<T>(flat & flush_plus, pair.half_b[j] - (beyond_plus + tolerance), plus);
      minus = select<T>(flat & flush_minus, pair.half_b[j] - (beyond_minus + tolerance), minus);
    }
    T shift = 0.5 * (plus - minus);
    pair.half_b[j] = 0.5 * (plus + minus);
    pair.offset_b[j] += shift;
    pair.offset_a = pair.offset_a + shift * column(pair.rotation, j);
  }
  return risky;
}

// The twelve equations, and that the overlap is no sliver. `x_n`, `normal`: over all faces, in A's
// frame; `length`: of all edges; `radius`: √trace of the covariance; `wedge`: faces that are almost
// parallel meet.
template <class T>
BC_INLINE Mask<T> certificate(const Mat<T>& x_n, const Vec<T>& normal, const Vec<T>& area, T length,
                              T volume, T radius, Mask<T> wedge, T size, T depth) {
  T rounding = centroid_rounding * size / depth;
  T error = size * max(splat<T>(least_centroid_error), rounding);
  T covariance_error = max(splat<T>(least_covariance_error), rounding);
  T off_diagonal = off_diagonal_share * min(error, covariance_error * radius);
  T diagonal = diagonal_share * error;
  diagonal =
      select<T>(wedge, min(diagonal, wedge_diagonal_share * covariance_error * size), diagonal);
  Mask<T> holds = volume > 0.0;
  holds &= area_rounding * size * (length * length * length) <= sliver_limit * error * volume;
  for (int j = 0; j < 3; ++j) {
    int k = (j + 1) % 3, l = (j + 2) % 3;
    holds &= max(abs(x_n[k][j]), abs(x_n[l][j])) <= off_diagonal * area[j];
    holds &= abs(x_n[j][j] - volume) * size <= diagonal * volume;
    holds &= 0.5 * abs(normal[j]) * size <= closure_share * error * area[j];
  }
  return holds;
}

// Move a point of A's frame into both boxes, by the nearest points of each in turn. Returns where
// that succeeds.
template <class T>
inline Mask<T> move_inside(const Pair<T>& pair, Vec<T>& point) {
  Vec<T> outside;
  for (int round = 0; round < 3; ++round) {
    point = clamp(point, pair.half_a);
    Vec<T> in_b = transposed_times(pair.rotation, point) - pair.offset_b;
    Vec<T> back = clamp(in_b, pair.half_b) - in_b;
    point = point + pair.rotation * back;
    outside = abs(point) - pair.half_a;
  }
  return largest(outside) <= outside_by_rounding * pair.size;
}

}  // namespace face_sums

// Find the overlap of a pair that has been pressed in to `depth` [m]; the pair is changed. Found:
// Moments<T>, or PointAndVolume<T>, without second moments and with the equations that the centroid
// needs alone. Returns where the certificate holds.
template <class Found, class T>
BC_INLINE Mask<T> overlap_by_face_sums(Pair<T>& pair, T depth, Found& found) {
  using namespace face_sums;
  constexpr bool all_moments = std::is_same_v<Found, Moments<T>>;
  using Squares = std::conditional_t<all_moments, Sym<T>, NoSquares>;
  Vec<T> given_half_b = pair.half_b, given_offset_b = pair.offset_b;
  Mask<T> risky = unflush(pair, depth);
  const Mat<T>& r = pair.rotation;
  Mat<T> inverse = reciprocals(r);
  EdgePieces<T> edges_a = cut_edges(transpose(r), transpose(inverse), -pair.offset_b, pair.half_a,
                                    pair.half_b, weights_a);
  EdgePieces<T> edges_b = cut_edges(r, inverse, pair.offset_a, pair.half_b, pair.half_a, weights_b);
  // The origin is a point inside the overlap: a weighted mean of its edges.
  T scale = 1.0 / (edges_a.length + edges_b.length);
  Vec<T> origin_a = scale * (edges_a.mean + (r * edges_b.mean + edges_b.length * pair.offset_a));
  Vec<T> origin_b = transposed_times(r, origin_a) - pair.offset_b;
  FaceSums<T, Side::sigma> faces_a;
  FaceSums<T, Side::tau> faces_b;
  Squares squares_a{}, squares_b{};
  add_edges(edges_a, pair.half_a, origin_a, faces_a, squares_a);
  add_edges(edges_b, pair.half_b, origin_b, faces_b, squares_b);
  T least_sine2_here = add_lines(pair, inverse, origin_a, origin_b, faces_a, faces_b, squares_a);
  auto of_a = integrate(faces_a, squares_a, pair.half_a, origin_a);
  auto of_b = integrate(faces_b, squares_b, pair.half_b, origin_b);

  Columns<T> axes_b = columns(r), rows_b = columns(transpose(of_b.x_n));
  Mat<T> x_n;
  for (int i = 0; i < 3; ++i) {
    Triple<T> from_b = axes_b * (rows_b * triple(row(r, i)));
    for (int j = 0; j < 3; ++j) x_n[i][j] = of_a.x_n[i][j] + from_b[j];
  }
  Mask<T> certain;
  T volume = (x_n[0][0] + x_n[1][1] + x_n[2][2]) * (1.0 / 3.0);
  T by_volume = 1.0 / volume;
  Vec<T> from_origin = (0.25 * by_volume) * (of_a.first + r * of_b.first);
  Vec<T> centroid = origin_a + from_origin;
  Vec<T> area, normal = of_a.normal + r * of_b.normal;
  for (int i = 0; i < 3; ++i) area[i] = of_a.area[i] + dot(abs(row(r, i)), of_b.area);
  T length = edges_a.length + edges_b.length;
  if constexpr (all_moments) {
    // Little cancels: the origin is a point of the overlap.
    Sym<T> covariance =
        (0.05 * by_volume) * (of_a.second + rotated(r, of_b.second)) - squared(from_origin);
    T radius = sqrt(max(trace(covariance), T{}));
    Mask<T> wedge = least_sine2_here < far_sine2;
    certain = certificate(x_n, normal, area, length, volume, radius, wedge, pair.size, depth);
    if (any(wedge)) {
      T farthest2 = farthest_piece2(pair, inverse, origin_a, origin_b);
      T reach = farthest_reach * radius + sqrt(dot(from_origin, from_origin));
      certain &= (farthest2 <= reach * reach) | (wedge == 0);
    }
    found.covariance = rotated(pair.axes_a, covariance);
  } else {
    T any_radius = splat<T>(infinity);
    certain = certificate(x_n, normal, area, length, volume, any_radius, depth != depth, pair.size,
                          depth);
  }
  certain &= risky == 0;
  Mask<T> shallow = depth < safely_inside * pair.size;
  if (any(shallow)) {
    Vec<T> moved = centroid;
    pair.half_b = given_half_b;
    pair.offset_b = given_offset_b;
    Mask<T> inside = move_inside(pair, moved);
    centroid = select(shallow, moved, centroid);
    certain &= inside | (shallow == 0);
  }
  found.volume = volume;
  found.centroid = centroid;
  return certain;
}

}  // namespace box_contact::BOX_CONTACT_SET
