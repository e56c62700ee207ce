// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What the lines of planes add up to: sums over the planes, and over the overlap K that they bound.
//
// With o any point near K, f and g the distances of the planes from o along the axes n_f, n_g,
// c = n_f · n_g, D = n_f × n_g, m the middle of a piece of their line f × g and `span` its length in
// units of D, each piece adds to both its planes (Stokes; Lasserre 1998)
//
//   twice the area:               span · (g − c f),  span · (f − c g)
//   three times its first moment: the same · m
//
// with the signs of both planes, and to the sums over K
//
//   w = f · (its part of the area of f) + g · (its part of the area of g),  six times the volume
//   w m,  w (m mᵀ + span² / 12 · D Dᵀ).
//
// Planes add what belongs to them once.
#pragma once

#include "moments.hpp"
#include "planes.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace planes {

// What pieces of lines add to the planes of a box. N: one plane, or one across each axis.
template <class N>
struct Faces {
  N area{};           // twice the area, with the side's sign [m²]
  N next{}, after{};  // three times its first moments along the two axes that follow, likewise
};

// And to the sums over the overlap, for the planes across an axis of P and its lines with Q's.
template <class N, bool squares>
struct Weighted {
  N w{}, y{}, z{};  // Σ w, and w times the middles' coordinates along the two axes that follow
  N yy{}, zz{}, yz{};
};

// Symmetric tensors: xx yy zz, and yz xz xy off the diagonal.
template <class T>
struct Squares {
  Triple<T> diagonal{}, beside{};

  BC_INLINE Sym<T> sym() const {
    return {{diagonal[0], diagonal[1], diagonal[2], beside[0], beside[1], beside[2]}};
  }
};

// A tensor of the frame with these axes.
template <class T>
BC_INLINE Squares<T> turned(const Columns<T>& axes, const Squares<T>& s) {
  Columns<T> c = from_diagonals<T>({{s.diagonal, rotated_back(s.beside), rotated(s.beside)}});
  Columns<T> half_way{{axes * c[0], axes * c[1], axes * c[2]}}, rows = transpose(axes);
  Columns<T> found = diagonals<T>({{half_way * rows[0], half_way * rows[1], half_way * rows[2]}});
  return {found[0], rotated(found[1])};
}

// Sums over one box: its planes, and the pieces of its edges.
template <class T>
struct Sums {
  Faces<Triple<T>> faces[2];
  Triple<T> first{};  // Σ w · middle
  Squares<T> squares;
};

// What the planes of a box add up to, in its frame, about the origin.
template <class T>
struct Surface {
  Triple<T> normal{}, size{};  // twice ∫ n dA and ∫ |n| dA, by axis
  Columns<T> x_n;              // ∫ x nᵀ dA by its columns
  Triple<T> first{};           // twelve times ∫ x dV
  Squares<T> second;           // twenty times ∫ x xᵀ dV
  T volume{}, gross{};         // six times ∫ dV; Σ |distance| · twice the area
};

template <bool squares, bool two_sided, class T>
BC_INLINE Surface<T> surface(const Box<T>& box, const Sums<T>& sums) {
  Surface<T> s;
  s.first = sums.first;
  s.second = sums.squares;
  Triple<T> own{}, next{}, after{}, gross{};
#pragma GCC unroll 2
  for (int n = 0; n < (two_sided ? 2 : 1); ++n) {
    const Faces<Triple<T>>& faces = sums.faces[n];
    Triple<T> f = box.planes[n].distance, by_f = f * faces.area, by_f2 = f * by_f;
    s.normal += faces.area;
    s.size += abs(faces.area);
    own += by_f;
    next += faces.next;
    after += faces.after;
    gross += abs(by_f);
    s.first += 0.5 * by_f2;
    if constexpr (squares) {
      Triple<T> third = (1.0 / 3.0) * (f * f);
      s.second.diagonal += f * by_f2;
      s.second.beside =
          s.second.beside + (rotated(third * faces.next) + rotated_back(third * faces.after));
    }
  }
  // Column k has its own component from the distances of the planes, and two from the moments.
  s.volume = sum(own);
  s.gross = sum(gross);
  s.x_n = from_diagonals<T>({{0.5 * own, (1.0 / 3.0) * next, (1.0 / 3.0) * after}});
  return s;
}

}  // namespace planes

}  // namespace box_contact::BOX_CONTACT_SET
