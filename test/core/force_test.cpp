// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The loop of force_test.c by the C++ interface, and an advance allocates no memory.
#include "box_contact/force.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "allocations.hpp"

using namespace box_contact;

namespace {

// The rows of what rests, and is not named, are neither read nor written. One that is named wakes. The pair
// is held, or found.
int count_faults_at_rest(bool find_pairs) {
  const Size size{1.0, 1.0, 1.0};
  const Body bodies[] = {Body::of_box(size, 1000.0), Body::of_box(size, 0.0)};
  const BodyBox boxes[] = {{0, {{{0, 0, 0}, {0, 0, 0, 1}}, size}},
                           {1, {{{0, 0, 0}, {0, 0, 0, 1}}, size}}};
  const std::int64_t pair[] = {0, 1}, named[] = {0, 0}, unknown[] = {2};
  Pose poses[] = {{{0.0, 0.0, 1.0}, {0.0, 0.0, 0.0, 1.0}}, {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}};
  Velocity velocities[2] = {};
  Wrench outside[2] = {{{0.0, 0.0, -9810.0}, {}}, {}};
  unsigned char awake[2];
  PatchForces forces(bodies);
  forces.set_boxes(boxes, find_pairs);
  if (!find_pairs) forces.hold(Patches(pair));
  for (int step = 0; step < 1000; ++step)
    forces.advance(0.001, poses, velocities, outside, awake);
  int faults = awake[0] || awake[1];
  const Pose laid = poses[0];
  poses[0].position[2] = NAN;
  const long before = allocations;
  forces.advance_changed({}, 0.001, poses, velocities, outside, awake);
  faults += allocations != before || awake[0] || !std::isnan(poses[0].position[2]);
  if (find_pairs) forces.set_boxes(boxes, true);
  forces.advance_changed({}, 0.001, poses, velocities, outside, awake);
  faults += awake[0] || forces.loads().size() != 1;
  for (Span<const std::int64_t> changed : {Span<const std::int64_t>(named), {unknown}}) {
    try {
      forces.advance_changed(changed, 0.001, poses, velocities, outside);
      ++faults;
    } catch (const std::invalid_argument&) {
    }
  }
  poses[0] = laid;
  outside[0].force[0] = 8000.0;
  forces.advance_changed(named, 0.001, poses, velocities, outside, awake);
  return faults + (!awake[0] || awake[1] || !(velocities[0].linear[0] > 0.0));
}

// Boxes that rest by answers of others wake all at once, after an answer of as many more: there is room.
int count_faults_of_waking() {
  const int half = 20, count = 2 * half + 1;
  std::vector<Body> bodies(count, {12.0, {2.0, 2.0, 2.0}});
  std::vector<Pose> poses(count);
  std::vector<Velocity> velocities(count);
  std::vector<Wrench> outside(count);
  std::vector<unsigned char> awake(count);
  bodies[0] = {0.0, {0.0, 0.0, 0.0}};
  poses[0] = {{0.0, 0.0, -0.5}, {0.0, 0.0, 0.0, 1.0}};
  for (int k = 1; k < count; ++k) {
    poses[size_t(k)] = {{2.0 * k, 0.0, 0.4999}, {0.0, 0.0, 0.0, 1.0}};
    outside[size_t(k)].force[2] = k <= half ? -120.0 : 0.0;
  }
  PatchForces forces(bodies);
  auto hold = [&](int last) {
    std::vector<std::int64_t> pairs;
    std::vector<Contact> found;
    for (int k = 1; k <= last; ++k) {
      const Pose& at = poses[size_t(k)];
      pairs.insert(pairs.end(), {0, k});
      found.push_back(collide({poses[0], {200.0, 200.0, 1.0}}, {at, {1.0, 1.0, 1.0}}));
    }
    std::vector<double> separation, normal, point, volume, covariance;
    for (const Contact& contact : found) {
      separation.push_back(contact.separation);
      volume.push_back(contact.volume);
      normal.insert(normal.end(), contact.normal, contact.normal + 3);
      point.insert(point.end(), contact.point, contact.point + 3);
      covariance.insert(covariance.end(), contact.covariance[0], contact.covariance[0] + 9);
    }
    Results results;
    results.separation = separation.data(), results.normal = normal.data();
    results.point = point.data(), results.volume = volume.data();
    results.covariance = covariance.data();
    forces.hold(Patches(pairs, results), poses);
  };
  for (int step = 0; step < 1000; ++step) {
    hold(half);
    forces.advance(0.001, poses, velocities, outside, awake);
  }
  int faults = awake[1] || awake[half];
  hold(2 * half);
  for (int k = 1; k < count; ++k) outside[size_t(k)].force[0] = 1.0;
  const long before = allocations;
  forces.advance(0.001, poses, velocities, outside, awake);
  return faults + (allocations != before || !awake[1] || !awake[2 * half]);
}

// A load that slides beside boxes that sleep in stacks of two. The forces find all pairs.
class Yard {
 public:
  explicit Yard(int asleep) {
    add({2000.0, 2000.0, 1.0}, 0.0, 0.0, 0.0, -0.5);
    add({1.0, 1.0, 1.0}, 1000.0, -5.0, 0.0, 0.5);
    for (int k = 0; k < asleep; ++k)
      add({1.0, 1.0, 1.0}, 1000.0, 1.1 * (k / 2 % 40), 1.1 * (k / 80), k % 2 + 0.5);
    std::vector<Body> bodies;
    std::vector<BodyBox> boxes;
    for (size_t k = 0; k < sizes_.size(); ++k) {
      bodies.push_back(Body::of_box(sizes_[k], masses_[k]));
      boxes.push_back({std::int64_t(k), {{{0, 0, 0}, {0, 0, 0, 1}}, sizes_[k]}});
      outside_.push_back({{0.0, 0.0, -9.81 * masses_[k]}, {}});
    }
    velocities_.resize(sizes_.size());
    forces_.reset(new PatchForces(bodies));
    forces_->set_boxes(boxes, true);
  }
  // The time of some steps [s].
  double advance(int steps) {
    const auto begin = std::chrono::steady_clock::now();
    for (int step = 0; step < steps; ++step) {
      outside_[1].force[0] = count_++ % 200 < 100 ? 6000.0 : -6000.0;
      forces_->advance_changed({}, 1 / 60.0, poses_, velocities_, outside_);
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

 private:
  void add(const Size& size, double mass, double x, double y, double z) {
    sizes_.push_back(size);
    masses_.push_back(mass);
    poses_.push_back({{x, y, z}, {0, 0, 0, 1}});
  }
  std::vector<Size> sizes_;
  std::vector<double> masses_;
  std::vector<Pose> poses_;
  std::vector<Velocity> velocities_;
  std::vector<Wrench> outside_;
  std::unique_ptr<PatchForces> forces_;
  int count_ = 0;
};

// What sleeps costs next to nothing: a load among 2,000 boxes takes less than three times as long as alone.
int count_faults_of_cost() {
  Yard alone(0), yard(2000);
  alone.advance(200);
  yard.advance(200);
  double least_alone = 1e9, least = 1e9;
  for (int round = 0; round < 20; ++round) {
    least_alone = std::min(least_alone, alone.advance(20));
    least = std::min(least, yard.advance(20));
  }
  if (least > 3.0 * least_alone)
    std::printf("a step among sleepers: %g us, alone %g us\n", 5e4 * least, 5e4 * least_alone);
  return least > 3.0 * least_alone;
}

int count_faults_of_a_body() {
  const Body body = Body::of_box({1.0, 2.0, 3.0}, 12.0);
  return body.mass != 12.0 || body.inertia[0] != 13.0 || body.inertia[1] != 10.0 ||
         body.inertia[2] != 5.0;
}

}  // namespace

int main() {
  const Size size{12.192, 2.438, 2.591};
  const Body bodies[] = {{20000.0, {1e12, 1e12, 1e12}}, {0.0, {0.0, 0.0, 0.0}}};
  PatchForces forces(bodies);
  Pose poses[] = {{{0.3, 0.1, 2.601}, {0.001, 0.002, 0.003, 1.0}},
                  {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}};
  Pose asked[2];
  Velocity velocities[2] = {};
  Wrench outside[2] = {{{0.0, 0.0, -9.81 * 20000.0}, {}}, {}}, wrenches[2];
  Contact contact{};
  const std::int64_t pair[2] = {0, 1};
  int failures = count_faults_of_a_body() + count_faults_at_rest(false) +
                 count_faults_at_rest(true) + count_faults_of_cost() + count_faults_of_waking();
  for (int step = 0; step < 2000; ++step) {
    long before = allocations;
    if (step % 5 == 0) {
      contact = collide({poses[0], size}, {poses[1], size});
      asked[0] = poses[0], asked[1] = poses[1];
    }
    if (step % 5 == 2) {
      Results found;
      found.separation = &contact.separation, found.normal = contact.normal;
      found.point = contact.point, found.volume = &contact.volume;
      found.covariance = contact.covariance[0];
      Patches answer(pair, found);
      answer.age = 0.002;
      forces.hold(answer, asked);
    }
    outside[0].force[0] = step > 1000 ? 40000.0 : 0.0;
    // The last step twice, by a copy: once for the wrenches.
    if (step == 1999) PatchForces(forces).wrenches(0.001, poses, velocities, outside, wrenches);
    forces.advance(0.001, poses, velocities, outside);
    failures += step > 100 && step < 1999 && allocations != before;
  }
  for (double x : poses[0].position) std::printf("%a ", x);
  for (double x : wrenches[0].force) std::printf("%a ", x);
  for (double x : wrenches[0].torque) std::printf("%a ", x);
  failures += allocations == 0;

  PatchForces copy = forces;
  forces.reset();
  Velocity after[2][2];
  int k = 0;
  for (PatchForces* each : {&forces, &copy}) {
    Pose moved[] = {poses[0], poses[1]};
    after[k][0] = velocities[0], after[k][1] = velocities[1];
    each->advance(0.001, moved, after[k++], outside);
  }
  // What has forgotten falls by g·dt. The copy is carried: the box turns slowly about its edge.
  failures += !(after[0][0].linear[2] < -0.009);
  failures += !(after[1][0].linear[2] - velocities[0].linear[2] > -1e-6);
  failures += copy.loads().size() != 1;
  try {
    copy.advance(0.001, {poses, 1}, velocities, outside);
    ++failures;
  } catch (const std::invalid_argument&) {
  }
  const BodyBox boxes[] = {{0, {{{0, 0, 0}, {0, 0, 0, 1}}, size}},
                           {1, {{{0, 0, 0}, {0, 0, 0, 1}}, size}}};
  copy.set_boxes(boxes);
  const std::int64_t half_a_pair[3] = {0, 1, 0};
  try {
    copy.hold(Patches(half_a_pair));
    ++failures;
  } catch (const std::invalid_argument&) {
  }
  copy.hold(Patches(pair));
  copy.set_surface(1, {0.0, 0.0, 0.0});
  copy.set_surface(1, {0.0, 0.0, 0.0}, 0.5);
  const long before = allocations;
  for (int step = 0; step < 10; ++step) copy.advance(0.001, poses, velocities, outside);
  Pose ahead[2];
  copy.ahead(0.001, poses, velocities, ahead);
  failures += allocations != before;
  // By 3/8 of a step of four sub-steps. What is still stays where it is, to the bit.
  failures += !(std::fabs(ahead[0].position[0] - poses[0].position[0] -
                          0.000375 * velocities[0].linear[0]) < 1e-15);
  failures += velocities[0].linear[0] == 0.0;
  failures += std::memcmp(&ahead[1], &poses[1], sizeof(Pose)) != 0;
  PatchForces twin = copy;
  const long copied = allocations;
  for (int step = 0; step < 10; ++step) twin.advance(0.001, poses, velocities, outside);
  failures += allocations != copied;
  failures += !(copy.loads()[0].pressing > 1e5);
  Load loads[1] = {};
  const long before_loads = allocations;
  failures += copy.loads(loads) != 1 || !(loads[0].pressing > 1e5);
  failures += copy.loads({loads, 0}) != 1 || allocations != before_loads;
  try {
    const Patches unnamed(Rows{}, Results{});
    ++failures;
  } catch (const std::invalid_argument&) {
  }
  copy.forget(pair);
  failures += !copy.loads().empty();
  copy.set_boxes({});
  copy.set_bodies({bodies, 1});
  copy.advance(0.001, {poses, 1}, {velocities, 1});
  PatchForces empty{Span<const Body>()};
  empty.hold(Patches(Span<const std::int64_t>()));
  empty.advance(0.001, {}, {});
  std::printf("%d failures\n", failures);
  return failures != 0;
}
