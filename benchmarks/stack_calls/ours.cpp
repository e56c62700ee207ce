// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// PatchForces, which find their pairs, and are told that nothing changed beside what they moved. The first
// argument is `most_depth` [m].
#include <numeric>

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
      auto [px, py, pz] = box.position;
      auto [qx, qy, qz, qw] = box.quaternion;
      bodies.push_back(bc::Body::of_box({x, y, z}, box.mass));
      poses_.push_back({{px, py, pz}, {qx, qy, qz, qw}});
      boxes.push_back({std::int64_t(boxes.size()), {{{0, 0, 0}, {0, 0, 0, 1}}, {x, y, z}}});
      weights_.push_back({{0, 0, -scene.gravity * box.mass}, {0, 0, 0}});
    }
    velocities_.resize(count_);
    awake_.assign(count_, 1);
    bc::PatchForces::Options options;
    options.substeps = scene.substeps;
    options.friction = scene.friction;
    options.rest = scene.sleep;
    options.most_depth = most_depth;
    forces_ = std::make_unique<bc::PatchForces>(bodies, options);
    forces_->set_boxes(boxes, true);
  }
  void step() { forces_->advance_changed({}, step_, poses_, velocities_, weights_, awake_); }
  int awake() const { return std::accumulate(awake_.begin(), awake_.end(), 0); }
  Pose pose(size_t k) const {
    const auto& [p, q] = poses_[k];
    return {{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
  }

 private:
  double step_;
  size_t count_;
  std::vector<unsigned char> awake_;
  std::vector<bc::Pose> poses_;
  std::vector<bc::Velocity> velocities_;
  std::vector<bc::Wrench> weights_;
  std::unique_ptr<bc::PatchForces> forces_;
};

}  // namespace

int main(int count, char** arguments) {
  most_depth = count > 1 ? std::atof(arguments[1]) : 0.0;
  return run<World>("libbox_contact", count - 1, arguments + 1);
}
