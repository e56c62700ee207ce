// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Ask a contact node a question by its service ~/check. Start box_contact_contact_node first. It
// prints:
//
//   load_stack: 10.0 mm deep, 0.297 m3
#include <cstdio>

#include "box_contact/contact_message.hpp"
#include "box_contact_msgs/srv/check.hpp"
#include "rclcpp/rclcpp.hpp"

using box_contact_msgs::srv::Check;

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  const auto node = rclcpp::Node::make_shared("check_client");
  const auto client = node->create_client<Check>("contact_node/check",
                                                 rclcpp::ServicesQoS().keep_last(128));
  RCLCPP_INFO(node->get_logger(), "waits for a contact node");
  if (!client->wait_for_service()) return 1;  // Ctrl-C

  const auto request = std::make_shared<Check::Request>();
  request->boxes.resize(2);  // two 40 ft containers; a new pose is upright, at the origin
  for (auto& box : request->boxes) box.size.x = 12.192, box.size.y = 2.438, box.size.z = 2.591;
  request->boxes[0].name = "load", request->boxes[0].pose.position.z = 2.581;
  request->boxes[1].name = "stack";

  auto future = client->async_send_request(request);
  if (rclcpp::spin_until_future_complete(node, future) != rclcpp::FutureReturnCode::SUCCESS)
    return 1;
  const auto answer = future.get();  // owns the contacts below
  if (!answer->success) {
    RCLCPP_ERROR(node->get_logger(), "%s", answer->message.c_str());
    return 1;
  }
  for (const auto& message : answer->contacts.contacts) {
    const box_contact::Contact contact = box_contact::from_message(message);
    std::printf("%s: %.1f mm deep, %.3f m3\n", message.pair.c_str(), -1e3 * contact.separation,
                contact.volume);
  }
  rclcpp::shutdown();
}
