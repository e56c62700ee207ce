// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Print a contact that went through its message and came back.
#include <cstdio>
#include <cstring>

#include "box_contact/box_contact.hpp"
#include "box_contact/contact_message.hpp"

int main() {
  const box_contact::Size container{12.192, 2.438, 2.591};
  const box_contact::Box load{{{0.5, 0.25, 2.581}, {0, 0, 0, 1}}, container};
  const box_contact::Box stack{{{0, 0, 0}, {0, 0, 0, 1}}, container};
  box_contact::Contact contact = box_contact::collide(load, stack);
  const auto message = box_contact::to_message(contact, load, stack, "landing", "load", "stack");
  const box_contact::Contact again = box_contact::from_message(message);
  contact.axis = again.axis;  // which a message has not
  const bool same = again.colliding == contact.colliding &&
                    again.separation == contact.separation && again.volume == contact.volume &&
                    !std::memcmp(again.point, contact.point, sizeof again.point) &&
                    !std::memcmp(again.normal, contact.normal, sizeof again.normal) &&
                    !std::memcmp(again.covariance, contact.covariance, sizeof again.covariance);
  std::printf("%s: %.3f m deep, %.2f m2, %s\n", message.pair.c_str(), message.depth, message.area,
              same ? "the same" : "another");
}
