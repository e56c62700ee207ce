// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Contacts as messages, for ROS nodes that link the library: box_contact_msgs/msg/Contact and back.
#ifndef BOX_CONTACT_CONTACT_MESSAGE_HPP
#define BOX_CONTACT_CONTACT_MESSAGE_HPP

#include <cmath>
#include <string>

#include "box_contact/box_contact.hpp"
#include "box_contact_msgs/msg/contact.hpp"

namespace box_contact {

// Return the contact of a message, to the bit. A message has no axis: it is −1.
inline Contact from_message(const box_contact_msgs::msg::Contact& message) {
  const auto& upper = message.covariance;  // xx xy xz yy yz zz
  Contact contact{};
  contact.colliding = !std::isnan(message.point.x);
  contact.separation = -message.depth;
  contact.normal[0] = message.normal.x, contact.point[0] = message.point.x;
  contact.normal[1] = message.normal.y, contact.point[1] = message.point.y;
  contact.normal[2] = message.normal.z, contact.point[2] = message.point.z;
  contact.volume = message.volume;
  for (int row = 0, number = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column, ++number)
      contact.covariance[row][column] = contact.covariance[column][row] = upper[number];
  contact.axis = -1;
  return contact;
}

// Return the message of the contact of boxes A and B, by the names of the pair and of both.
inline box_contact_msgs::msg::Contact to_message(const Contact& contact, const Box& a, const Box& b,
                                                 const std::string& pair, const std::string& box_a,
                                                 const std::string& box_b) {
  box_contact_msgs::msg::Contact message;
  message.pair = pair, message.box_a = box_a, message.box_b = box_b;
  message.normal.x = contact.normal[0], message.point.x = contact.point[0];
  message.normal.y = contact.normal[1], message.point.y = contact.point[1];
  message.normal.z = contact.normal[2], message.point.z = contact.point[2];
  message.depth = -contact.separation;
  message.volume = contact.volume;
  message.area = contact.colliding ? face_patch(a, b, contact.normal).area : 0.0;
  for (int row = 0, number = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column, ++number)
      message.covariance[number] = contact.covariance[row][column];
  return message;
}

}  // namespace box_contact

#endif  // BOX_CONTACT_CONTACT_MESSAGE_HPP
