// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A judge of motions that shares no code with the core: intervals of time in extended precision.
//
// Of two boxes on their ways the gap along a direction that stands still is the least of some smooth
// functions, one for each pair of vertices. No vertex accelerates by more than ω² · reach. So over an
// interval of width w the gap is at least that of the nearer end less (both accelerations) · w² / 8. An
// interval that no direction proves is halved. Any direction gives a valid bound, whoever names it: here
// the axes of the separating-axis test, and the normal of bc_distance.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "box_contact/box_contact.h"

namespace judge {

using Real = long double;

struct V {
  Real x, y, z;
};
inline V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V operator*(Real k, V a) { return {k * a.x, k * a.y, k * a.z}; }
inline Real dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V cross(V a, V b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Real norm(V a) { return std::sqrt(dot(a, a)); }

struct Q {
  Real x, y, z, w;
};
inline Q product(Q a, Q b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
          a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
inline Q unit(const double* q) {
  Real x = q[0], y = q[1], z = q[2], w = q[3], l = std::sqrt(x * x + y * y + z * z + w * w);
  return {x / l, y / l, z / l, w / l};
}

struct Box {
  V centre, axis[3];
  Real half[3];
  Q turn;
};
inline void set_axes(Box& box, Q q) {
  box.turn = q;
  box.axis[0] = {1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z),
                 2 * (q.x * q.z - q.w * q.y)};
  box.axis[1] = {2 * (q.x * q.y - q.w * q.z), 1 - 2 * (q.x * q.x + q.z * q.z),
                 2 * (q.y * q.z + q.w * q.x)};
  box.axis[2] = {2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                 1 - 2 * (q.x * q.x + q.y * q.y)};
}

class Moving {
 public:
  explicit Moving(const bc_sweep& sweep) : start_(unit(sweep.start.quaternion)) {
    Q end = unit(sweep.end.quaternion), back{-start_.x, -start_.y, -start_.z, start_.w};
    Q r = product(end, back);
    V v{r.x, r.y, r.z};
    if (r.w < 0) v = Real(-1) * v, r.w = -r.w;
    Real sine = norm(v);
    angle_ = 2 * std::atan2(sine, r.w);
    axis_ = sine > 0 ? (1 / sine) * v : V{0, 0, 1};
    for (int k = 0; k < 3; ++k) half_[k] = Real(sweep.size.extent[k]) / 2;
    lever_ = {-Real(sweep.centre[0]), -Real(sweep.centre[1]), -Real(sweep.centre[2])};
    auto origin = [&](const bc_pose& pose, Q q) {
      Box box;
      set_axes(box, q);
      return V{pose.position[0], pose.position[1], pose.position[2]} - arm(box);
    };
    from_ = origin(sweep.start, start_);
    way_ = origin(sweep.end, end) - from_;
  }

  Box at(Real s) const {
    Real half = s * angle_ / 2, sine = std::sin(half);
    Box box;
    set_axes(box, product({sine * axis_.x, sine * axis_.y, sine * axis_.z, std::cos(half)}, start_));
    box.centre = from_ + s * way_ + arm(box);
    std::copy(half_, half_ + 3, box.half);
    return box;
  }
  // No point accelerates by more.
  Real acceleration() const {
    V half{half_[0], half_[1], half_[2]};
    return angle_ * angle_ * (norm(half) + norm(lever_));
  }

 private:
  V arm(const Box& box) const {
    return lever_.x * box.axis[0] + lever_.y * box.axis[1] + lever_.z * box.axis[2];
  }

  Q start_;
  Real angle_, half_[3];
  V axis_, lever_, from_, way_;
};

struct Both {
  Box a, b;
};

inline Real gap(const Both& boxes, V n) {
  Real found = dot(n, boxes.b.centre - boxes.a.centre);
  for (const Box* box : {&boxes.a, &boxes.b})
    for (int k = 0; k < 3; ++k) found -= box->half[k] * std::fabs(dot(n, box->axis[k]));
  return found;
}

// The distance by all vertices and all pairs of edges, of boxes that are apart; of others it is 0 or
// above.
inline Real distance(const Both& boxes) {
  Real least = INFINITY;
  auto corner = [](const Box& box, int k) {
    V found = box.centre;
    for (int i = 0; i < 3; ++i) found = found + (k >> i & 1 ? box.half[i] : -box.half[i]) * box.axis[i];
    return found;
  };
  for (bool of_a : {true, false}) {
    const Box &box = of_a ? boxes.a : boxes.b, &other = of_a ? boxes.b : boxes.a;
    for (int k = 0; k < 8; ++k) {
      V offset = corner(other, k) - box.centre;
      Real square = 0;
      for (int i = 0; i < 3; ++i) {
        Real out = std::max(std::fabs(dot(offset, box.axis[i])) - box.half[i], Real(0));
        square += out * out;
      }
      least = std::min(least, square);
    }
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 4; ++k)
        for (int l = 0; l < 4; ++l) {
          auto middle = [](const Box& box, int along, int which) {
            int x = (along + 1) % 3, y = (along + 2) % 3;
            return box.centre + (which & 1 ? box.half[x] : -box.half[x]) * box.axis[x] +
                   (which & 2 ? box.half[y] : -box.half[y]) * box.axis[y];
          };
          V u = boxes.a.axis[i], v = boxes.b.axis[j];
          V way = middle(boxes.b, j, l) - middle(boxes.a, i, k), n = cross(u, v);
          Real square = dot(n, n);
          if (!(square > 0)) continue;
          Real on_a = dot(cross(way, v), n) / square, on_b = dot(cross(way, u), n) / square;
          if (std::fabs(on_a) > boxes.a.half[i] || std::fabs(on_b) > boxes.b.half[j]) continue;
          // Points of both edges: the cross product of edges that are almost parallel is rounding.
          V between = way + on_b * v - on_a * u;
          least = std::min(least, dot(between, between));
        }
  return std::sqrt(least);
}

// The direction of the fifteen axes with the largest gap.
inline V separating(const Both& boxes, Real& largest) {
  V best{0, 0, 1};
  largest = -INFINITY;
  auto attempt = [&](V n) {
    Real length = norm(n);
    if (!(length > 1e-12L)) return;
    for (Real sign : {Real(1), Real(-1)}) {
      V way = (sign / length) * n;
      Real found = gap(boxes, way);
      if (found > largest) largest = found, best = way;
    }
  };
  for (int i = 0; i < 3; ++i) {
    attempt(boxes.a.axis[i]), attempt(boxes.b.axis[i]);
    for (int j = 0; j < 3; ++j) attempt(cross(boxes.a.axis[i], boxes.b.axis[j]));
  }
  return best;
}

enum class Verdict { proved, refuted, in_doubt };

class Judge {
 public:
  Judge(const bc_sweep& a, const bc_sweep& b)
      : a_(a), b_(b), bend_((a_.acceleration() + b_.acceleration()) / 8) {}

  Both at(Real s) const { return {a_.at(s), b_.at(s)}; }

  // Whether the distance is above `target` from s = 0 to before `end`. Refuted: at some time it is below,
  // or the boxes touch; by less than `doubt` it is neither.
  Verdict stays_above(Real target, Real end, Real doubt) const {
    if (end <= 0) return Verdict::proved;
    std::vector<Part> parts{{0, end, at(0), at(end)}};
    bool is_doubtful = false;
    while (!parts.empty()) {
      Part part = parts.back();
      parts.pop_back();
      Real middle = (part.begin + part.end) / 2, width = part.end - part.begin;
      Both here = at(middle);
      auto proves = [&](V n) {
        Real nearer = std::min(gap(part.at_begin, n), gap(part.at_end, n));
        return nearer - bend_ * width * width > target;
      };
      bool is_touching;
      V n = hint(here, is_touching);
      if (!is_touching && proves(n)) continue;
      if (is_touching || !(gap(here, n) > target)) {  // else a shorter interval is proved by it
        Real largest;
        n = separating(here, largest);
        if (proves(n)) continue;
        if (target <= 0 ? largest < target - doubt
                        : largest < target && (largest < 0 || distance(here) < target - doubt))
          return Verdict::refuted;
      }
      if (width < 1e-15L) {
        is_doubtful = true;
        continue;
      }
      parts.push_back({part.begin, middle, part.at_begin, here});
      parts.push_back({middle, part.end, here, part.at_end});
    }
    return is_doubtful ? Verdict::in_doubt : Verdict::proved;
  }

 private:
  struct Part {
    Real begin, end;
    Both at_begin, at_end;
  };

  static V hint(const Both& boxes, bool& is_touching) {
    bc_box pair[2];
    for (int of = 0; of < 2; ++of) {
      const Box& box = of ? boxes.b : boxes.a;
      V centre = box.centre - boxes.a.centre;  // small numbers, also where coordinates are large
      pair[of] = {{{double(centre.x), double(centre.y), double(centre.z)},
                   {double(box.turn.x), double(box.turn.y), double(box.turn.z), double(box.turn.w)}},
                  {{double(2 * box.half[0]), double(2 * box.half[1]), double(2 * box.half[2])}}};
    }
    bc_nearest nearest;
    nearest.size = sizeof nearest;
    bc_distance(&pair[0], &pair[1], &nearest);
    is_touching = nearest.colliding;
    V n{nearest.normal[0], nearest.normal[1], nearest.normal[2]};
    return (1 / norm(n)) * n;
  }

  Moving a_, b_;
  Real bend_;
};

}  // namespace judge
