// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What is known of a pair of boxes that touch: the patch of an answer, the impulses that it gave last, and
// what it carried.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "../../include/box_contact/force.h"
#include "../faces/face_patch.hpp"
#include "rectangle.hpp"
#include "rigid_body.hpp"
#include "tuning.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

using namespace faces;

// How long a box is along a direction [m].
inline double extent_along(const Placed& box, const bc_size& size, const Vec<double>& direction) {
  double sum = 0.0;
  for (int k = 0; k < 3; ++k)
    sum += size.extent[k] * std::fabs(dot(column(box.axes, k), direction));
  return sum;
}

// How far two boxes overlap along a direction [m]; below 0: they are apart.
inline double overlap_along(const Placed& a, const bc_size& size_a, const Placed& b, const bc_size& size_b,
                            const Vec<double>& direction) {
  return 0.5 * (extent_along(a, size_a, direction) + extent_along(b, size_b, direction)) -
         std::fabs(dot(b.position - a.position, direction));
}

// Visit the normals of the faces that are across one: of each box the two least along it.
template <class Visit>
void each_face_across(const Placed& a, const Placed& b, const Vec<double>& normal, const Visit& visit) {
  for (const Placed* box : {&a, &b})
    for (int k = 1, along = axis_along(box->axes, normal); k < 3; ++k)
      visit(column(box->axes, (along + k) % 3));
}

inline Span span_along(const Face& face, const Vec<double>& axis) {
  double middle = dot(face.centre, axis);
  double half = std::fabs(dot(face.half_1, axis)) + std::fabs(dot(face.half_2, axis));
  return {middle - half, middle + half};
}

// The faces by which two boxes meet, from the point of their patch: how far both reach along its axes. Where
// it is narrow, also the gap between them, gap + slope · place.
struct FacePair {
  Span span_1, span_2;
  double gap;
  Point slope;

  static bool is_narrow(const Span& face, const Span& patch) {
    return patch.high - patch.low < wide * (face.high - face.low);
  }
  bool is_narrow_1(const Rectangle& shape) const { return is_narrow(span_1, shape.span_1); }
  bool is_narrow_2(const Rectangle& shape) const { return is_narrow(span_2, shape.span_2); }
};

// The boxes of a pair, the lower first.
using BoxPair = std::pair<int32_t, int32_t>;

// The impulses that a patch gave in its last window: in the last step, and before it if that was short.
template <class T>
struct Kept {
  T window;                                  // [s]
  T normal_impulse, torsion_impulse;         // N [N s], m [N m s]
  Vec<T> friction_impulse, rocking_impulse;  // f [N s], τ [N m s]
  Vec<T> impulse_arm;                        // from A's centre of mass to where they acted [m]
  T pressure;                                // what pressed lately [N s]
  Vec<T> pressure_arm;                       // from A's centre of mass to its centre [m]
};

// Friction that is not told [1].
constexpr double no_friction = -1.0;

// How the surface of a box moves beside its body, as of a belt [m/s], and its own friction [1].
struct Surface {
  Vec<double> velocity{0.0, 0.0, 0.0};
  double friction = no_friction;
};
using Surfaces = std::vector<Surface>;  // of all boxes; none: nothing was told of any

// The velocity of the higher box of a pair relative to the lower one, with what an answer tells of it.
inline Vec<double> surface_of(const Surfaces& surfaces, const BoxPair& pair,
                              const Vec<double>& told) {
  if (surfaces.empty()) return told;
  return told + (surfaces[size_t(pair.second)].velocity - surfaces[size_t(pair.first)].velocity);
}
// The friction of a pair: what is told of it, or else the lesser of both boxes.
inline double friction_of(const Surfaces& surfaces, const BoxPair& pair, double told,
                          double otherwise) {
  if (told != no_friction) return told;
  auto own = [&](int32_t box) {
    double friction = surfaces.empty() ? no_friction : surfaces[size_t(box)].friction;
    return friction == no_friction ? otherwise : friction;
  };
  return std::min(own(pair.first), own(pair.second));
}

// The patch of a pair, where it was asked for, and what it gave.
struct Patch {
  int32_t box_a, box_b;  // box_a < box_b
  int32_t a, b;          // their bodies
  Placed asked_a, asked_b;
  Vec<double> normal, point;
  Rectangle shape;
  FacePair faces;       // without sizes: none
  double overlap, beside;  // of the boxes along the normal, and least along faces across it; without sizes: none [m]
  double most_depth;    // by the thinner box; without sizes: any [m]
  double depth;         // the lesser of volume / area and −separation; below 0: apart [m]
  double friction;      // μ [1]
  Vec<double> surface;  // velocity of B's surface relative to A's, beside the bodies' own [m/s]
  double late;          // from the question to the answer [s]
  double age;           // since the answer came [s]

  double force;    // pressing: mean of the last advance [N]
  double lasting;  // what of it lasts: a part of an impact is not that [N]
  Kept<double> kept;

  BoxPair pair() const { return {box_a, box_b}; }

  // Keep what it gave, of the same pair before.
  void keep(const Patch& before) {
    force = before.force;
    lasting = before.lasting;
    kept = before.kept;
  }
  // Keep the impulses of a window that is longer by a factor.
  void scale(double factor) {
    for (double* each : {&kept.window, &kept.normal_impulse, &kept.torsion_impulse})
      *each *= factor;
    for (Vec<double>* each : {&kept.friction_impulse, &kept.rocking_impulse})
      *each = factor * *each;
  }

  // Take the geometry of a contact, whose boxes are where the bodies are. box_axes: see rectangle_of.
  void place(const Placed& at_a, const Placed& at_b, const Vec<double>& from_a, const double* at,
             const double* covariance, double volume, double separation,
             const Mat<double>& box_axes) {
    asked_a = at_a;
    asked_b = at_b;
    normal = from_a;
    point = vector_at(at);
    shape = rectangle_of(normal, covariance, box_axes);
    most_depth = place_max;
    // Of the mere touch on a large floor, whose volume is that of a box pressed in to 1e-9 of the size.
    depth = std::min(volume / (4.0 * shape.half_1 * shape.half_2), -separation);
  }

  // Nothing presses beyond the rim of a face. The rectangle of a wedge reaches there: a box would
  // tip late, and one whose middle is beyond an edge would stay.
  void end_at_rim(const Placed& box_at_a, const bc_size& size_a, const Placed& box_at_b,
                  const bc_size& size_b) {
    most_depth = deepest_part * std::min(extent_along(box_at_a, size_a, normal),
                                         extent_along(box_at_b, size_b, normal));
    overlap = overlap_along(box_at_a, size_a, box_at_b, size_b, normal);
    beside = place_max;
    each_face_across(box_at_a, box_at_b, normal, [&](const Vec<double>& face) {
      beside = std::min(beside, overlap_along(box_at_a, size_a, box_at_b, size_b, face));
    });
    Face a = face_along(box_at_a, size_a, point, normal),
         b = face_along(box_at_b, size_b, point, -normal);
    faces = {span_along(a, shape.axis_1).within(span_along(b, shape.axis_1)),
             span_along(a, shape.axis_2).within(span_along(b, shape.axis_2)),
             0.0,
             {0.0, 0.0}};
    shape.span_1 = shape.span_1.within(faces.span_1);
    shape.span_2 = shape.span_2.within(faces.span_2);
    if (!faces.is_narrow_1(shape) && !faces.is_narrow_2(shape)) return;
    auto flat = [&](const Vec<double>& v) {
      return Point{dot(v, shape.axis_1), dot(v, shape.axis_2)};
    };
    Plane of_a = plane_of(a, normal, flat), of_b = plane_of(b, normal, flat);
    faces.gap = of_b.height - of_a.height;
    faces.slope = of_b.slope - of_a.slope;
  }

  // Whether area and depth are numbers: what no limit of an answer alone makes sure of.
  bool has_area() const { return shape.has_area() && std::fabs(depth) <= place_max; }
};

// Whether a patch of two boxes alike is a face of B's: the lighter body's, which is more often the smaller.
inline bool is_lighter_b(const std::vector<Body>& bodies, const Patch& patch) {
  return bodies[size_t(patch.a)].inverse_mass < bodies[size_t(patch.b)].inverse_mass;
}

// What a patch carried in the last advance: the sums of its impulses after relaxation.
struct Load {
  int32_t box_a, box_b;
  Vec<double> normal_impulses, friction_impulses;  // N, τ1, τ2 and f1, f2, m / r [N s], [N m s]
  Vec<double> normal, point;
  Rectangle shape;
  bool is_too_deep;
  double time;  // of that advance [s]

  BoxPair pair() const { return {box_a, box_b}; }

  // Mean forces. Pressure is bilinear, so that no corner pulls.
  bc_load mean() const {
    bc_load load{};
    load.box_a = box_a;
    load.box_b = box_b;
    double pressing = normal_impulses[0];
    if (!(pressing > 0.0)) return load;
    Vec<double> friction =
        (1.0 / time) * (friction_impulses[0] * shape.axis_1 + friction_impulses[1] * shape.axis_2);
    // A force N·n at x·e1 + y·e2 has the moment N·(y·e1 − x·e2).
    double x = -normal_impulses[2] / pressing, y = normal_impulses[1] / pressing;
    Vec<double> centre = point + (x * shape.axis_1 + y * shape.axis_2);
    load.pressing = pressing / time;
    load.is_too_deep = is_too_deep;
    load.torsion = shape.radius * friction_impulses[2] / time;
    for (int i = 0; i < 3; ++i) load.friction[i] = friction[i], load.centre[i] = centre[i];
    constexpr double sides[4][2] = {{1.0, 1.0}, {1.0, -1.0}, {-1.0, -1.0}, {-1.0, 1.0}};
    for (int k = 0; k < 4; ++k) {
      double along_1 = sides[k][0] * shape.half_1, along_2 = sides[k][1] * shape.half_2;
      Vec<double> corner = point + (along_1 * shape.axis_1 + along_2 * shape.axis_2);
      for (int i = 0; i < 3; ++i) load.corners[k][i] = corner[i];
      load.corner_loads[k] = 0.25 * load.pressing * std::max(0.0, 1.0 + x / along_1) *
                             std::max(0.0, 1.0 + y / along_2);
    }
    return load;
  }
};

// The order of patches and of loads.
struct ByPair {
  template <class P, class Q>
  bool operator()(const P& p, const Q& q) const {
    return p.pair() < q.pair();
  }
};
// Merge copies of rows into others, where `goes(place)`. Both are by pair, and there is room.
template <class Row, class Goes>
void merge_rows(const std::vector<Row>& from, std::vector<Row>& to, const Goes& goes) {
  size_t count = 0, old = to.size();
  for (size_t k = 0; k < from.size(); ++k) count += goes(k);
  size_t end = old + count;
  to.resize(end);
  for (size_t k = from.size(); end > old && k-- > 0;) {
    if (!goes(k)) continue;
    while (old > 0 && from[k].pair() < to[old - 1].pair()) to[--end] = to[--old];
    to[--end] = from[k];
  }
}
template <class Row, class Goes>
void drop_rows(std::vector<Row>& rows, const Goes& goes) {
  size_t kept = 0;
  for (size_t k = 0; k < rows.size(); ++k)
    if (!goes(k)) rows[kept++] = rows[k];
  rows.resize(kept);
}

// The patch of a pair among those that are by pair, or null.
inline const Patch* find(const std::vector<Patch>& patches, const BoxPair& pair) {
  auto before = [](const Patch& patch, const BoxPair& other) { return patch.pair() < other; };
  auto found = std::lower_bound(patches.begin(), patches.end(), pair, before);
  return found != patches.end() && found->pair() == pair ? &*found : nullptr;
}

template <class Numbers>
bool have_same_bits(const Numbers& p, const Numbers& q) {
  return std::memcmp(&p, &q, sizeof p) == 0;
}

}  // namespace box_contact::BOX_CONTACT_SET::force
