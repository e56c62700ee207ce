// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bullet through its C++ interface: its GJK for two boxes, with a margin of 0.
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>
#include <btBulletCollisionCommon.h>

#include "../native_calls/contestants.hpp"

namespace {

struct Shapes {
  std::vector<btBoxShape> a, b;
  std::vector<btTransform> at_a, at_b;
  btVoronoiSimplexSolver simplex;
  double distance = APART;

  explicit Shapes(const Poses& poses) {
    auto add = [](const PlacedBox& box, std::vector<btBoxShape>& shapes,
                  std::vector<btTransform>& at) {
      auto f = [](double value) { return btScalar(value); };
      const double *m = box.matrix, *p = box.position, *h = box.half;
      at.emplace_back(btMatrix3x3(f(m[0]), f(m[1]), f(m[2]), f(m[3]), f(m[4]), f(m[5]), f(m[6]),
                                  f(m[7]), f(m[8])),
                      btVector3(f(p[0]), f(p[1]), f(p[2])));
      shapes.emplace_back(btVector3(f(h[0]), f(h[1]), f(h[2])));
      shapes.back().setMargin(0);  // edges and corners are rounded by the margin
    };
    for (const PlacedBox& box : poses.placed_a) add(box, a, at_a);
    for (const PlacedBox& box : poses.placed_b) add(box, b, at_b);
  }
};

}  // namespace

void add_bullet(const Poses& poses, size_t calls, Contestants& all) {
  Shapes& s = *new Shapes(poses);
  auto distance = [&s](size_t i) {
    // call: Bullet btGjkPairDetector
    btGjkPairDetector::ClosestPointInput input;
    input.m_transformA = s.at_a[i];
    input.m_transformB = s.at_b[i];
    btPointCollector nearest;
    btGjkPairDetector gjk(&s.a[i], &s.b[i], &s.simplex, nullptr);
    gjk.getClosestPoints(input, nearest, nullptr);
    // end of call
    return s.distance = nearest.m_hasResult ? double(nearest.m_distance) : 0.0;
  };
  all.push_back(single("Bullet btGjkPairDetector", calls, distance, [&s] { return s.distance; }));
}
