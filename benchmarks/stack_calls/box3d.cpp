// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Box3D with its defaults, by one worker.
#include "box3d/box3d.h"

#include "steps.hpp"

namespace {

b3Vec3 vector(const double* v) { return {float(v[0]), float(v[1]), float(v[2])}; }

class World {
 public:
  explicit World(const Scene& scene) : step_(float(scene.step)), substeps_(scene.substeps) {
    b3WorldDef definition = b3DefaultWorldDef();
    definition.gravity = {0.0f, 0.0f, -float(scene.gravity)};
    definition.enableSleep = scene.sleep;
    definition.workerCount = 1;
    world_ = b3CreateWorld(&definition);
    for (const Box& box : scene.boxes) {
      const double *size = box.size, *q = box.quaternion;
      b3BodyDef body = b3DefaultBodyDef();
      body.type = box.mass > 0.0 ? b3_dynamicBody : b3_staticBody;
      body.position = vector(box.position);
      body.rotation = {vector(q), float(q[3])};
      bodies_.push_back(b3CreateBody(world_, &body));
      b3ShapeDef shape = b3DefaultShapeDef();
      shape.density = float(box.mass / (size[0] * size[1] * size[2]));
      shape.baseMaterial.friction = float(scene.friction);
      b3BoxHull hull = b3MakeBoxHull(float(size[0] / 2), float(size[1] / 2), float(size[2] / 2));
      b3CreateHullShape(bodies_.back(), &shape, &hull.base);
    }
  }

  void step() { b3World_Step(world_, step_, substeps_); }
  int awake() const { return b3World_GetAwakeBodyCount(world_); }
  Pose pose(size_t k) const {
    b3Pos p = b3Body_GetPosition(bodies_[k]);
    b3Quat q = b3Body_GetRotation(bodies_[k]);
    return {{p.x, p.y, p.z}, {q.v.x, q.v.y, q.v.z, q.s}};
  }

 private:
  float step_;
  int substeps_;
  b3WorldId world_;
  std::vector<b3BodyId> bodies_;
};

}  // namespace

int main(int count, char** arguments) { return run<World>(SOURCE, count, arguments); }
