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

enum class Follows { face_of_a, face_of_b, points, edges, nothing };

struct Plane {
  Follows follows;
  // A normal that turns at constant rate.
  double since;           // the s of the normal
  Vector normal;          // unit vector from A to B; in the axes of the box whose face it follows
  Vector rate;            // ν [rad]
  double turn, crossing;  // |ν|, and |ν × n|: the speed of the normal
  // How vectors e of the boxes turn against it. With δ the difference of their rates and ν,
  // (n·e)' = n·(δ × e), and (n·e)'' = n·(δ × (δ × e) + (δ × ν) × e).
  BothVectors against;  // δ [rad]
  Both against_speed;   // |δ|
  Both against_bend;    // a bound of |(n·e)''| for a unit vector
  // One across edges: which of each box, and on which side of A B is, along the cross product.
  int edges[2];
  double side;

  static Plane turning(const Motion& motion, const Instant& now, Follows follows, const Vector& n,
                       const Vector& nu) {
    Plane plane;
    plane.follows = follows;
    plane.since = now.s;
    plane.normal = follows == Follows::face_of_a   ? now.local(0, n)
                   : follows == Follows::face_of_b ? now.local(1, n)
                                                   : n;
    plane.rate = nu;
    plane.turn = length(nu);
    plane.crossing = length(cross(nu, n));
    plane.against = motion.rate - both(nu, nu);
    plane.against_speed = length(plane.against);
    plane.against_bend = plane.against_speed * plane.against_speed +
                         length(cross(plane.against, both(nu, nu)));
    return plane;
  }
  static Plane across(int edge_a, int edge_b, double side) {
    Plane plane;
    plane.follows = Follows::edges;
    plane.edges[0] = edge_a, plane.edges[1] = edge_b;
    plane.side = side;
    return plane;
  }
};

// The largest angle by which a plane turns with points [rad].
constexpr double largest_turn = 1.0;

// Find the normal of a plane that turns; false where it has turned too far.
BC_INLINE bool find_normal(const Plane& plane, const Instant& now, Vector& n) {
  if (plane.follows == Follows::face_of_a || plane.follows == Follows::face_of_b) {
    n = now.bring(plane.follows == Follows::face_of_b, plane.normal);
    return true;
  }
  n = plane.normal;
  double angle = std::fabs(now.s - plane.since) * plane.turn;
  if (plane.follows == Follows::nothing || angle == 0.0) return true;
  if (!(angle <= 2.0 * largest_turn)) return false;
  SinesAndCosines half = sines_and_cosines(splat<Both>(0.5 * angle));
  double sine = now.s < plane.since ? -half.sine[0] : half.sine[0];
  Vector axis = (sine / plane.turn) * plane.rate, aside = cross(axis, n);
  n = n + (2.0 * half.cosine[0] * aside + 2.0 * cross(axis, aside));
  return true;
}

// Bound the gap along a normal that turns. Second derivatives have two bounds, and the smaller one is
// taken. As the normal sees it, a box that turns with it bends nothing. As the common frame sees it,
// nothing depends on how far the vertices are from the centres of turning but their own turns.
//
// Of a gap that is not above the target by `slack`, the value alone is found.
inline Bound bound_turning(const Motion& motion, const Instant& now, const Plane& plane,
                           double target, double slack) {
  constexpr double flat = 1e-7;  // edges across the normal, up to this cosine, count by their middles
  Bound bound;
  Vector n;
  if (!find_normal(plane, now, n)) return bound;
  Both one = splat<Both>(1.0), zero{}, sign{-1.0, 1.0};
  BothVectors normals = both(n, n), vertices = now.arms;
  Both along[3], side[3];  // of each axis: its cosine to the way to the other box, and −1, 0 or 1
  for (int k = 0; k < 3; ++k) {
    along[k] = -sign * dot(normals, now.axes[k]);
    side[k] = select<Both>(abs(along[k]) < splat<Both>(flat), zero,
                           select<Both>(along[k] > zero, one, -one));
    vertices += (side[k] * motion.half[k]) * now.axes[k];
  }
  Vector between = now.between + difference(vertices);
  bound.value = dot(n, between) - target;
  if (!(bound.value > slack)) return bound;
  double nu = plane.turn, p = plane.crossing, d = 1.0 - now.s;
  if (plane.follows == Follows::points) d = min(d, largest_turn / nu);
  BothVectors turning = cross(normals, plane.against);  // n·(δ × x) = (n × δ)·x
  BothVectors speeds = cross(motion.rate, vertices);
  // A normal along the axis of a turn sees nothing of it.
  Both oblique = min(one, length(cross(motion.turns.axis, normals)) + d * p);
  Both pull = motion.turned * length(speeds), pull_along = oblique * pull;
  Both bend = min(plane.against_bend, (oblique * motion.turned + 2.0 * p) * motion.turned + nu * p);
  Both in_turn = length(vertices) * plane.against_bend, moving = plane.against_speed * motion.reach;
  for (int k = 0; k < 3; ++k)
    bound.add_least((side[k] - one) * motion.half[k], (side[k] + one) * motion.half[k],
                    {along[k], -sign * dot(turning, now.axes[k]), bend});
  double far = larger_norm(now.between, now.between + d * motion.way);
  double by_turn = (in_turn[0] + in_turn[1]) + p * (nu * far + 2.0 * motion.speed);
  double speed = length(motion.way + difference(speeds)) + d * (pull[0] + pull[1]);
  double by_frame = (pull_along[0] + pull_along[1]) +
                    p * (2.0 * speed + nu * (length(between) + d * speed));
  bound.rate = (dot(n, motion.way) + dot(cross(plane.rate, n), now.between)) +
               difference(dot(turning, vertices));
  bound.rate -= rounding_share * (motion.speed + p * motion.far + (moving[0] + moving[1]));
  bound.curve = 0.5 * min(by_turn, by_frame);
  bound.horizon = d;
  return bound;
}

// Bound the gap along N = ± a × b / |a × b now|, of an edge of each box. N·(an axis of A) is another axis
// of A times b, and so for B. The gap stays above the target where N·c − Σ h·|N·e| stays above
// target · (1 + N²)/2, which is at least target · |N|. A gap up to the slack is of no use here, too.
inline Bound bound_across(const Motion& motion, const Instant& now, const Plane& plane,
                          double target, double slack) {
  Bound bound;
  Vector a = now.axis(0, plane.edges[0]), b = now.axis(1, plane.edges[1]), edges = cross(a, b);
  double size = 1.0 / length(edges), scale = plane.side * size, half_target = 0.5 * max(target, 0.0);
  if (!(size < 1e6)) return bound;  // too nearly parallel
  Vector n = scale * edges, way = now.between + difference(now.arms);
  BothVectors u[2], v[2];
  Both half[2], along[2];
  for (int step = 0; step < 2; ++step) {  // N stays across the edges themselves
    int k[2] = {(plane.edges[0] + step + 1) % 3, (plane.edges[1] + step + 1) % 3};
    u[step] = both(cross(now.axis(0, k[0]), a), a), v[step] = both(b, cross(b, now.axis(1, k[1])));
    half[step] = Both{motion.half[k[0]][0], motion.half[k[1]][1]};
    along[step] = scale * dot(u[step], v[step]);
  }
  double cosine = dot(a, b), share = half_target * size * size;  // N² is size² (1 − cosine²)
  double value = dot(n, way) - (half_target + share * (1.0 - cosine * cosine));
  Both reaches = half[0] * abs(along[0]) + half[1] * abs(along[1]);
  if (!(value - (reaches[0] + reaches[1]) > slack)) return bound;
  Vector moving = motion.way + difference(cross(motion.rate, now.arms));
  Vector rate_a = vector_of(motion.rate, 0), rate_b = vector_of(motion.rate, 1);
  Vector da = cross(rate_a, a), db = cross(rate_b, b), against = rate_b - rate_a;
  Both levers = length(motion.lever), turned = motion.turned, pulls = turned * turned * levers;
  double pa = length(da), pb = length(db), against_speed = length(against);
  double bend = against_speed * against_speed + length(cross(against, rate_a));
  double d = 1.0 - now.s;
  double far = larger_norm(way, way + d * motion.way) + 2.0 * (levers[0] + levers[1]);
  double fast = motion.speed + (turned[0] * levers[0] + turned[1] * levers[1]);
  // The rounding of a × b is that of N times its size.
  double reach = far + (motion.reach[0] + motion.reach[1]) + half_target * size;
  double rounding = size * rounding_share;
  bound.value = value - rounding * reach;
  bound.rate = (dot(n, moving) + scale * dot(cross(da, b) + cross(a, db), way)) +
               2.0 * share * cosine * dot(a, cross(against, b));
  bound.rate -= rounding * (fast + (turned[0] + turned[1]) * reach);
  bound.curve = 0.5 * size *
                    ((turned[0] * pa + 2.0 * pa * pb + turned[1] * pb) * far +
                     2.0 * (pa + pb) * fast + (pulls[0] + pulls[1])) +
                share * bend;
  bound.horizon = d;
  for (int step = 0; step < 2; ++step)
    bound.add_least(-half[step], half[step],
                    {along[step], scale * dot(u[step], cross(both(against, against), v[step])),
                     splat<Both>(size * bend)});
  return bound;
}

// Bound the gap less the target along a plane from now on. Where it is not above `slack`, the bound is of
// no use.
inline Bound bound_of(const Motion& motion, const Instant& now, const Plane& plane, double target,
                      double slack) {
  return plane.follows == Follows::edges ? bound_across(motion, now, plane, target, slack)
                                         : bound_turning(motion, now, plane, target, slack);
}

}  // namespace box_contact::BOX_CONTACT_SET::motion
