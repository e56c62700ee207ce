// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Jolt with its defaults, by one thread: one collision step, 10 iterations for velocities, 2 for
// positions. It has no sub-steps.
// clang-format off
#include <Jolt/Jolt.h>  // before all others of Jolt
// clang-format on

#include <Jolt/Core/Factory.h>
#include <Jolt/Core/JobSystemSingleThreaded.h>
#include <Jolt/Core/TempAllocator.h>
#include <Jolt/Physics/Body/BodyCreationSettings.h>
#include <Jolt/Physics/Collision/Shape/BoxShape.h>
#include <Jolt/Physics/PhysicsSystem.h>
#include <Jolt/RegisterTypes.h>

#include <memory>

#include "steps.hpp"

namespace {

constexpr JPH::ObjectLayer fixed = 0, moving = 1;
constexpr unsigned most_bodies = 16'384, most_pairs = 131'072;

struct Layers final : JPH::BroadPhaseLayerInterface {
  JPH::uint GetNumBroadPhaseLayers() const override { return 2; }
  JPH::BroadPhaseLayer GetBroadPhaseLayer(JPH::ObjectLayer layer) const override {
    return JPH::BroadPhaseLayer(JPH::BroadPhaseLayer::Type(layer));
  }
};

struct OfLayer final : JPH::ObjectVsBroadPhaseLayerFilter {
  bool ShouldCollide(JPH::ObjectLayer one, JPH::BroadPhaseLayer other) const override {
    return one == moving || other == JPH::BroadPhaseLayer(moving);
  }
};

struct OfObjects final : JPH::ObjectLayerPairFilter {
  bool ShouldCollide(JPH::ObjectLayer one, JPH::ObjectLayer other) const override {
    return one == moving || other == moving;
  }
};

class World {
 public:
  explicit World(const Scene& scene) : step_(float(scene.step)) {
    system_.Init(most_bodies, 0, most_pairs, most_pairs, layers_, of_layer_, of_objects_);
    system_.SetGravity(JPH::Vec3(0.0f, 0.0f, -float(scene.gravity)));
    JPH::PhysicsSettings settings = system_.GetPhysicsSettings();
    settings.mAllowSleeping = scene.sleep;
    system_.SetPhysicsSettings(settings);
    for (const Box& box : scene.boxes) {
      const double *size = box.size, *p = box.position, *q = box.quaternion;
      bool is_fixed = box.mass == 0.0;
      JPH::BodyCreationSettings body(
          new JPH::BoxShape(JPH::Vec3(float(size[0] / 2), float(size[1] / 2), float(size[2] / 2))),
          JPH::RVec3(float(p[0]), float(p[1]), float(p[2])),
          JPH::Quat(float(q[0]), float(q[1]), float(q[2]), float(q[3])),
          is_fixed ? JPH::EMotionType::Static : JPH::EMotionType::Dynamic,
          is_fixed ? fixed : moving);
      body.mFriction = float(scene.friction);
      body.mOverrideMassProperties = JPH::EOverrideMassProperties::CalculateInertia;
      body.mMassPropertiesOverride.mMass = float(box.mass);
      bodies_.push_back(system_.GetBodyInterface().CreateAndAddBody(
          body, is_fixed ? JPH::EActivation::DontActivate : JPH::EActivation::Activate));
    }
    system_.OptimizeBroadPhase();
  }

  void step() { system_.Update(step_, 1, &memory_, &jobs_); }
  int awake() const { return int(system_.GetNumActiveBodies(JPH::EBodyType::RigidBody)); }
  Pose pose(size_t k) const {
    JPH::RVec3 p;
    JPH::Quat q;
    system_.GetBodyInterface().GetPositionAndRotation(bodies_[k], p, q);
    return {{p.GetX(), p.GetY(), p.GetZ()}, {q.GetX(), q.GetY(), q.GetZ(), q.GetW()}};
  }

 private:
  float step_;
  Layers layers_;
  OfLayer of_layer_;
  OfObjects of_objects_;
  JPH::TempAllocatorImplWithMallocFallback memory_{256 << 20};
  JPH::JobSystemSingleThreaded jobs_{JPH::cMaxPhysicsJobs};
  JPH::PhysicsSystem system_;
  std::vector<JPH::BodyID> bodies_;
};

}  // namespace

int main(int count, char** arguments) {
  JPH::RegisterDefaultAllocator();
  JPH::Factory::sInstance = new JPH::Factory();
  JPH::RegisterTypes();
  return run<World>(SOURCE, count, arguments);
}
