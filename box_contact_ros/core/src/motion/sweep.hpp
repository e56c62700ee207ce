// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Sweeps: a box goes from one pose to another while s goes from 0 to 1.
//
// A point of the box, its centre of turning, goes on a line. The axes turn the shortest way, at
// constant rate. So the box's own centre goes on an arc where it is not the centre of turning.
//
// Rounding. Let S be the largest distance of a centre from the frame's origin, and from the other
// centre, plus twice the reach of both boxes. Where a box is, and every gap along a plane, is off by
// less than 16 ε S: offsets and projections take some 10 units of ε/2 of S, axes some 50 of the reach.
#pragma once

#include "turn.hpp"

namespace box_contact::BOX_CONTACT_SET::motion {

constexpr double epsilon = 0x1p-52;
constexpr double rounding_share = 16.0 * epsilon;  // of S
// Tolerances are at least so many roundings: planes are followed from one to two of them.
constexpr double roundings_of_tolerance = 4.0;

// A box on its way.
struct Moving {
  Pose<double> start, end;
  Vector size, half;  // full and half extents [m]
  Vector lever;       // from the centre of turning to the box's, in the box's axes [m]
  Vector from, way;   // of the centre of turning, common frame [m]
  Turn turn;
  Vector rate;   // of the turn, ω [rad]
  double turned; // |ω|
  double reach;  // no point of the box is farther from the centre of turning [m]

  // Returns false where the turn has two ways. Poses and sizes are accepted.
  bool set(const double* start_pose, const double* end_pose, const double* extents,
           const double* centre) {
    auto pose = [](const double* p) {
      return Pose<double>{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
    };
    start = pose(start_pose), end = pose(end_pose);
    size = {extents[0], extents[1], extents[2]};
    half = 0.5 * size;
    Vector place = centre ? Vector{centre[0], centre[1], centre[2]} : Vector{};
    lever = -place;
    from = start.position + rotation_matrix(start.quaternion) * place;
    way = (end.position + rotation_matrix(end.quaternion) * place) - from;
    reach = norm(half) + norm(lever);
    if (!find_shortest_turn(start.quaternion, end.quaternion, turn)) return false;
    rate = turn.rate();
    turned = 2.0 * turn.half_angle;
    return true;
  }

  // The ends are the given poses, to the last bit.
  Pose<double> pose_at(double s) const {
    if (s == 0.0) return start;
    if (s == 1.0) return end;
    Pose<double> pose;
    turn.at(s, pose.quaternion);
    pose.position = (from + s * way) + rotation_matrix(pose.quaternion) * lever;
    return pose;
  }
};

// A box at one time.
struct BoxAt {
  Vector axes[3];  // common frame
  Vector arm;      // the lever in the common frame [m]

  // Bring a vector from the box's axes to the common frame.
  Vector bring(const Vector& v) const {
    return (v[0] * axes[0] + v[1] * axes[1]) + v[2] * axes[2];
  }
  Vector local(const Vector& v) const {
    return {dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)};
  }
};

// Both boxes at one time.
struct Instant {
  double s;
  BoxAt a, b;
  Vector between;  // from A's centre of turning to B's [m]
};

// Two boxes on their ways.
struct Motion {
  Moving a, b;
  Vector from, way;  // from A's centre of turning to B's, at the start, and its change [m]
  double speed;      // |way|
  double far;        // the largest distance of both centres [m]
  double rounding;   // see above [m]
  double fastest;    // no point of B is faster beside any of A [m]

  // Find what both boxes say together.
  void join() {
    auto centre = [](const Moving& box, const Pose<double>& pose) {
      return rotation_matrix(pose.quaternion) * -box.lever;
    };
    from = (b.start.position - a.start.position) + (centre(b, b.start) - centre(a, a.start));
    Vector to = (b.end.position - a.end.position) + (centre(b, b.end) - centre(a, a.end));
    way = to - from;
    speed = norm(way);
    far = max(norm(from), norm(to));
    double out = far;
    for (const Moving* box : {&a, &b})
      out = max(out, max(norm(box->start.position), norm(box->end.position)));
    rounding = rounding_share * (out + 2.0 * (a.reach + b.reach));
    fastest = speed + a.turned * a.reach + b.turned * b.reach;
  }

  double least_tolerance() const { return roundings_of_tolerance * rounding; }

  Instant at(double s) const {
    Instant now;
    now.s = s;
    now.between = from + s * way;
    for (bool is_a : {true, false}) {
      const Moving& box = is_a ? a : b;
      BoxAt& here = is_a ? now.a : now.b;
      double quaternion[4];
      if (s == 0.0 || s == 1.0)
        std::memcpy(quaternion, (s == 0.0 ? box.start : box.end).quaternion, sizeof quaternion);
      else
        box.turn.at(s, quaternion);
      Mat<double> m = rotation_matrix(quaternion);
      for (int k = 0; k < 3; ++k) here.axes[k] = column(m, k);
      here.arm = here.bring(box.lever);
    }
    return now;
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
