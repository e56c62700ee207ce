// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Lower a container on another one, and print the contact.
#include <cstdio>
#include <stdexcept>

#include "box_contact/box_contact.hpp"

int main() {
  // Two 40 ft containers: full extents along x, y, z [m].
  const box_contact::Size container{12.192, 2.438, 2.591};

  // B stands at the origin. A comes down on it, turned by 2 · asin(0.02) about the vertical axis.
  box_contact::Box a{{{0.5, 0.1, 2.6}, {0.0, 0.0, 0.02, 0.9998}}, container};
  const box_contact::Box b{{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}, container};
  for (double height : {2.6, 2.59}) {
    a.pose.position[2] = height;
    const box_contact::Contact contact = box_contact::collide(a, b);
    if (!contact.colliding) {
      std::printf("height %.3f m: no contact, gap %.3f m\n", height, contact.separation);
      continue;
    }
    std::printf(
        "height %.3f m: contact, depth %.3f m, normal (%.3f, %.3f, %.3f), "
        "point (%.3f, %.3f, %.3f) m\n",
        height, -contact.separation, contact.normal[0], contact.normal[1], contact.normal[2],
        contact.point[0], contact.point[1], contact.point[2]);
  }

  // Rows of poses are solved some at a time, into your arrays. What has no array is not computed.
  const box_contact::Pose poses_a[2] = {{{0, 0, 2.59}, {0, 0, 0, 1}}, {{0, 2.5, 0}, {0, 0, 0, 1}}};
  const box_contact::Pose poses_b[2] = {b.pose, b.pose};
  const box_contact::Size sizes[1] = {container};
  bool colliding[2];
  double volume[2];
  box_contact::Results results;
  results.colliding = colliding;
  results.volume = volume;
  const std::int64_t refused = box_contact::collide({poses_a, poses_b, sizes, sizes}, results);
  std::printf("batch: %d %d, volumes %.3f %.3f m3, first refused row %d\n", colliding[0],
              colliding[1], volume[0], volume[1], int(refused));

  try {
    a.pose.quaternion[2] = a.pose.quaternion[3] = 0.0;
    box_contact::collide(a, b);
  } catch (const std::invalid_argument& error) {
    std::printf("refused: %s\n", error.what());
  }
}
