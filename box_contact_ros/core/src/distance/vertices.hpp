// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Vertices: of each box the one that is nearest to the other box.
//
// Where no edges cross, a vertex and its nearest point on the other box are nearest. That point is
// the vertex clamped to the box, in the frame of the box.
#pragma once

#include "../poses.hpp"

namespace box_contact::BOX_CONTACT_SET {

// A point on each box, and the way between them.
template <class T>
struct NearestPoints {
  T distance;      // [m]
  Triple<T> on_a;  // in A's frame [m]
  Triple<T> on_b;  // in B's frame [m]
  Triple<T> way;   // from A to B, in A's frame [m]

  // Take the other points where they are nearer.
  BC_INLINE void take(Mask<T> nearer, const NearestPoints& other) {
    distance = select<T>(nearer, other.distance, distance);
    on_a = select(nearer, other.on_a, on_a);
    on_b = select(nearer, other.on_b, on_b);
    way = select(nearer, other.way, way);
  }
};

template <class T>
BC_INLINE NearestPoints<double> lane(const NearestPoints<T>& found, int i) {
  return {lane(found.distance, i), triple_of_lane<T>(found.on_a, i),
          triple_of_lane<T>(found.on_b, i), triple_of_lane<T>(found.way, i)};
}
template <class T>
BC_INLINE void set_lane(NearestPoints<T>& found, int i, const NearestPoints<double>& one) {
  if constexpr (is_scalar<T>) {
    found = one;
  } else {
    set_lane(found.distance, i, one.distance);
    for (int k = 0; k < 3; ++k) {
      set_lane(found.on_a[k], i, one.on_a[k]);
      set_lane(found.on_b[k], i, one.on_b[k]);
      set_lane(found.way[k], i, one.way[k]);
    }
  }
}

namespace apart {

// A box in its own frame, and the other box of the pair.
template <class T>
struct View {
  Triple<T> offset;        // to the other box [m]
  Triple<T> half;          // half extents [m]
  Triple<T> other_half;    // [m]
  const Columns<T>& axes;  // of the other box

  // Bring a place from the frame of the other box.
  BC_INLINE Triple<T> bring(const Triple<T>& place) const {
    return ((offset + repeated(place, 0) * axes[0]) + repeated(place, 1) * axes[1]) +
           repeated(place, 2) * axes[2];
  }
};
template <class T>
BC_INLINE View<T> view_of_a(const Pair<T>& pair) {
  return {pair.offset_a, pair.half_a, pair.half_b, pair.b_in_a};
}
template <class T>
BC_INLINE View<T> view_of_b(const Pair<T>& pair) {
  return {-pair.offset_b, pair.half_b, pair.half_a, pair.a_in_b};
}

// A vertex of the other box.
template <class T>
struct Vertex {
  T distance2;      // from the box, squared [m²]
  Triple<T> place;  // in the frame of the other box [m]
};

template <class T>
BC_INLINE T squared_distance(const Vec<T>& x, const Vec<T>& half) {
  Vec<T> outside = max(abs(x) - half, Vec<T>{});
  return dot(outside, outside);
}

// The nearest of eight vertices, one after the other. Of equal ones the first: + before − along the
// first axis, then along the second, then along the third.
template <class T, class = std::enable_if_t<!is_scalar<T>>>
BC_INLINE Vertex<T> nearest_vertex(const View<T>& view) {
  Vec<T> edges[3];
  for (int j = 0; j < 3; ++j) edges[j] = view.other_half[j] * view.axes[j];
  T nearest = splat<T>(infinity), number{};
  for (int first = 0; first < 2; ++first) {
    Vec<T> on_first = first ? view.offset - edges[0] : view.offset + edges[0];
    for (int second = 0; second < 2; ++second) {
      Vec<T> on_second = second ? on_first - edges[1] : on_first + edges[1];
      for (int third = 0; third < 2; ++third) {
        T found =
            squared_distance<T>(third ? on_second - edges[2] : on_second + edges[2], view.half);
        number = select<T>(found < nearest, splat<T>(4 * first + 2 * second + third), number);
        nearest = min(found, nearest);
      }
    }
  }
  Vec<T> place;
  for (int j = 0; j < 3; ++j) {
    double bit = 4 >> j;
    Mask<T> minus = number >= bit;
    place[j] = select<T>(minus, -view.other_half[j], view.other_half[j]);
    number = select<T>(minus, number - bit, number);
  }
  return {nearest, place};
}

// Numbers side by side in a register of this machine.
#if defined(__AVX512F__)
using Wide = Lanes<double, 8>;
#elif defined(__AVX2__)
using Wide = Lanes<double, 4>;
#else
using Wide = Lanes<double, 2>;
#endif

// Signs of the choices from `first` on, in lanes: −1 where the bit is set.
BC_INLINE Wide signs(int first, int bit) {
  Wide found;
  for (int i = 0; i < width<Wide>; ++i) found[i] = (first + i) >> bit & 1 ? -1.0 : 1.0;
  return found;
}

// The same of a single pair: its vertices side by side.
BC_INLINE Vertex<double> nearest_vertex(const View<double>& view) {
  constexpr int blocks = 8 / width<Wide>;
  Wide distance2[blocks], least = splat<Wide>(infinity);
  for (int n = 0; n < blocks; ++n) {
    Vec<Wide> corner, half;
    for (int k = 0; k < 3; ++k)
      corner[k] = splat<Wide>(view.offset[k]), half[k] = splat<Wide>(view.half[k]);
    for (int j = 0; j < 3; ++j) {
      Triple<double> edge = view.other_half[j] * view.axes[j];
      for (int k = 0; k < 3; ++k) corner[k] += signs(n * width<Wide>, 2 - j) * edge[k];
    }
    distance2[n] = squared_distance(corner, half);
    least = min(distance2[n], least);
  }
  double nearest = least[0];
  for (int i = 1; i < width<Wide>; ++i) nearest = min(least[i], nearest);
  unsigned equal = 0;
  for (int n = 0; n < blocks; ++n)
    equal |= bits(distance2[n] == splat<Wide>(nearest)) << (n * width<Wide>);
  int first = __builtin_ctz(equal | 1U << 7);
  Vec<double> sign{first & 4 ? -1.0 : 1.0, first & 2 ? -1.0 : 1.0, first & 1 ? -1.0 : 1.0};
  return {nearest, triple(sign) * view.other_half};
}

// The nearest vertex of both boxes.
template <class T>
BC_INLINE NearestPoints<T> try_vertices(const Pair<T>& pair) {
  View<T> a = view_of_a(pair), b = view_of_b(pair);
  Vertex<T> of_b = nearest_vertex(a), of_a = nearest_vertex(b);
  Triple<T> from_b = a.bring(of_b.place), from_a = b.bring(of_a.place);
  Triple<T> on_a = clamp(from_b, pair.half_a), on_b = clamp(from_a, pair.half_b);
  Mask<T> of_a_is_nearer = of_a.distance2 < of_b.distance2;
  return {sqrt(min(of_a.distance2, of_b.distance2)), select(of_a_is_nearer, of_a.place, on_a),
          select(of_a_is_nearer, on_b, of_b.place),
          select(of_a_is_nearer, pair.b_in_a * (on_b - from_a), Triple<T>(from_b - on_a))};
}

// The nearest vertex of each box of a single pair.
inline NearestPoints<double> nearest_vertex_of_a(const Pair<double>& pair) {
  View<double> b = view_of_b(pair);
  Vertex<double> of_a = nearest_vertex(b);
  Triple<double> from_a = b.bring(of_a.place), on_b = clamp(from_a, pair.half_b);
  return {std::sqrt(of_a.distance2), of_a.place, on_b, pair.b_in_a * (on_b - from_a)};
}
inline NearestPoints<double> nearest_vertex_of_b(const Pair<double>& pair) {
  View<double> a = view_of_a(pair);
  Vertex<double> of_b = nearest_vertex(a);
  Triple<double> from_b = a.bring(of_b.place), on_a = clamp(from_b, pair.half_a);
  return {std::sqrt(of_b.distance2), on_a, of_b.place, from_b - on_a};
}

}  // namespace apart

}  // namespace box_contact::BOX_CONTACT_SET
