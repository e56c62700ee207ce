// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The lines in which two planes meet, and what is left of them within both boxes.
//
// A line is clipped by the slabs of both boxes (Kay and Kajiya 1986). The sides of the slabs that do
// not meet the overlap are moved away, so that a line may lie in such a side. The edges of one box are
// the case c = 0 (sums.hpp).
#pragma once

#include "sums.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace planes {

// The sums of each triple's numbers, side by side.
template <class T>
BC_INLINE Triple<T> totals(const Triple<T>& a, const Triple<T>& b, const Triple<T>& c) {
  Columns<T> by_number = transpose(Columns<T>{{a, b, c}});
  return (by_number[0] + by_number[1]) + by_number[2];
}

// Clip a line from −back to `to` by a slab: it is `at` from the slab's middle there, and its
// direction's component is 1 / inverse.
template <class N, class Slab>
BC_INLINE void clip(const N& at, const Slab& slab, const N& inverse, N& back, N& to) {
  N by = at * inverse, width = slab * abs(inverse);
  back = min(back, width + by);
  to = min(to, width - by);
}

// The numbers of Q's axes for one line or for three.
template <class T>
BC_INLINE auto& of_axis(Triple<T>& x, int j) {
  if constexpr (packed<T>) {
    return x;
  } else {
    return x[j];
  }
}
template <class T>
BC_INLINE const auto& of_axis(const Triple<T>& x, int j) {
  if constexpr (packed<T>) {
    return x;
  } else {
    return x[j];
  }
}

// For W pairs, one line of a plane of P with one of Q. For a single pair, three: with the planes
// across all of Q's axes.
template <class T>
using Line = std::conditional_t<packed<T>, Triple<T>, T>;

// What is left of the line of two planes within the slabs.
template <class N>
struct Piece {
  N span, middle;            // its length in units of D, and the place of its middle
  N u, v;                    // g − c f, and f − c g [m]
  N at_y, at_z, at_k, at_l;  // the line's nearest point to the origin, in P and in Q [m]
};

// The line of P's plane s across axis i with Q's plane t across axis j, clipped.
template <class T>
BC_INLINE Piece<Line<T>> clipped_line(const PairOfBoxes<T>& boxes, int i, int s, int j, int t,
                                      Line<T>& largest_lever2) {
  using N = Line<T>;
  const Box<T>&p = boxes.p, &q = boxes.q;
  const Planes<T>&of_p = p.planes[s], &of_q = q.planes[t];
  int y = following[i], z = following[y];
  const Triple<T>&row_i = boxes.rows[i], &by_i = boxes.by_rows[i];
  auto on = [&](const Triple<T>& x) { return of_axis<T>(x, j); };
  // Components: of n_g along y and z; of n_f along the axes k and l of Q that follow j.
  N c = on(row_i), qy = on(boxes.rows[y]), qz = on(boxes.rows[z]);
  N pk = on(rotated(row_i)), pl = on(rotated_back(row_i));
  N by_y = on(boxes.by_rows[y]), by_z = on(boxes.by_rows[z]);
  N by_k = on(rotated(by_i)), by_l = on(rotated_back(by_i));

  N f = spread(of_p.place, i), g = on(of_q.place), scale = on(boxes.scales[i]);
  Piece<N> piece;
  piece.u = g - c * f;
  piece.v = f - c * g;
  N by_q = piece.u * scale, by_p = piece.v * scale;
  piece.at_y = by_q * qy, piece.at_z = by_q * qz;
  piece.at_k = by_p * pk, piece.at_l = by_p * pl;
  N start = min(spread(of_p.start, i), on(of_q.start));
  // The line's direction: −qz and qy in P, pl and −pk in Q.
  N back = select<N>(scale < 1.0 / least_sine2, start, splat<N>(nowhere)), to = back;
  clip(spread(p.from, y) + piece.at_y, spread(p.slab, y), by_z, to, back);
  clip(spread(p.from, z) + piece.at_z, spread(p.slab, z), by_y, back, to);
  clip(on(rotated(q.from)) + piece.at_k, on(rotated(q.slab)), by_l, back, to);
  clip(on(rotated_back(q.from)) + piece.at_l, on(rotated_back(q.slab)), by_k, to, back);
  piece.span = max(to + back, N{});
  piece.middle = 0.5 * (to - back);
  N lever2 = (f * f) * (piece.u * by_q) + (g * g) * (piece.v * by_p);
  largest_lever2 = max(largest_lever2, select<N>(piece.span > 0.0, lever2, N{}));
  return piece;
}

// What this piece adds.
template <bool squares, class T>
BC_INLINE void add_piece(const PairOfBoxes<T>& boxes, int i, int s, int j, int t,
                         const Piece<Line<T>>& piece, Faces<Line<T>>& face_p,
                         Weighted<Line<T>, squares>& sums, Faces<Triple<T>>& faces_q) {
  using N = Line<T>;
  const Planes<T>&of_p = boxes.p.planes[s], &of_q = boxes.q.planes[t];
  int y = following[i], z = following[y];
  const Triple<T>& row_i = boxes.rows[i];
  auto on = [&](const Triple<T>& x) { return of_axis<T>(x, j); };
  N qy = on(boxes.rows[y]), qz = on(boxes.rows[z]);
  N pk = on(rotated(row_i)), pl = on(rotated_back(row_i));
  N f = spread(of_p.place, i), g = on(of_q.place), span = piece.span, middle = piece.middle;
  N side = span * (spread(of_p.sign, i) * on(of_q.sign));
  N area_p = side * piece.u, area_q = side * piece.v;
  N my = piece.at_y - middle * qz, mz = piece.at_z + middle * qy;
  N w = f * area_p + g * area_q;
  face_p.area += area_p;
  face_p.next += area_p * my;
  face_p.after += area_p * mz;
  of_axis<T>(faces_q.area, j) += area_q;
  of_axis<T>(faces_q.next, j) += area_q * (piece.at_k + middle * pl);
  of_axis<T>(faces_q.after, j) += area_q * (piece.at_l - middle * pk);
  N wy = w * my, wz = w * mz;
  sums.w += w;
  sums.y += wy;
  sums.z += wz;
  if constexpr (squares) {
    N along = (1.0 / 12.0) * (w * (span * span)), along_y = along * qy;
    sums.yy += wy * my + along * (qz * qz);
    sums.zz += wz * mz + along_y * qy;
    sums.yz += wy * mz - along_y * qz;
  }
}

// Put numbers of the lines of P's axis i where they belong, or add them up over Q's axes.
template <class T>
struct Gathered {
  Triple<T> by_axis[3];  // of a single pair: three lines of each axis of P
  Triple<T> total;       // of W pairs

  BC_INLINE void put(int i, int j, const Line<T>& x) {
    if constexpr (packed<T>) {
      by_axis[i] = x;
    } else {
      total[i] = j == 0 ? x : total[i] + x;
    }
  }
  BC_INLINE Triple<T> sum() const {
    if constexpr (packed<T>) {
      return totals<T>(by_axis[0], by_axis[1], by_axis[2]);
    } else {
      return total;
    }
  }
};

// What the lines of P's planes on one side add up to, by P's axes.
template <bool squares, class T>
struct SideSums {
  Gathered<T> area, next, after, w, y, z, yy, zz, yz;

  BC_INLINE void put(int i, int j, const Faces<Line<T>>& face,
                     const Weighted<Line<T>, squares>& sums) {
    area.put(i, j, face.area);
    next.put(i, j, face.next);
    after.put(i, j, face.after);
    w.put(i, j, sums.w);
    y.put(i, j, sums.y);
    z.put(i, j, sums.z);
    if constexpr (squares) {
      yy.put(i, j, sums.yy);
      zz.put(i, j, sums.zz);
      yz.put(i, j, sums.yz);
    }
  }
};

// The lines of P's planes s across `count` axes with Q's planes. All that belong to one side of Q are
// clipped before any is added up: few steps then wait for the one before.
template <int count, bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, int first, int s,
                         SideSums<squares, T>& of_side, Sums<T>& of_q, Line<T>& largest_lever2) {
  constexpr int lines = packed<T> ? 1 : 3;  // of an axis of P
  auto each_line = [](auto work) __attribute__((always_inline)) {
#pragma GCC unroll 3
    for (int k = 0; k < count; ++k)
#pragma GCC unroll 3
      for (int j = 0; j < lines; ++j) work(k, j);
  };
  Faces<Line<T>> face[count][lines];
  Weighted<Line<T>, squares> sums[count][lines];
  unsigned axes_p = boxes.p.planes[s].axes;
  for (int t = 0; t < (two_sided && boxes.q.planes[1].axes ? 2 : 1); ++t) {
    unsigned axes_q = packed<T> || !two_sided ? 7 : boxes.q.planes[t].axes;
    auto is_there = [&](int k, int j) { return axes_p >> (first + k) & axes_q >> j & 1; };
    Piece<Line<T>> pieces[count][lines];
    each_line([&](int k, int j) __attribute__((always_inline)) {
      pieces[k][j] = is_there(k, j) ? clipped_line(boxes, first + k, s, j, t, largest_lever2)
                                    : Piece<Line<T>>{};
    });
    each_line([&](int k, int j) __attribute__((always_inline)) {
      if (is_there(k, j))
        add_piece<squares>(boxes, first + k, s, j, t, pieces[k][j], face[k][j], sums[k][j],
                           of_q.faces[t]);
    });
  }
  each_line([&](int k, int j) __attribute__((always_inline)) {
    of_side.put(first + k, j, face[k][j], sums[k][j]);
  });
}

// All lines of P's planes with Q's. Code that does not fit the first cache takes up to twice the time:
// no loop over two sides is unrolled, and of W pairs none over P's axes.
template <bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, Sums<T>& of_p, Sums<T>& of_q,
                         Line<T>& largest_lever2) {
  int sides_p = two_sided && boxes.p.planes[1].axes ? 2 : 1;
  for (int s = 0; s < sides_p; ++s) {
    SideSums<squares, T> side;
    if constexpr (packed<T>) {
      add_lines<3, squares, two_sided>(boxes, 0, s, side, of_q, largest_lever2);
    } else {
#pragma GCC unroll 1
      for (int i = 0; i < 3; ++i)
        add_lines<1, squares, two_sided>(boxes, i, s, side, of_q, largest_lever2);
    }
    const Triple<T>& f = boxes.p.planes[s].place;
    Faces<Triple<T>>& faces = of_p.faces[s];
    faces.area = side.area.sum();
    faces.next = side.next.sum();
    faces.after = side.after.sum();
    Triple<T> wx = f * side.w.sum(), wy = side.y.sum(), wz = side.z.sum();
    of_p.first += ((wx + rotated_back(wy)) + rotated(wz));
    if constexpr (squares) {
      of_p.squares.diagonal += ((f * wx + rotated_back(side.yy.sum())) + rotated(side.zz.sum()));
      of_p.squares.beside += ((side.yz.sum() + rotated(f * wy)) + rotated_back(f * wz));
    }
  }
}

// The edges of a box x along its axes k, in its planes s across the axis that follows k and t across
// the next. `axes`: y's axes in x's frame.
template <bool squares, class T>
BC_INLINE void add_edges(const Box<T>& x, int s, int t, const Box<T>& y, const Columns<T>& axes,
                         const Columns<T>& inverse, Sums<T>& sums, Triple<T>& length) {
  const Planes<T>&of_f = x.planes[s], &of_g = x.planes[t];
  Triple<T> f = rotated(of_f.place), g = rotated_back(of_g.place);
  Triple<T> start = min(rotated(of_f.start), rotated_back(of_g.start));
  Triple<T> back = min(start, x.slab + x.from), to = min(start, x.slab - x.from);
#pragma GCC unroll 3
  for (int m = 0; m < 3; ++m) {
    Triple<T> place = (f * rotated(axes[m]) + g * rotated_back(axes[m])) + spread(y.from, m);
    clip(place, spread(y.slab, m), inverse[m], back, to);
  }
  Triple<T> span = max(to + back, Triple<T>{}), middle = 0.5 * (to - back);
  length += span;
  Triple<T> side = span * (rotated(of_f.sign) * rotated_back(of_g.sign));
  Triple<T> area_f = side * g, area_g = side * f;
  Faces<Triple<T>>& faces_f = sums.faces[s];
  faces_f.area += rotated_back(area_f);
  faces_f.next += rotated_back(area_f * g);
  faces_f.after += rotated_back(area_f * middle);
  Faces<Triple<T>>& faces_g = sums.faces[t];
  faces_g.area += rotated(area_g);
  faces_g.next += rotated(area_g * middle);
  faces_g.after += rotated(area_g * f);
  Triple<T> w = 2.0 * (area_f * f), along = w * middle, at_f = w * f, at_g = w * g;
  sums.first += ((along + rotated_back(at_f)) + rotated(at_g));
  if constexpr (squares) {
    Triple<T> own = along * middle + (1.0 / 12.0) * (w * (span * span));
    sums.squares.diagonal += ((own + rotated_back(at_f * f)) + rotated(at_g * g));
    sums.squares.beside += ((at_f * g + rotated(at_f * middle)) + rotated_back(at_g * middle));
  }
}

template <bool squares, bool two_sided, class T>
BC_INLINE void add_edges(const Box<T>& x, const Box<T>& y, const Columns<T>& axes,
                         const Columns<T>& inverse, Sums<T>& sums, Triple<T>& length) {
  if constexpr (packed<T>) {
    // Without two planes there is no edge.
    unsigned there = x.planes[0].axes;
    if ((there & (there - 1)) == 0) return;
  }
  add_edges<squares>(x, 0, 0, y, axes, inverse, sums, length);
  int ways = two_sided && x.planes[1].axes ? 4 : 1;
  for (int c = 1; c < ways; ++c)
    if (any(any_of(min(rotated(x.planes[c & 1].start), rotated_back(x.planes[c >> 1].start)) >
                   Triple<T>{})))
      add_edges<squares>(x, c & 1, c >> 1, y, axes, inverse, sums, length);
}

// The same of W pairs: not inlined, because the code is long.
template <bool squares, bool two_sided, class T>
[[gnu::noinline]] void add_edges_apart(const Box<T>& x, const Box<T>& y, const Columns<T>& axes,
                                       const Columns<T>& inverse, Sums<T>& sums,
                                       Triple<T>& length) {
  add_edges<squares, two_sided>(x, y, axes, inverse, sums, length);
}

}  // namespace planes

}  // namespace box_contact::BOX_CONTACT_SET
