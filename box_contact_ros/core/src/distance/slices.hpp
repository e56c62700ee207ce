// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Slices: pairs with parallel edges, whose nearest points fill a set. Its centroid is the answer.
//
// Where an edge of A and an edge of B have the same direction, and the boxes face each other along
// it, the way between nearest points is across it. So both boxes are cut down to a slice without
// extent along that direction, in the middle of what they have in common there. The nearest points
// of the slices are the centroids along this direction. Parallel boxes have up to three such
// directions.
//
// A face may also be parallel to edges of the other box that are along none of its own. If such a
// face wins, facing.hpp finds the centroid.
#pragma once

#include "../separating_axis.hpp"

namespace box_contact::BOX_CONTACT_SET {

namespace apart {

// Entries of R up to this count as zero: features are parallel. Moving parallel boxes rigidly
// leaves no more. With 2⁻⁵¹ one in a thousand of moved stacks would be missed; with 2⁻⁴⁹ none more
// is found.
constexpr double flat = 0x1p-50;

template <class T>
BC_INLINE Mask<T> has_parallel_features(const Pair<T>& pair) {
  Triple<T> least = min(abs(pair.b_in_a[0]), min(abs(pair.b_in_a[1]), abs(pair.b_in_a[2])));
  return any_of(uniform(splat<T>(flat)) >= least);
}

// The sum of the columns of a matrix.
template <class T>
BC_INLINE Triple<T> sum_of_columns(const Columns<T>& m) {
  return (m[0] + m[1]) + m[2];
}

// Which directions two boxes have in common: matrices whose entry (i, j) is 1 or 0 for edge i of A
// and edge j of B.
template <class T>
struct Directions {
  Columns<T> flat_entries;  // R's entry counts as zero
  Columns<T> common;        // both edges have the same direction

  BC_INLINE explicit Directions(const Columns<T>& b_in_a) {
    Triple<T> one = uniform(splat<T>(1.0)), zero{}, most = uniform(splat<T>(flat));
    for (int j = 0; j < 3; ++j) {
      auto is_flat = most >= abs(b_in_a[j]);
      flat_entries[j] = choose(is_flat, one, zero);
      common[j] = rotated(flat_entries[j]) * rotated_back(flat_entries[j]);
    }
  }
};

// The number of the winning face, 0 to 2 of A or of B; 0.0 where edges win.
template <class T>
BC_INLINE T at_winning_face(const SeparatingAxis<T>& axis, const Triple<T>& of_a,
                            const Triple<T>& of_b) {
  if constexpr (is_scalar<T>) {
    return axis.axis < 3 ? of_a[axis.axis] : axis.axis < 6 ? of_b[axis.axis - 3] : 0.0;
  } else {
    T found{};
    for (int k = 0; k < 3; ++k) {
      found = select<T>(axis.axis == double(k), of_a[k], found);
      found = select<T>(axis.axis == double(3 + k), of_b[k], found);
    }
    return found;
  }
}

// Where the winning face is parallel to an edge of the other box that is along none of its own.
template <class T>
BC_INLINE Mask<T> faces_oblique_edge(const SeparatingAxis<T>& axis, const Directions<T>& shared) {
  Triple<T> one = uniform(splat<T>(1.0));
  Triple<T> oblique_a = one - sum_of_columns(shared.common);
  Triple<T> oblique_b = one - sum_of_columns(transpose(shared.common));
  Triple<T> at_a = shared.flat_entries * oblique_b;
  Triple<T> at_b = transpose(shared.flat_entries) * oblique_a;
  return at_winning_face<T>(axis, at_a, at_b) > 0.0;
}

// Cut the chosen pairs down to slices, and move their origins there.
template <class T>
BC_INLINE void cut_to_slices(Mask<T> chosen, const Directions<T>& shared, Pair<T>& pair) {
  Triple<T> zero{}, one = uniform(splat<T>(1.0));
  Columns<T> cut, middle, on_b;
  for (int j = 0; j < 3; ++j) {
    Triple<T> reach = repeated(pair.half_b, j);
    Triple<T> low = max(-pair.half_a, pair.offset_a - reach);
    Triple<T> high = min(pair.half_a, pair.offset_a + reach);
    auto is_cut = (shared.common[j] > zero) & (high >= low);
    cut[j] = choose(is_cut, one, zero);
    middle[j] = choose(is_cut, 0.5 * (low + high), zero);
    Triple<T> along = middle[j] - pair.offset_a;
    on_b[j] = choose(is_cut, choose(pair.b_in_a[j] >= zero, along, -along), zero);
  }
  auto cut_a = sum_of_columns(cut) > zero, cut_b = sum_of_columns(transpose(cut)) > zero;
  Triple<T> middle_a = sum_of_columns(middle), middle_b = sum_of_columns(transpose(on_b));
  Triple<T> offset_a = (pair.offset_a - middle_a) + pair.b_in_a * middle_b;
  Triple<T> offset_b = (pair.offset_b - pair.a_in_b * middle_a) + middle_b;
  auto set = [&](Triple<T>& number, const Triple<T>& value) {
    number = select(chosen, value, number);
  };
  set(pair.half_a, choose(cut_a, zero, pair.half_a));
  set(pair.half_b, choose(cut_b, zero, pair.half_b));
  set(pair.offset_a, choose(cut_a, zero, offset_a));
  set(pair.offset_b, choose(cut_b, zero, offset_b));
  set(pair.origin_a, pair.origin_a + pair.axes_a * middle_a);
  set(pair.origin_b, pair.origin_b + pair.axes_b * middle_b);
}

}  // namespace apart

}  // namespace box_contact::BOX_CONTACT_SET
