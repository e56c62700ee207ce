// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The contact frame: the reference box's best face is z = 0, and the incident box comes from above.
//
// The reference box P owns the face axis of the largest gap. Q is the other, incident box. In this
// frame Q stands on its lowest vertex v, at the depth D below the reference face. Three edges
// q_0, q_1, q_2 of Q rise from v, q_kz ≥ 0. A point of Q is v + Σ t_k q_k, 0 ≤ t_k ≤ length_k.
//
// Where v is beside the face, the overlap is far from v. `move_origin` replaces v by the origin
// o = v + Σ start_k q_k. No point of A∩B has t_k < start_k, so a lower face {t_k = 0} with
// start_k > 0 takes no part, and o lies on each of the others. All this is float64. What is left,
// relative to o, is of the overlap's own magnitude and fits float32.
//
// Of equal faces that of A counts, the first box in the order of the data.
#pragma once

#include "../lanes/float_lanes.hpp"
#include "../minimum_depth.hpp"

namespace box_contact::BOX_CONTACT_SET {

template <class T>
struct ContactFrame {
  Mask<T> b_is_incident;    // Q is box B
  Triple<T> sign;           // by k: −1 where q_k points against Q's axis k
  Triple<T> qx, qy, qz;     // components of q_k, by k; qz ≥ 0; right-handed
  Triple<T> start, length;  // by k: t_k of the origin, and what Q has beyond it [m]
  Triple<T> half;           // of Q [m]
  T x, y;                   // of the origin, from the middle of the reference face [m]
  T half_x, half_y;         // of the reference face [m]
  T depth;                  // of the origin below the reference face [m]; 0: the frame does not fit
  T thickness;              // of P [m]
};

namespace contact_frame {

// Rounding of a position [of the size] that `move_origin` leaves room for.
constexpr double origin_slack = 0x1p-44;
// Least cosine between the normals of two faces that are pressed alike.
constexpr double least_upright = 1.0 - 1e-9;
// Least slope: so that one can divide by it.
constexpr double least_slope = 1e-30;

// The first face of a box with the largest gap, up to the tolerance.
template <class T>
struct BestFace {
  T gap, place;

  BC_INLINE BestFace(const Triple<T>& gaps, T tolerance) : gap(gaps[0]), place(T{}) {
    for (int k = 1; k < 3; ++k) {
      Mask<T> wins = gaps[k] > gap + tolerance;
      gap = select<T>(wins, gaps[k], gap);
      place = select<T>(wins, splat<T>(k), place);
    }
  }
};

// Move Q against the normal of a pair of edges, by `distance` [m]: (x, y, z) are the sides of the
// axis P_i × q_m in the contact frame.
template <class T>
BC_INLINE void press_along_edges(ContactFrame<T>& frame, T axis, T reference_face, T distance) {
  // Numbers of the edges of P and Q.
  T of_a = select<T>(axis < 9.0, T{}, select<T>(axis < 12.0, splat<T>(1.0), splat<T>(2.0)));
  T of_b = (axis - 6.0) - 3.0 * of_a;
  T of_p = select<T>(frame.b_is_incident, of_a, of_b),
    of_q = select<T>(frame.b_is_incident, of_b, of_a);
  T place = of_p - reference_face;  // 0: along z; 1 or −2: along x; 2 or −1: along y
  Mask<T> along_z = place == 0.0, along_x = (place == 1.0) | (place == -2.0);
  auto of = [&](const Triple<T>& row) {
    return select<T>(of_q == 0.0, row[0], select<T>(of_q == 1.0, row[1], row[2]));
  };
  T qx = of(frame.qx), qy = of(frame.qy), qz = of(frame.qz);
  T nx = select<T>(along_z, -qy, select<T>(along_x, T{}, qz));
  T ny = select<T>(along_z, qx, select<T>(along_x, -qz, T{}));
  T nz = select<T>(along_z, T{}, select<T>(along_x, qy, -qx));
  T length2 = (nx * nx + ny * ny) + nz * nz;
  // From P to Q: the side on which Q's centre is.
  T cx = frame.x + dot(frame.qx, frame.half), cy = frame.y + dot(frame.qy, frame.half);
  T cz = (0.5 * frame.thickness - frame.depth) + dot(frame.qz, frame.half);
  T along = (nx * cx + ny * cy) + nz * cz;
  T step = distance / sqrt(max(length2, splat<T>(least_slope)));
  step = select<T>(along >= 0.0, step, -step);
  frame.x = frame.x - step * nx;
  frame.y = frame.y - step * ny;
  frame.depth = frame.depth + step * nz;
}

// Move the origin along the edge that leads fastest back over the face, as far as no point of the
// overlap is passed: `position` is its x or y, `row` the edges' components there. Of a_k ≥ 0 with
// Σ a_k gain_k ≥ beyond and Σ a_k q_kz ≤ depth, the least a_k is known by duality if one edge alone
// has the steepest gain.
template <class T>
BC_INLINE void move_origin_along(ContactFrame<T>& frame, const Triple<T>& by_slope,
                                 const Triple<T>& row, T position, T half, T size) {
  T beyond = (abs(position) - half) - origin_slack * size;
  Mask<T> outside = beyond > 0.0;
  if (!any(outside)) return;
  Triple<T> gain = select(position > 0.0, -row, row), rate = gain * by_slope;
  T most = largest(rate), least_of_two = min<T>(rate[0], rate[1]);
  T second = max(max(least_of_two, min(max<T>(rate[0], rate[1]), T(rate[2]))), T{});
  T enough = max(select<T>(outside, beyond - second * frame.depth, T{}), T{});
  auto if_steepest = [](auto rate, auto most, auto x) {
    return select<decltype(x)>(rate == most, x, decltype(x){});
  };
  Triple<T> net = each(if_steepest, rate, uniform(most), gain - second * frame.qz);
  T largest_net = largest(net);
  Triple<T> least = uniform(enough / select<T>(largest_net > 0.0, largest_net, splat<T>(1.0)));
  auto if_moved = [](auto net, auto step) {
    return select<decltype(step)>(net > 0.0, step, decltype(step){});
  };
  Triple<T> step = each(if_moved, net, min(least, frame.length));
  frame.start = frame.start + step;
  frame.length = frame.length - step;
  frame.x = frame.x + dot(frame.qx, step);
  frame.y = frame.y + dot(frame.qy, step);
  frame.depth = frame.depth - dot(frame.qz, step);
}

}  // namespace contact_frame

// The contact frame of a pair that touches; a pair with less than the minimum depth is pressed.
template <class T>
BC_INLINE ContactFrame<T> contact_frame_of(const Pair<T>& pair, const SeparatingAxis<T>& axis) {
  using namespace contact_frame;
  ContactFrame<T> frame;
  T tolerance = tie * pair.size;
  const Columns<T>&axes_b = pair.b_in_a, &axes_a = pair.a_in_b;
  BestFace<T> of_a(face_gaps<T>(pair.offset_a, pair.half_a, pair.half_b, axes_b), tolerance);
  BestFace<T> of_b(face_gaps<T>(pair.offset_b, pair.half_b, pair.half_a, axes_a), tolerance);
  Mask<T> p_is_a = of_b.gap <= of_a.gap + tolerance;
  frame.b_is_incident = p_is_a;
  T face = select<T>(p_is_a, of_a.place, of_b.place), gap = select<T>(p_is_a, of_a.gap, of_b.gap);
  Vec<T> offset = components<T>(select(p_is_a, pair.offset_a, -pair.offset_b));
  Vec<T> half_p = components<T>(select(p_is_a, pair.half_a, pair.half_b));
  frame.half = select(p_is_a, pair.half_b, pair.half_a);
  Columns<T> turn = select<T>(p_is_a, axes_a, axes_b);

  // P's axes that follow the face's axis are x and y.
  Mask<T> is_0 = face == 0.0, is_1 = face == 1.0;
  auto of = [&](const auto& if_0, const auto& if_1, const auto& if_2) {
    return select(is_0, if_0, select(is_1, if_1, if_2));
  };
  T at_x = of(offset[1], offset[2], offset[0]), at_y = of(offset[2], offset[0], offset[1]);
  T at_z = of(offset[0], offset[1], offset[2]);
  frame.half_x = of(half_p[1], half_p[2], half_p[0]);
  frame.half_y = of(half_p[2], half_p[0], half_p[1]);
  frame.thickness = 2.0 * of(half_p[0], half_p[1], half_p[2]);
  auto sign_of = [](auto x) {
    using N = decltype(x);
    return select<N>(x < 0.0, splat<N>(-1.0), splat<N>(1.0));
  };
  T side = sign_of(at_z);
  Triple<T> z = of(turn[0], turn[1], turn[2]);
  frame.sign = side * each(sign_of, z);
  // The face is symmetric: mirroring x makes the edges right-handed.
  T mirror = (side * frame.sign[0]) * (frame.sign[1] * frame.sign[2]);
  at_x = mirror * at_x;
  frame.qx = mirror * (frame.sign * of(turn[1], turn[2], turn[0]));
  frame.qy = frame.sign * of(turn[2], turn[0], turn[1]);
  frame.qz = abs(z);
  frame.start = Triple<T>{};
  frame.length = frame.half + frame.half;
  frame.x = at_x - dot(frame.qx, frame.half);
  frame.y = at_y - dot(frame.qy, frame.half);
  frame.depth = -gap;
  T distance = max(depth_floor * pair.size + axis.separation, T{});
  Mask<T> pressed = distance > 0.0, by_edges = axis.axis >= double(first_edge_axis);
  if (any(pressed)) {
    ContactFrame<T> moved = frame;
    press_along_edges(moved, axis.axis, face, distance);
    frame.x = select<T>(pressed & by_edges, moved.x, frame.x);
    frame.y = select<T>(pressed & by_edges, moved.y, frame.y);
    // Of faces of equal gap SAT may have taken another one, and pressed along its normal.
    Triple<T> normal = select(p_is_a, axis.normal, pair.a_in_b * axis.normal);
    T upright = abs(of(normal[0], normal[1], normal[2]));
    T deeper = select<T>(upright > least_upright, frame.depth + distance, T{});
    frame.depth =
        select<T>(pressed & by_edges, moved.depth, select<T>(pressed, deeper, frame.depth));
  }
  Triple<T> one = uniform(splat<T>(1.0));
  Triple<T> by_slope = one / max(frame.qz, uniform(splat<T>(least_slope)));
  move_origin_along(frame, by_slope, frame.qx, frame.x, frame.half_x, pair.size);
  move_origin_along(frame, by_slope, frame.qy, frame.y, frame.half_y, pair.size);
  return frame;
}

}  // namespace box_contact::BOX_CONTACT_SET
