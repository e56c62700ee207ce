// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Faces that close within a step.
//
// The patch of a box that stands on an edge is a strip along it. If the rest of its face comes down within the
// step, the whole face is a constraint. Nothing else would stop it. It would overlap, and be pushed out with
// more energy than the impact took: a tall box would rock for ever.
#pragma once

#include "gaps.hpp"
#include "one_by_one.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Where faces close along an axis within a time, the centre of pressure may go as far along it as they reach.
// They close in that time, by a turn about the other rim. `pull`: by outside wrenches, along the normal
// [m/s²].
inline void close_faces(const Patch& patch, const Moving& a, const Moving& b, double time,
                        double pull, Block& block) {
  const FacePair& faces = patch.faces;
  Rectangle& shape = block.shape;
  bool is_narrow_1 = faces.is_narrow_1(shape), is_narrow_2 = faces.is_narrow_2(shape);
  if (!is_narrow_1 && !is_narrow_2) return;
  auto [arms, depth] = place<double>(a, b, a, b, 0.0, block);
  static_cast<Arms<double>&>(block) = arms;
  Vec<double> rotated = rotation_since(patch, a, b), spin = b.angular - a.angular;
  double gap = faces.gap - (depth - block.asked_depth);
  if (gap > 0.0) return;  // they touch elsewhere
  double falls = time * (closing_speed<double>(block, a, b) + gap_share * time * pull);
  // Returns the turn that closes the faces along an axis. `slope`: of the gap; `rate`: its change.
  auto close = [&](const Span& face, double slope, double rate, Span& span) {
    bool rises = slope > 0.0;
    double far = rises ? face.high : face.low, rim = rises ? span.low : span.high;
    double apart = gap + far * slope;
    if (!(apart > 0.0) || apart + time * far * rate > falls) return 0.0;
    (rises ? span.high : span.low) = far;
    double rate_of_turn = apart / (time * (far - rim));
    block.closing[0] -= rim * rate_of_turn;
    return rate_of_turn;
  };
  if (is_narrow_1)
    block.closing[2] = -close(faces.span_1, faces.slope.x - dot(rotated, shape.axis_2),
                              -dot(spin, shape.axis_2), shape.span_1);
  if (is_narrow_2)
    block.closing[1] = close(faces.span_2, faces.slope.y + dot(rotated, shape.axis_1),
                             dot(spin, shape.axis_1), shape.span_2);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
