// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A component that answers in your own process, without the contact node: it publishes the contacts
// of two 40 ft containers.
//
// It answers once the poses of both boxes are in with one stamp, and refuses what is no pose.
#include <stdexcept>

#include "box_contact/contact_message.hpp"
#include "box_contact_msgs/msg/contacts.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"

using box_contact_msgs::msg::Contacts;
using geometry_msgs::msg::PoseStamped;

class BoxContactNode : public rclcpp::Node {
 public:
  explicit BoxContactNode(const rclcpp::NodeOptions& options) : Node("box_contact", options) {
    contacts_ = create_publisher<Contacts>("contacts", 10);
    const auto qos = rclcpp::SensorDataQoS().keep_last(100);  // 100 ms at 1 kHz
    for (int side = 0; side < 2; ++side)
      subscriptions_[side] = create_subscription<PoseStamped>(
          side ? "box_b/pose" : "box_a/pose", qos,
          [this, side](PoseStamped::ConstSharedPtr message) { take(side, message); });
  }

 private:
  static box_contact::Box box_at(const PoseStamped& message) {
    const auto& [p, q] = message.pose;
    return {{{p.x, p.y, p.z}, {q.x, q.y, q.z, q.w}}, {12.192, 2.438, 2.591}};
  }

  void take(int side, PoseStamped::ConstSharedPtr message) try {
    last_[side] = message;
    const auto& [a, b] = last_;
    if (!a || !b || a->header != b->header) return;
    Contacts answer;
    answer.header = message->header;
    const auto contact = box_contact::collide(box_at(*a), box_at(*b));
    if (contact.colliding)
      answer.contacts.push_back(box_contact::to_message(contact, "box_a_box_b", "box_a", "box_b"));
    contacts_->publish(answer);
  } catch (const std::invalid_argument& error) {
    RCLCPP_WARN(get_logger(), "refused: %s", error.what());
  }

  PoseStamped::ConstSharedPtr last_[2];
  rclcpp::Publisher<Contacts>::SharedPtr contacts_;
  rclcpp::Subscription<PoseStamped>::SharedPtr subscriptions_[2];
};

RCLCPP_COMPONENTS_REGISTER_NODE(BoxContactNode)
