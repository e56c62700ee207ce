// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// PatchForces with contacts of its own, and the broad phase at each step. Both are told what changed: to
// the broad phase that is what is awake, to the forces nothing. The first argument is `most_depth` [m].
#include <numeric>

#include "box_contact/broad_phase.h"
#include "box_contact/force.hpp"
#include "steps.hpp"

namespace {

namespace bc = box_contact;

double most_depth;

class World {
 public:
  explicit World(const Scene& scene) : step_(scene.step), count_(scene.boxes.size()) {
    std::vector<bc::Body> bodies;
    std::vector<bc::BodyBox> boxes;
    for (const Box& box : scene.boxes) {
      auto [x, y, z] = box.size;
      double m = box.mass / 12.0;
      auto [px, py, pz] = box.position;
      auto [qx, qy, qz, qw] = box.quaternion;
      bodies.push_back({box.mass, {m * (y * y + z * z), m * (z * z + x * x), m * (x * x + y * y)}});
      sizes_.push_back({x, y, z});
      fixed_.push_back(box.mass == 0.0);
      poses_.push_back({{px, py, pz}, {qx, qy, qz, qw}});
      boxes.push_back({std::int64_t(boxes.size()), {{{0, 0, 0}, {0, 0, 0, 1}}, sizes_.back()}});
      weights_.push_back({{0, 0, -scene.gravity * box.mass}, {0, 0, 0}});
    }
    velocities_.resize(count_);
    awake_.assign(count_, 1);
    moved_.reserve(count_);
    bc::PatchForces::Options options;
    options.substeps = scene.substeps;
    options.friction = scene.friction;
    options.rest = scene.sleep;
    options.most_depth = most_depth;
    forces_ = std::make_unique<bc::PatchForces>(bodies, options);
    forces_->set_boxes(boxes);
    bc_boxes asked{};
    asked.size = sizeof asked;
    asked.count = std::int64_t(count_);
    asked.sizes = sizes_.data();
    asked.fixed = reinterpret_cast<const bool*>(fixed_.data());
    asked.margin = 2.0 * scene.gravity * scene.step * scene.step;  // what PatchForces looks at
    bc::detail::check(bc_broad_phase_create(&asked, &broad_phase_));
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World() { bc_broad_phase_destroy(broad_phase_); }

  void step() {
    bc_near near{};
    near.size = sizeof near;
    moved_.clear();
    for (size_t k = 0; k < count_; ++k)
      if (awake_[k]) moved_.push_back(std::int64_t(k));
    bc::detail::check(bc_broad_phase_find_changed(broad_phase_, poses_.data(), moved_.data(),
                                                  std::int64_t(moved_.size()), INT64_MAX, &near));
    forces_->hold(bc::Patches(bc::Span<const std::int64_t>(near.pairs, size_t(2 * near.count))));
    forces_->advance_changed({}, step_, poses_, velocities_, weights_, awake_);
  }
  int awake() const { return std::accumulate(awake_.begin(), awake_.end(), 0); }
  Pose pose(size_t k) const {
    const auto& [p, q] = poses_[k];
    return {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
  }

 private:
  double step_;
  size_t count_;
  std::vector<bc::Size> sizes_;
  std::vector<unsigned char> fixed_, awake_;
  std::vector<std::int64_t> moved_;
  std::vector<bc::Pose> poses_;
  std::vector<bc::Velocity> velocities_;
  std::vector<bc::Wrench> weights_;
  std::unique_ptr<bc::PatchForces> forces_;
  bc_broad_phase* broad_phase_ = nullptr;
};

}  // namespace

int main(int count, char** arguments) {
  most_depth = count > 1 ? std::atof(arguments[1]) : 0.0;
  return run<World>("libbox_contact", count - 1, arguments + 1);
}
