// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Ask a contact node what touches, by its service ~/check, and what a path meets, by ~/check_path.
// Start box_contact_contact_node first. It prints:
//
//   load_stack: 10.0 mm deep, 0.297 m3
//   load_stack: met 7.409 m further down
#include <cstdio>

#include "box_contact/contact_message.hpp"
#include "box_contact_msgs/srv/check.hpp"
#include "box_contact_msgs/srv/check_path.hpp"
#include "rclcpp/rclcpp.hpp"

using box_contact_msgs::srv::Check;
using box_contact_msgs::srv::CheckPath;

// Return the answer to a request, or nullptr without one.
template <class Service>
typename Service::Response::SharedPtr ask(const rclcpp::Node::SharedPtr& node, const char* name,
                                          typename Service::Request::SharedPtr request) {
  const auto client = node->create_client<Service>(name, rclcpp::ServicesQoS().keep_last(128));
  RCLCPP_INFO(node->get_logger(), "waits for %s", name);
  if (!client->wait_for_service()) return nullptr;  // Ctrl-C
  auto future = client->async_send_request(request);
  if (rclcpp::spin_until_future_complete(node, future) != rclcpp::FutureReturnCode::SUCCESS)
    return nullptr;
  const auto answer = future.get();
  if (answer->success) return answer;
  RCLCPP_ERROR(node->get_logger(), "%s", answer->message.c_str());
  return nullptr;
}

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  const auto node = rclcpp::Node::make_shared("check_client");

  const auto request = std::make_shared<Check::Request>();
  request->boxes.resize(2);  // two 40 ft containers; a new pose is upright, at the origin
  for (auto& box : request->boxes) box.size.x = 12.192, box.size.y = 2.438, box.size.z = 2.591;
  request->boxes[0].name = "load", request->boxes[0].pose.position.z = 2.581;
  request->boxes[1].name = "stack";
  const auto answer = ask<Check>(node, "contact_node/check", request);  // owns the contacts below
  if (!answer) return 1;
  for (const auto& message : answer->contacts.contacts) {
    const box_contact::Contact contact = box_contact::from_message(message);
    std::printf("%s: %.1f mm deep, %.3f m3\n", message.pair.c_str(), -1e3 * contact.separation,
                contact.volume);
  }

  const auto path = std::make_shared<CheckPath::Request>();
  path->boxes = request->boxes;
  for (const double z : {10.0, 0.0}) {  // the load goes straight down
    auto& waypoint = path->waypoints.emplace_back();
    waypoint.joint_names = {"load", "stack"};
    waypoint.transforms.resize(2);
    waypoint.transforms[0].translation.z = z;
  }
  const auto way = ask<CheckPath>(node, "contact_node/check_path", path);
  if (!way) return 1;
  for (const auto& impact : way->impacts)
    std::printf("%s: met %.3f m further down\n", impact.near.pair.c_str(), 10.0 * impact.time);
  rclcpp::shutdown();
}
