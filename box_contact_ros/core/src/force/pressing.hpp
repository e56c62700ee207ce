// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pressing N and rocking τ of a patch whose centre of pressure would be beyond its rims.
//
// What presses is a cone: N ≥ 0, and each τ between two multiples of N. The impulses x within it that
// leave least energy, ½·xᵀ·A·x + bᵀ·x, are on one of its four faces, on one of its four edges, or none.
// Row by row, bounds that follow N would take from rocking what pressing has just balanced: a plate that
// falls on its edge had four times its energy.
#pragma once

#include "rectangle.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Rocking per pressing, from where to where: N·n at x·e1 + y·e2 has the moment N·(y·e1 − x·e2).
inline Span rocking_1(const Rectangle& shape) { return shape.span_2; }
inline Span rocking_2(const Rectangle& shape) { return {-shape.span_1.high, -shape.span_1.low}; }

// The impulses of least energy on the rims.
class OnTheRim {
 public:
  OnTheRim(const Rectangle& shape, const Mat<double>& a, const Vec<double>& b)
      : a_(a), b_(b), spans_{rocking_1(shape), rocking_2(shape)} {
    for (double first : {spans_[0].low, spans_[0].high}) {
      for (double second : {spans_[1].low, spans_[1].high}) take_edge({1.0, first, second});
      take_face({1.0, first, 0.0}, 2);
    }
    for (double second : {spans_[1].low, spans_[1].high}) take_face({1.0, 0.0, second}, 1);
  }
  const Vec<double>& impulses() const { return best_; }

 private:
  void take_edge(const Vec<double>& edge) {
    double along = dot(edge, b_);
    if (along < 0.0) take((-along / dot(edge, a_ * edge)) * edge);
  }
  // The face along an edge, whose rocking `row` is free.
  void take_face(const Vec<double>& edge, int row) {
    Vec<double> pushed = a_ * edge;
    double ee = dot(edge, pushed), er = pushed[row], rr = a_[row][row];
    double determinant = ee * rr - er * er, along = dot(edge, b_);
    if (!(determinant > 0.0)) return;
    double pressing = (er * b_[row] - rr * along) / determinant;
    double rocking = (er * along - ee * b_[row]) / determinant;
    const Span& span = spans_[row - 1];
    if (!(pressing > 0.0) || rocking < pressing * span.low || rocking > pressing * span.high)
      return;
    Vec<double> impulses = pressing * edge;
    impulses[row] = rocking;
    take(impulses);
  }
  void take(const Vec<double>& impulses) {
    double energy = dot(impulses, 0.5 * (a_ * impulses) + b_);
    if (!(energy < energy_)) return;
    energy_ = energy;
    best_ = impulses;
  }

  const Mat<double>& a_;
  const Vec<double>& b_;
  Span spans_[2];
  Vec<double> best_{0.0, 0.0, 0.0};
  double energy_ = 0.0;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
