// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pressing N and rocking τ of a patch whose centre of pressure would be beyond its rims.
//
// What presses is a cone: N ≥ 0, and each τ between two multiples of N. The impulses x within it that
// leave least energy, ½·xᵀ·A·x + bᵀ·x, are on one of its four faces, on one of its four edges, or none.
// Row by row, bounds that follow N would take from rocking what pressing has just balanced: a plate that
// falls on its edge had four times its energy.
#pragma once

#include "../lanes/triples.hpp"
#include "rectangle.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Rocking per pressing, from where to where: N·n at x·e1 + y·e2 has the moment N·(y·e1 − x·e2).
template <class T>
BC_INLINE SpanOf<T> rocking_1(const RectangleOf<T>& shape) {
  return shape.span_2;
}
template <class T>
BC_INLINE SpanOf<T> rocking_2(const RectangleOf<T>& shape) {
  return {-shape.span_1.high, -shape.span_1.low};
}

// The impulses of least energy on the rims. One of the faces that the impulses without bounds are beyond bears
// them: from within all of these, a step toward those would leave less.
template <class T>
class OnTheRim {
 public:
  BC_INLINE OnTheRim(const RectangleOf<T>& shape, const Mat<T>& a, const Vec<T>& b,
                     const Vec<T>& unbounded)
      : a_(a), b_(b), spans_{rocking_1(shape), rocking_2(shape)} {
    T one = splat<T>(1.0), none{};
    const T firsts[] = {spans_[0].low, spans_[0].high}, seconds[] = {spans_[1].low, spans_[1].high};
    const T &n = unbounded[0], &x = unbounded[1], &y = unbounded[2];
    const Mask<T> beyond_firsts[] = {(x < n * firsts[0]), (x > n * firsts[1])};
    const Mask<T> beyond_seconds[] = {(y < n * seconds[0]), (y > n * seconds[1])};
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j)
        consider_edge(beyond_firsts[i] | beyond_seconds[j], {one, firsts[i], seconds[j]});
      consider_face(beyond_firsts[i], {one, firsts[i], none}, 2);
    }
    for (int j = 0; j < 2; ++j) consider_face(beyond_seconds[j], {one, none, seconds[j]}, 1);
  }
  BC_INLINE const Vec<T>& impulses() const { return best_; }

 private:
  BC_INLINE void consider_edge(Mask<T> may_bear, const Vec<T>& edge) {
    if (!any(may_bear)) return;
    T along = dot(edge, b_);
    Mask<T> presses = may_bear & (along < 0.0);
    if (any(presses)) consider(presses, (-along / dot(edge, a_ * edge)) * edge);
  }
  // The face along an edge, whose rocking `row` is free.
  BC_INLINE void consider_face(Mask<T> may_bear, const Vec<T>& edge, int row) {
    if (!any(may_bear)) return;
    Vec<T> pushed = a_ * edge;
    T ee = dot(edge, pushed), er = pushed[row], rr = a_[row][row];
    T determinant = ee * rr - er * er, along = dot(edge, b_);
    Mask<T> is_face = may_bear & (determinant > 0.0);
    if (!any(is_face)) return;
    T pressing = (er * b_[row] - rr * along) / determinant;
    T rocking = (er * along - ee * b_[row]) / determinant;
    const SpanOf<T>& span = spans_[row - 1];
    Mask<T> is_within = is_face & (pressing > 0.0) & (rocking >= pressing * span.low) &
                        (rocking <= pressing * span.high);
    if (!any(is_within)) return;
    Vec<T> impulses = pressing * edge;
    impulses[row] = rocking;
    consider(is_within, impulses);
  }
  BC_INLINE void consider(Mask<T> allowed, const Vec<T>& impulses) {
    T energy = dot(impulses, 0.5 * (a_ * impulses) + b_);
    Mask<T> is_less = allowed & (energy < energy_);
    energy_ = select<T>(is_less, energy, energy_);
    best_ = select(is_less, impulses, best_);
  }

  const Mat<T>& a_;
  const Vec<T>& b_;
  SpanOf<T> spans_[2];
  Vec<T> best_{};
  T energy_{};
};

}  // namespace box_contact::BOX_CONTACT_SET::force
