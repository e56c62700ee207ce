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

// The impulses of least energy on the rims.
template <class T>
class OnTheRim {
 public:
  BC_INLINE OnTheRim(const RectangleOf<T>& shape, const Mat<T>& a, const Vec<T>& b)
      : a_(a), b_(b), spans_{rocking_1(shape), rocking_2(shape)} {
    T one = splat<T>(1.0), none{};
    const T firsts[] = {spans_[0].low, spans_[0].high}, seconds[] = {spans_[1].low, spans_[1].high};
    for (const T& first : firsts) {
      for (const T& second : seconds) take_edge({one, first, second});
      take_face({one, first, none}, 2);
    }
    for (const T& second : seconds) take_face({one, none, second}, 1);
  }
  BC_INLINE const Vec<T>& impulses() const { return best_; }

 private:
  BC_INLINE void take_edge(const Vec<T>& edge) {
    T along = dot(edge, b_);
    Mask<T> presses = along < 0.0;
    if (any(presses)) take(presses, (-along / dot(edge, a_ * edge)) * edge);
  }
  // The face along an edge, whose rocking `row` is free.
  BC_INLINE void take_face(const Vec<T>& edge, int row) {
    Vec<T> pushed = a_ * edge;
    T ee = dot(edge, pushed), er = pushed[row], rr = a_[row][row];
    T determinant = ee * rr - er * er, along = dot(edge, b_);
    Mask<T> is_face = determinant > 0.0;
    if (!any(is_face)) return;
    T pressing = (er * b_[row] - rr * along) / determinant;
    T rocking = (er * along - ee * b_[row]) / determinant;
    const SpanOf<T>& span = spans_[row - 1];
    Mask<T> is_within = is_face & (pressing > 0.0) & (rocking >= pressing * span.low) &
                        (rocking <= pressing * span.high);
    if (!any(is_within)) return;
    Vec<T> impulses = pressing * edge;
    impulses[row] = rocking;
    take(is_within, impulses);
  }
  BC_INLINE void take(Mask<T> allowed, const Vec<T>& impulses) {
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
