// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Bullet through its C++ interface: its detector of two boxes alone, a query of its world, which takes
// boxes as convex shapes, and its GJK for two boxes. All margins are 0.
#include <BulletCollision/CollisionDispatch/btBoxBoxDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>
#include <btBulletCollisionCommon.h>

#include <algorithm>

#include "contestants.hpp"

namespace {

struct Points : btDiscreteCollisionDetectorInterface::Result {
  double deepest = APART;
  void setShapeIdentifiersA(int, int) override {}
  void setShapeIdentifiersB(int, int) override {}
  void addContactPoint(const btVector3&, const btVector3&, btScalar distance) override {
    deepest = std::min(deepest, double(distance));
  }
};

struct Contacts : btCollisionWorld::ContactResultCallback {
  double deepest = APART;
  btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                           const btCollisionObjectWrapper*, int, int) override {
    deepest = std::min(deepest, double(point.getDistance()));
    return 0;
  }
};

struct World {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btCollisionWorld world{&dispatcher, &broadphase, &configuration};
  btCollisionObject object_a, object_b;
  std::vector<btBoxShape> shape_a, shape_b;
  std::vector<btTransform> at_a, at_b;
  btVoronoiSimplexSolver simplex;
  double answered = APART;  // depth or distance

  explicit World(const Poses& poses) {
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
    for (const PlacedBox& box : poses.placed_a) add(box, shape_a, at_a);
    for (const PlacedBox& box : poses.placed_b) add(box, shape_b, at_b);
  }
};

void add_contacts(World& w, size_t calls, Contestants& all) {
  auto read = [&w] { return w.answered; };
  auto detect = [&w](size_t i) {
    // contact: Bullet btBoxBoxDetector
    btDiscreteCollisionDetectorInterface::ClosestPointInput input;
    input.m_transformA = w.at_a[i];
    input.m_transformB = w.at_b[i];
    Points points;
    btBoxBoxDetector(&w.shape_a[i], &w.shape_b[i]).getClosestPoints(input, points, nullptr);
    // end of call
    return w.answered = points.deepest, points.deepest < APART;
  };
  all.push_back(single("Bullet btBoxBoxDetector", calls, detect, read));
  auto query = [&w](size_t i) {
    // contact: Bullet contactPairTest
    w.object_a.setCollisionShape(&w.shape_a[i]);
    w.object_b.setCollisionShape(&w.shape_b[i]);
    w.object_a.setWorldTransform(w.at_a[i]);
    w.object_b.setWorldTransform(w.at_b[i]);
    Contacts contacts;
    w.world.contactPairTest(&w.object_a, &w.object_b, contacts);
    // end of call
    return w.answered = contacts.deepest, contacts.deepest < APART;
  };
  all.push_back(single("Bullet contactPairTest", calls, query, read));
}

void add_distance(World& w, size_t calls, Contestants& all) {
  auto distance = [&w](size_t i) {
    // distance: Bullet btGjkPairDetector
    btGjkPairDetector::ClosestPointInput input;
    input.m_transformA = w.at_a[i];
    input.m_transformB = w.at_b[i];
    btPointCollector nearest;
    btGjkPairDetector gjk(&w.shape_a[i], &w.shape_b[i], &w.simplex, nullptr);
    gjk.getClosestPoints(input, nearest, nullptr);
    // end of call
    return w.answered = nearest.m_hasResult ? double(nearest.m_distance) : 0.0;
  };
  all.push_back(single("Bullet btGjkPairDetector", calls, distance, [&w] { return w.answered; }));
}

}  // namespace

void add_bullet(Query query, const Poses& poses, size_t calls, Contestants& all) {
  World& world = *new World(poses);
  (query == Query::contact ? add_contacts : add_distance)(world, calls, all);
}
