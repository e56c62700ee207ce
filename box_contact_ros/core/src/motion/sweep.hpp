// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Sweeps: two boxes go from one pose to another while s goes from 0 to 1.
//
// A point of each box, its centre of turning, goes on a line. The axes turn the shortest way, at
// constant rate. So a box's own centre goes on an arc where it is not the centre of turning.
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

// The numbers of a box on its way. centre: of turning, in the box's frame; nullptr: zeros.
struct SweepNumbers {
  const double *start, *end, *size, *centre;
};

// Both boxes at one time.
struct Instant {
  double s;
  Both quaternions[4];
  BothVectors axes[3];  // common frame
  BothVectors arms;     // from the centres of turning to the boxes' centres, common frame [m]
  Vector between;       // from A's centre of turning to B's [m]

  BC_INLINE Vector axis(int box, int k) const { return vector_of(axes[k], box); }
  // Bring a vector from the axes of a box to the common frame, and back.
  BC_INLINE Vector bring(int box, const Vector& v) const {
    return (v[0] * axis(box, 0) + v[1] * axis(box, 1)) + v[2] * axis(box, 2);
  }
  BC_INLINE Vector local(int box, const Vector& v) const {
    return {dot(axis(box, 0), v), dot(axis(box, 1), v), dot(axis(box, 2), v)};
  }
};

// Two boxes on their ways.
class Motion {
 public:
  Vector sizes[2];          // full extents [m]
  BothVectors half, lever;  // half extents; centres of turning to the boxes' own, in their axes [m]
  Turns turns;
  BothVectors rate;  // of the turns, ω [rad]
  Both turned;       // |ω|
  Both reach;        // no point of a box is farther from its centre of turning [m]
  Vector way;        // by which B's centre goes more than A's [m]
  double speed;      // |way|
  double far;        // the largest distance of both centres [m]
  double rounding;   // see above [m]
  double fastest;    // no point of B is faster beside any of A [m]

  // Returns which box turns by 180 degrees, 0 or 1, or −1. Poses, sizes and centres are accepted.
  int set(const SweepNumbers& a, const SweepNumbers& b) {
    for (const SweepNumbers* box : {&a, &b}) {
      int of = box == &b;
      starts_[of] = pose_of(box->start), ends_[of] = pose_of(box->end);
      sizes[of] = {box->size[0], box->size[1], box->size[2]};
    }
    Both start[4], end[4];
    for (int k = 0; k < 4; ++k) {
      start[k] = Both{starts_[0].quaternion[k], starts_[1].quaternion[k]};
      end[k] = Both{ends_[0].quaternion[k], ends_[1].quaternion[k]};
    }
    if (int box = find_shortest_turns(start, end, turns); box >= 0) return box;
    half = splat<Both>(0.5) * both(sizes[0], sizes[1]);
    lever = {};
    BothVectors arms_at_start{}, arms_at_end{};
    if (a.centre || b.centre) {
      for (int k = 0; k < 3; ++k)
        lever[k] = Both{a.centre ? -a.centre[k] : 0.0, b.centre ? -b.centre[k] : 0.0};
      arms_at_start = rotation_matrix(start) * lever;
      arms_at_end = rotation_matrix(end) * lever;
    }
    turned = 2.0 * turns.half_angle;
    rate = turned * turns.axis;
    reach = length(half) + length(lever);
    froms_ = both(starts_[0].position, starts_[1].position) - arms_at_start;
    ways_ = (both(ends_[0].position, ends_[1].position) - arms_at_end) - froms_;
    from_ = (starts_[1].position - starts_[0].position) - difference(arms_at_start);
    Vector to = (ends_[1].position - ends_[0].position) - difference(arms_at_end);
    way = to - from_;
    speed = length(way);
    far = larger_norm(from_, to);
    double out = max(larger_norm(starts_[0].position, starts_[1].position),
                     larger_norm(ends_[0].position, ends_[1].position));
    rounding = rounding_share * (max(out, far) + 2.0 * (reach[0] + reach[1]));
    fastest = speed + (turned[0] * reach[0] + turned[1] * reach[1]);
    return -1;
  }

  double least_tolerance() const { return roundings_of_tolerance * rounding; }

  Instant at(double s) const {
    Instant now;
    now.s = s;
    now.between = from_ + s * way;
    if (s == 0.0 || s == 1.0) {  // the given poses, to the last bit
      const Pose<double>* poses = s == 0.0 ? starts_ : ends_;
      for (int k = 0; k < 4; ++k)
        now.quaternions[k] = Both{poses[0].quaternion[k], poses[1].quaternion[k]};
    } else {
      turns.at(s, now.quaternions);
    }
    Mat<Both> m = rotation_matrix(now.quaternions);
    for (int k = 0; k < 3; ++k) now.axes[k] = column(m, k);
    now.arms = m * lever;
    return now;
  }
  Pose<double> pose(int box, const Instant& now) const {
    if (now.s == 0.0) return starts_[box];
    if (now.s == 1.0) return ends_[box];
    return {(vector_of(froms_, box) + now.s * vector_of(ways_, box)) + vector_of(now.arms, box),
            {now.quaternions[0][box], now.quaternions[1][box], now.quaternions[2][box],
             now.quaternions[3][box]}};
  }
  // The velocity of a point of a box, by s [m].
  Vector velocity(int box, const double* point, double s) const {
    Vector at{point[0], point[1], point[2]};
    return vector_of(ways_, box) +
           cross(vector_of(rate, box), at - (vector_of(froms_, box) + s * vector_of(ways_, box)));
  }

 private:
  static Pose<double> pose_of(const double* p) {
    return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
  }

  Pose<double> starts_[2], ends_[2];
  BothVectors froms_, ways_;  // of the centres of turning, common frame [m]
  Vector from_;               // from A's centre of turning to B's at the start [m]
};

}  // namespace box_contact::BOX_CONTACT_SET::motion
