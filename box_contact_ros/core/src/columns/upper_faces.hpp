// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What Q's upper faces cut off the columns: U_k lies above the upper face t_k = length_k.
//
// Below the water that face is a polygon: a triangle at its lowest corner, which the face's own edges
// may truncate. The columns above the polygon are a convex body, whose volume has a closed form. P's
// side faces may cut the body. Where they miss it, its volume is known exactly. Where they do not, it
// is bounded. A plane that cuts the share ρ off the extent of a convex body cuts a share between ρ³
// and 1 − (1 − ρ)³ off its volume (Brunn and Minkowski: the root of the section's area is concave).
// A network decides between these brackets.
#pragma once

#include "column_moments.hpp"

namespace box_contact::BOX_CONTACT_SET {

// One upper face, in the units of `ColumnMoments`. All zero where it is above the water.
template <class F>
struct UpperFace {
  F volume;       // of the body above it, as if P's side faces missed it
  F least, most;  // shares of it that may be within them
  F features[6];
  Triple<F> at[2];  // t_k of two points that carry the volume, about o
  F carries[2];     // their shares of it
};

namespace upper_faces {

// The share of a body's extent beyond a plane, and where the deepest corner and the middle are in
// this extent.
template <class F>
struct Beyond {
  F most, sum, corner, middle;

  BC_INLINE void add(F share, F of_corner, F of_middle) {
    most = max(most, share);
    sum += share;
    corner += share * of_corner;
    middle += share * of_middle;
  }
};

constexpr float least_extent = 1e-12F;

template <class F>
BC_INLINE F within(F x, F low, F high) {
  return min(high, max(low, x));
}

}  // namespace upper_faces

template <class F>
BC_INLINE UpperFace<F> upper_face(const ColumnFrame<F>& frame, const Triple<F>& by_z, int k) {
  using namespace upper_faces;
  int j = (k + 1) % 3, l = (k + 2) % 3;
  F zero{}, one = splat<F>(1.0F);
  F depth = max(one - frame.length[k] * frame.qz[k], zero);  // of its lowest corner
  // s runs along the edge that is truncated more, u along the other.
  F leg_j = min<F>(frame.length[j], depth * by_z[j]),
    leg_l = min<F>(frame.length[l], depth * by_z[l]);
  Mask<F> along_j = leg_j * frame.qz[j] <= leg_l * frame.qz[l];
  auto of_s = [&](const Triple<F>& v) { return select<F>(along_j, v[j], v[l]); };
  auto of_u = [&](const Triple<F>& v) { return select<F>(along_j, v[l], v[j]); };
  F leg_s = select<F>(along_j, leg_j, leg_l), leg_u = select<F>(along_j, leg_l, leg_j);
  F sz = of_s(frame.qz), uz = of_u(frame.qz), by_sz = of_s(by_z), by_uz = of_u(by_z);
  F by_depth = one / max(depth, splat<F>(least_extent));
  F cut_s = min(leg_s * sz * by_depth, one), cut_u = min(leg_u * uz * by_depth, one);
  // Volume: depth · legs · the mean height by the depth.
  F left_u = one - cut_u;
  F both = cut_s * ((3.0F - 3.0F * cut_s) + cut_s * cut_s) - left_u * (left_u * left_u);
  F truncated = both / max((6.0F * cut_s) * cut_u, splat<F>(least_extent));
  F mean = select<F>(cut_s + cut_u <= one, one - 0.5F * (cut_s + cut_u), truncated);
  UpperFace<F> face;
  face.volume = (frame.lift[k] * frame.rise) * ((depth * leg_s) * (leg_u * mean));

  // Two points of it: the middles of two sections.
  F sx = of_s(frame.qx), sy = of_s(frame.qy), ux = of_u(frame.qx), uy = of_u(frame.qy);
  F corner_x = frame.length[k] * frame.qx[k], corner_y = frame.length[k] * frame.qy[k];
  F weights{}, x_middle{}, y_middle{}, s_at[2], u_at[2], h_at[2];
  for (int n = 0; n < 2; ++n) {
    F s = leg_s * (n ? 0.7886751346F : 0.2113248654F), d = max(depth - sz * s, zero);
    F m = min(min(leg_u, d * by_uz), leg_u), fall = uz * m;
    F area = m * (d - 0.5F * fall);
    F by_area = one / max(area, splat<F>(1e-30F));
    s_at[n] = s;
    u_at[n] = by_area * ((m * m) * (0.5F * d - (1.0F / 3) * fall));
    h_at[n] = by_area * (m * ((0.5F * d) * (d - fall) + (1.0F / 6) * (fall * fall)));
    face.carries[n] = area;
    weights += area;
    x_middle += area * (s * sx + u_at[n] * ux);
    y_middle += area * (s * sy + u_at[n] * uy);
  }
  F by_weights = one / max(weights, splat<F>(1e-30F));
  for (F& share : face.carries) share = share * by_weights;
  x_middle = x_middle * by_weights;
  y_middle = y_middle * by_weights;

  // Its extents along x and y, seen from the corner.
  F u_end = min(leg_u, max(depth - sz * leg_s, zero) * by_uz);
  F s_end = min(leg_s, max(depth - uz * leg_u, zero) * by_sz);
  Beyond<F> beyond{};
  F least_in = one, most_in = one;
  auto across = [&](F s_step, F u_step, F corner, F middle, F low, F high) {
    F a = leg_s * s_step, b = leg_u * u_step, c = a + u_end * u_step, d = b + s_end * s_step;
    F least = min(min(min(a, b), min(c, d)), zero), most = max(max(max(a, b), max(c, d)), zero);
    F by_extent = one / max(most - least, splat<F>(least_extent));
    F at_corner = -least * by_extent, at_middle = (middle - least) * by_extent;
    F above = within((corner + most - high) * by_extent, zero, one);
    F below = within((low - (corner + least)) * by_extent, zero, one);
    beyond.add(above, at_corner, at_middle);
    beyond.add(below, one - at_corner, one - at_middle);
    for (int n = 0; n < 2; ++n) {
      F share = n ? below : above, inside = one - share;
      least_in = least_in - (one - inside * (inside * inside));
      most_in = min(most_in, one - share * (share * share));
    }
  };
  across(sx, ux, corner_x, x_middle, frame.low_x, frame.high_x);
  across(sy, uy, corner_y, y_middle, frame.low_y, frame.high_y);
  face.least = max(least_in, zero);
  face.most = max(most_in, face.least);
  F by_sum = one / max(beyond.sum, splat<F>(least_extent));
  F features[6] = {beyond.most,
                   min(beyond.sum, 2.0F * one),
                   beyond.corner * by_sum,
                   beyond.middle * by_sum,
                   cut_s + cut_u,
                   cut_s * cut_u};
  for (int n = 0; n < 6; ++n) face.features[n] = features[n];

  for (int n = 0; n < 2; ++n) {
    // The point, moved back between P's side faces.
    F x = (corner_x + s_at[n] * sx) + u_at[n] * ux, y = (corner_y + s_at[n] * sy) + u_at[n] * uy;
    F back_x = within(x, frame.low_x, frame.high_x) - x;
    F back_y = within(y, frame.low_y, frame.high_y) - y;
    face.at[n] = frame.length;  // of t_k; the others follow
    face.at[n][j] = select<F>(along_j, s_at[n], u_at[n]);
    face.at[n][l] = select<F>(along_j, u_at[n], s_at[n]);
    face.at[n] = face.at[n] + h_at[n] * frame.lift + back_x * frame.qx + back_y * frame.qy;
  }
  return face;
}

}  // namespace box_contact::BOX_CONTACT_SET
