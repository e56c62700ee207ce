// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The lines in which two planes meet, and what is left of them within both boxes.
//
// A line is clipped by the slabs of both boxes (Kay and Kajiya 1986). The sides of the slabs that do
// not meet the overlap are moved to where it has ended, so that a line may lie in such a side. The edges
// of one box are the case c = 0 (sums.hpp).
#pragma once

#include "sums.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace planes {

// Clip a line from −back to `to` by a slab: it is `at` from the slab's middle there, and its
// direction's component is 1 / inverse.
template <class N>
BC_INLINE void clip(const N& at, const N& slab, const N& inverse, N& back, N& to) {
  N by = at * inverse, width = slab * abs(inverse);
  back = min(back, width + by);
  to = min(to, width - by);
}

// What is left within the slabs of the lines of a plane of P with the planes across Q's axes.
template <class T>
struct Pieces {
  Triple<T> span, middle;            // lengths in units of D, and the coordinates of the middles
  Triple<T> u, v;                    // g − c f, and f − c g [m]
  Triple<T> at_y, at_z, at_k, at_l;  // the lines' nearest points to the origin, in P and in Q [m]
};

// The lines of P's plane s across axis i with Q's planes t, clipped.
template <class T>
BC_INLINE Pieces<T> clipped_lines(const PairOfBoxes<T>& boxes, int i, int s, int t,
                                  Triple<T>& largest_lever2) {
  const Box<T>&p = boxes.p, &q = boxes.q;
  const Planes<T>&of_p = p.planes[s], &of_q = q.planes[t];
  int y = following[i], z = following[y];
  // Components: of n_g along y and z; of n_f along the axes k and l of Q that follow.
  const Triple<T>&c = boxes.rows[i], &qy = boxes.rows[y], &qz = boxes.rows[z];
  Triple<T> pk = rotated(c), pl = rotated_back(c);
  const Triple<T>&by_i = boxes.by_rows[i], &by_y = boxes.by_rows[y], &by_z = boxes.by_rows[z];
  Triple<T> f = repeated(of_p.distance, i);
  const Triple<T>&g = of_q.distance, &scale = boxes.scales[i];

  Pieces<T> pieces;
  pieces.u = g - c * f;
  pieces.v = f - c * g;
  Triple<T> by_q = pieces.u * scale, by_p = pieces.v * scale;
  pieces.at_y = by_q * qy, pieces.at_z = by_q * qz;
  pieces.at_k = by_p * pk, pieces.at_l = by_p * pl;
  // The lines' directions: −qz and qy in P, pl and −pk in Q.
  Triple<T> start = min(repeated(of_p.start, i), of_q.start);
  Triple<T> none = uniform(splat<T>(nowhere)), least = uniform(splat<T>(1.0 / least_sine2));
  Triple<T> back = choose(least > scale, start, none), to = back;
  clip(pieces.at_y - repeated(p.middle, y), repeated(p.slab, y), by_z, to, back);
  clip(pieces.at_z - repeated(p.middle, z), repeated(p.slab, z), by_y, back, to);
  clip(pieces.at_k - rotated(q.middle), rotated(q.slab), rotated_back(by_i), back, to);
  clip(pieces.at_l - rotated_back(q.middle), rotated_back(q.slab), rotated(by_i), to, back);
  pieces.span = max(to + back, Triple<T>{});
  pieces.middle = 0.5 * (to - back);
  Triple<T> lever2 = (f * f) * (pieces.u * by_q) + (g * g) * (pieces.v * by_p);
  largest_lever2 = choose(pieces.span > Triple<T>{}, max(largest_lever2, lever2), largest_lever2);
  return pieces;
}

// What these pieces add.
template <bool squares, class T>
BC_INLINE void add_pieces(const PairOfBoxes<T>& boxes, int i, int s, int t, const Pieces<T>& pieces,
                          Faces<Triple<T>>& face_p, Weighted<Triple<T>, squares>& sums,
                          Faces<Triple<T>>& faces_q) {
  const Planes<T>&of_p = boxes.p.planes[s], &of_q = boxes.q.planes[t];
  int y = following[i], z = following[y];
  const Triple<T>&qy = boxes.rows[y], &qz = boxes.rows[z];
  Triple<T> pk = rotated(boxes.rows[i]), pl = rotated_back(boxes.rows[i]);
  Triple<T> f = repeated(of_p.distance, i);
  const Triple<T>&g = of_q.distance, &span = pieces.span, &middle = pieces.middle;
  Triple<T> side = span * (repeated(of_p.sign, i) * of_q.sign);
  Triple<T> area_p = side * pieces.u, area_q = side * pieces.v;
  Triple<T> my = pieces.at_y - middle * qz, mz = pieces.at_z + middle * qy;
  Triple<T> w = f * area_p + g * area_q;
  face_p.area += area_p;
  face_p.next += area_p * my;
  face_p.after += area_p * mz;
  faces_q.area += area_q;
  faces_q.next += area_q * (pieces.at_k + middle * pl);
  faces_q.after += area_q * (pieces.at_l - middle * pk);
  Triple<T> wy = w * my, wz = w * mz;
  sums.w += w;
  sums.y += wy;
  sums.z += wz;
  if constexpr (squares) {
    Triple<T> along = (1.0 / 12.0) * (w * (span * span)), along_y = along * qy;
    sums.yy += wy * my + along * (qz * qz);
    sums.zz += wz * mz + along_y * qy;
    sums.yz += wy * mz - along_y * qz;
  }
}

// Numbers of the lines of each axis of P, added up over Q's axes. A pair alone adds its three axes up
// side by side, at the end.
template <class T>
struct ByAxis {
  Triple<T> lines[3];
  Triple<T> total;

  BC_INLINE void put(int i, const Triple<T>& x) {
    if constexpr (packed<T>) {
      lines[i] = x;
    } else {
      total[i] = sum(x);
    }
  }
  BC_INLINE Triple<T> sums() const {
    if constexpr (packed<T>) {
      Columns<T> by_number = transpose(Columns<T>{{lines[0], lines[1], lines[2]}});
      return (by_number[0] + by_number[1]) + by_number[2];
    } else {
      return total;
    }
  }
};

// What the lines of P's planes on one side add up to.
template <bool squares, class T>
struct SideSums {
  ByAxis<T> area, next, after, w, y, z, yy, zz, yz;

  BC_INLINE void put(int i, const Faces<Triple<T>>& face,
                     const Weighted<Triple<T>, squares>& sums) {
    area.put(i, face.area);
    next.put(i, face.next);
    after.put(i, face.after);
    w.put(i, sums.w);
    y.put(i, sums.y);
    z.put(i, sums.z);
    if constexpr (squares) {
      yy.put(i, sums.yy);
      zz.put(i, sums.zz);
      yz.put(i, sums.yz);
    }
  }
};

// The lines of P's planes s across the axes from `first` on with Q's planes. All that belong to one side
// of Q are clipped before any is added up: few steps then wait for the one before.
template <int count, bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, int first, int s,
                         SideSums<squares, T>& of_side, Sums<T>& of_q, Triple<T>& largest_lever2) {
  Faces<Triple<T>> faces[count];
  Weighted<Triple<T>, squares> sums[count];
  auto is_there = [&](int k) { return boxes.p.planes[s].axes >> (first + k) & 1; };
  for (int t = 0; t < (two_sided && boxes.q.planes[1].axes ? 2 : 1); ++t) {
    Pieces<T> pieces[count];
#pragma GCC unroll 3
    for (int k = 0; k < count; ++k)
      pieces[k] = is_there(k) ? clipped_lines(boxes, first + k, s, t, largest_lever2) : Pieces<T>{};
#pragma GCC unroll 3
    for (int k = 0; k < count; ++k)
      if (is_there(k))
        add_pieces<squares>(boxes, first + k, s, t, pieces[k], faces[k], sums[k], of_q.faces[t]);
  }
#pragma GCC unroll 3
  for (int k = 0; k < count; ++k) of_side.put(first + k, faces[k], sums[k]);
}

// All lines of P's planes with Q's. Code that does not fit the first cache takes up to twice the time:
// no loop over two sides is unrolled, and of W pairs none over P's axes.
template <bool squares, bool two_sided, class T>
BC_INLINE void add_lines(const PairOfBoxes<T>& boxes, Sums<T>& of_p, Sums<T>& of_q,
                         Triple<T>& largest_lever2) {
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
    const Triple<T>& f = boxes.p.planes[s].distance;
    Faces<Triple<T>>& faces = of_p.faces[s];
    faces.area = side.area.sums();
    faces.next = side.next.sums();
    faces.after = side.after.sums();
    Triple<T> wx = f * side.w.sums(), wy = side.y.sums(), wz = side.z.sums();
    of_p.first += ((wx + rotated_back(wy)) + rotated(wz));
    if constexpr (squares) {
      of_p.squares.diagonal += ((f * wx + rotated_back(side.yy.sums())) + rotated(side.zz.sums()));
      of_p.squares.beside += ((side.yz.sums() + rotated(f * wy)) + rotated_back(f * wz));
    }
  }
}

// The edges of a box x along its axes k, in its planes s across the axis that follows k and t across
// the next. `axes`: y's axes in x's frame.
template <bool squares, class T>
BC_INLINE void add_edges(const Box<T>& x, int s, int t, const Box<T>& y, const Columns<T>& axes,
                         const Columns<T>& inverse, Sums<T>& sums, Triple<T>& length) {
  const Planes<T>&of_f = x.planes[s], &of_g = x.planes[t];
  Triple<T> f = rotated(of_f.distance), g = rotated_back(of_g.distance);
  Triple<T> start = min(rotated(of_f.start), rotated_back(of_g.start));
  Triple<T> back = min(start, x.slab - x.middle), to = min(start, x.slab + x.middle);
#pragma GCC unroll 3
  for (int m = 0; m < 3; ++m) {
    Triple<T> point = f * rotated(axes[m]) + g * rotated_back(axes[m]);
    clip(point - repeated(y.middle, m), repeated(y.slab, m), inverse[m], back, to);
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
