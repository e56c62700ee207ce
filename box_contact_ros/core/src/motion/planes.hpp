// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Planes that turn with the features they stand on, and bounds of the gaps along them.
//
// Along any direction the gap of two boxes is at most their distance, so a plane may turn as it likes.
// With the right turn its gap is the distance until other features are nearest:
// - the normal of a face turns with its box;
// - between a vertex and another vertex or an edge, the normal turns as the way between the points;
// - the normal across two edges stays across both;
// - and it may stand still.
#pragma once

#include "bound.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

enum class Turns { never, with_a, with_b, with_points, with_edges };

// How a vector e of a box turns against a normal n. With δ the difference of their rates and ν the
// normal's, (n·e)' = n·(δ × e) and (n·e)'' = n·(δ × (δ × e) + (δ × ν) × e).
struct Against {
  Vector rate;   // δ [rad]
  double speed;  // |δ|
  double bend;   // a bound of |(n·e)''| for a unit vector

  Against() = default;
  Against(const Vector& of_box, const Vector& of_normal) : rate(of_box - of_normal) {
    speed = norm(rate);
    bend = speed * speed + norm(cross(rate, of_normal));
  }
};

struct Plane {
  Turns turns;
  // A normal that turns at constant rate.
  double since;           // the s of the normal
  Vector normal;          // unit vector from A to B; in the axes of the box that it turns with
  Vector rate;            // ν [rad]
  double turn, crossing;  // |ν|, and |ν × n|: the speed of the normal
  Against against[2];     // of the axes of A, and of B
  // One across edges: which of each box, and on which side of A B is, along the cross product.
  int edges[2];
  double side;

  static Plane turning(const Motion& motion, const Instant& now, Turns turns, const Vector& n,
                       const Vector& nu) {
    Plane plane;
    plane.turns = turns;
    plane.since = now.s;
    plane.normal = turns == Turns::with_a   ? now.a.local(n)
                   : turns == Turns::with_b ? now.b.local(n)
                                            : n;
    plane.rate = nu;
    plane.turn = norm(nu);
    plane.crossing = norm(cross(nu, n));
    plane.against[0] = {motion.a.rate, nu};
    plane.against[1] = {motion.b.rate, nu};
    return plane;
  }
  static Plane across(const Motion& motion, int edge_a, int edge_b, double side) {
    Plane plane;
    plane.turns = Turns::with_edges;
    plane.edges[0] = edge_a, plane.edges[1] = edge_b;
    plane.side = side;
    plane.against[1] = {motion.b.rate, motion.a.rate};
    return plane;
  }
};

// The largest angle by which a plane turns with points [rad].
constexpr double largest_turn = 1.0;

// Find the normal of a plane that turns; false where it has turned too far.
inline bool find_normal(const Plane& plane, const Instant& now, Vector& n) {
  n = plane.turns == Turns::with_a   ? now.a.bring(plane.normal)
      : plane.turns == Turns::with_b ? now.b.bring(plane.normal)
                                     : plane.normal;
  double angle = std::fabs(now.s - plane.since) * plane.turn;
  if (plane.turns != Turns::with_points || angle == 0.0) return true;
  if (!(angle <= 2.0 * largest_turn)) return false;
  SineAndCosine half = sine_and_cosine(0.5 * angle);
  Vector axis = ((now.s < plane.since ? -half.sine : half.sine) / plane.turn) * plane.rate;
  Vector aside = cross(axis, n);
  n = n + (2.0 * half.cosine * aside + 2.0 * cross(axis, aside));
  return true;
}

// The vertex of a box that is farthest along a direction. Of edges across it, the middle.
struct Vertex {
  Vector arm;          // from the centre of turning, common frame [m]
  Vector side, along;  // of each axis: −1, 0 or 1, and its cosine to the direction

  Vertex(const Moving& box, const BoxAt& here, const Vector& direction) : arm(here.arm) {
    constexpr double flat = 1e-7;
    for (int k = 0; k < 3; ++k) {
      along[k] = dot(direction, here.axes[k]);
      side[k] = std::fabs(along[k]) < flat ? 0.0 : along[k] > 0.0 ? 1.0 : -1.0;
      arm += (side[k] * box.half[k]) * here.axes[k];
    }
  }
};

// Bound the gap along a normal that turns. Second derivatives have two bounds, and the smaller one is
// taken. As the normal sees it, a box that turns with it bends nothing. As the common frame sees it,
// nothing depends on how far the vertices are from the centres of turning but their own turns.
inline Bound bound_turning(const Motion& motion, const Instant& now, const Plane& plane,
                           double target) {
  Bound bound;
  Vector n;
  if (!find_normal(plane, now, n)) return bound;
  double nu = plane.turn, p = plane.crossing, d = 1.0 - now.s;
  if (plane.turns == Turns::with_points) d = min(d, largest_turn / nu);
  Vector way = now.between, moving = motion.way;
  double in_turn = p * (nu * max(norm(way), norm(way + d * motion.way)) + 2.0 * motion.speed);
  double pulled = 0.0, pulled_along = 0.0, fast = motion.speed + p * motion.far;
  bound.rate = dot(n, motion.way) + dot(cross(plane.rate, n), now.between);
  for (int of = 0; of < 2; ++of) {
    const Moving& box = of ? motion.b : motion.a;
    const BoxAt& here = of ? now.b : now.a;
    const Against& against = plane.against[of];
    double sign = of ? 1.0 : -1.0;
    Vertex vertex(box, here, -sign * n);
    Vector speed = cross(box.rate, vertex.arm);
    way += sign * vertex.arm, moving += sign * speed;
    bound.rate += sign * dot(n, cross(against.rate, vertex.arm));
    in_turn += norm(vertex.arm) * against.bend;
    // A normal along the axis of a turn sees nothing of it.
    double oblique = min(1.0, norm(cross(box.turn.axis, n)) + d * p);
    pulled += box.turned * norm(speed);
    pulled_along += oblique * box.turned * norm(speed);
    double bend = min(against.bend, (oblique * box.turned + 2.0 * p) * box.turned + nu * p);
    for (int k = 0; k < 3; ++k)
      bound.add_least((vertex.side[k] - 1.0) * box.half[k], (vertex.side[k] + 1.0) * box.half[k],
                      {vertex.along[k], -sign * dot(n, cross(against.rate, here.axes[k])), bend});
    fast += against.speed * box.reach;
  }
  double speed = norm(moving) + d * pulled;
  double in_frame = pulled_along + p * (2.0 * speed + nu * (norm(way) + d * speed));
  bound.value = dot(n, way) - target;
  bound.rate -= rounding_share * fast;
  bound.curve = 0.5 * min(in_turn, in_frame);
  bound.horizon = d;
  return bound;
}

// Bound the gap along N = ± a × b / |a × b now|, of an edge of each box. N·(an axis of A) is another axis
// of A times b, and so for B. The gap stays above the target where N·c − Σ h·|N·e| stays above
// target · (1 + N²)/2, which is at least target · |N|.
inline Bound bound_across(const Motion& motion, const Instant& now, const Plane& plane,
                          double target) {
  const Moving &A = motion.a, &B = motion.b;
  const Vector &a = now.a.axes[plane.edges[0]], &b = now.b.axes[plane.edges[1]];
  Bound bound;
  Vector edges = cross(a, b);
  double size = 1.0 / norm(edges), scale = plane.side * size, half_target = 0.5 * max(target, 0.0);
  if (!(size < 1e6)) return bound;  // too nearly parallel
  Vector n = scale * edges, way = now.between + (now.b.arm - now.a.arm);
  Vector moving = motion.way + (cross(B.rate, now.b.arm) - cross(A.rate, now.a.arm));
  Vector da = cross(A.rate, a), db = cross(B.rate, b);
  const Against& against = plane.against[1];
  double pa = norm(da), pb = norm(db), lever_a = norm(A.lever), lever_b = norm(B.lever);
  double d = 1.0 - now.s, levers = lever_a + lever_b;
  double far = max(norm(way), norm(way + d * motion.way)) + 2.0 * levers;
  double fast = motion.speed + A.turned * lever_a + B.turned * lever_b;
  double cosine = dot(a, b), share = half_target * size * size;  // N² is size² (1 − cosine²)
  bound.value = dot(n, way) - (half_target + share * (1.0 - cosine * cosine));
  bound.rate = (dot(n, moving) + scale * dot(cross(da, b) + cross(a, db), way)) +
               2.0 * share * cosine * dot(a, cross(against.rate, b));
  bound.curve =
      0.5 * size *
          ((A.turned * pa + 2.0 * pa * pb + B.turned * pb) * far + 2.0 * (pa + pb) * fast +
           A.turned * A.turned * lever_a + B.turned * B.turned * lever_b) +
      share * against.bend;
  bound.horizon = d;
  // The rounding of a × b is that of N times its size.
  double reach = far + (A.reach + B.reach) + half_target * size;
  bound.value -= size * rounding_share * reach;
  bound.rate -= size * rounding_share * (fast + (A.turned + B.turned) * reach);
  for (int of = 0; of < 2; ++of)
    for (int step = 1; step < 3; ++step) {  // N stays across the edge itself
      int k = (plane.edges[of] + step) % 3;
      const Vector& e = (of ? now.b : now.a).axes[k];
      Vector u = of ? a : cross(e, a), v = of ? cross(b, e) : b;
      double half = (of ? B : A).half[k];
      bound.add_least(-half, half, {scale * dot(u, v), scale * dot(u, cross(against.rate, v)),
                                    size * against.bend});
    }
  return bound;
}

// Bound the gap less the target along a plane from now on. Where it is of no use, the value is below 0.
inline Bound bound_of(const Motion& motion, const Instant& now, const Plane& plane,
                      double target) {
  return plane.turns == Turns::with_edges ? bound_across(motion, now, plane, target)
                                          : bound_turning(motion, now, plane, target);
}

}  // namespace box_contact::BOX_CONTACT_SET::motion
