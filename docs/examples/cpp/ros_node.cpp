// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// A node of two boxes that answers in your own process, without the contact node: as a component, or
// as a program.
//
// It answers once the poses of both boxes are in with one stamp, and refuses what is no pose.
// Parameters: size_a, size_b, three full extents each [m]; margin [m], up to which boxes apart are
// near; of the program also events_executor, which takes less time than the default executor.
#include <algorithm>
#include <array>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "box_contact/contact_message.hpp"
#include "box_contact_msgs/msg/contacts.hpp"
#include "geometry_msgs/msg/point_stamped.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "geometry_msgs/msg/vector3_stamped.hpp"
#include "rclcpp/experimental/executors/events_executor/events_executor.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"

using box_contact_msgs::msg::Contacts;
using geometry_msgs::msg::PointStamped;
using geometry_msgs::msg::PoseStamped;
using geometry_msgs::msg::Vector3Stamped;

// Poses of a box that wait for that of the other one. Executors may let one stream be a tick or two
// ahead of the other.
constexpr int waiting_poses = 3;

class BoxContactNode : public rclcpp::Node {
 public:
  explicit BoxContactNode(const rclcpp::NodeOptions& options) : Node("box_contact", options) {
    for (int side = 0; side < 2; ++side) boxes_[side].size = size_of(side ? "size_b" : "size_a");
    query_.margin = declare_parameter("margin", 0.0);
    box_contact::collide(boxes_[0], boxes_[1], query_);  // refuses bad sizes and a bad margin
    point_ = create_publisher<PointStamped>("contact/point", 10);
    normal_ = create_publisher<Vector3Stamped>("contact/normal", 10);
    contacts_ = create_publisher<Contacts>("contacts", 10);
    const auto qos = rclcpp::SensorDataQoS().keep_last(100);  // 100 ms at 1 kHz
    for (int side = 0; side < 2; ++side)
      subscriptions_[side] = create_subscription<PoseStamped>(
          side ? "box_b/pose" : "box_a/pose", qos,
          [this, side](PoseStamped::ConstSharedPtr message) { take(side, std::move(message)); });
  }

 private:
  box_contact::Size size_of(const std::string& name) {
    const auto given = declare_parameter(name, std::vector<double>{12.192, 2.438, 2.591});
    if (given.size() != 3) throw std::invalid_argument(name + " must be 3 numbers");
    return {given[0], given[1], given[2]};
  }

  // Answer with the pose of the other box that has the same stamp, or let the pose wait for it.
  void take(int side, PoseStamped::ConstSharedPtr message) try {
    auto& others = waiting_[1 - side];
    const auto partner = std::find_if(others.begin(), others.end(), [&](const auto& pose) {
      return pose && pose->header == message->header;
    });
    if (partner == others.end()) {
      waiting_[side][next_[side]] = std::move(message);
      next_[side] = (next_[side] + 1) % waiting_poses;
      return;
    }
    const auto other = std::exchange(*partner, nullptr);
    place(side, *message);
    place(1 - side, *other);
    answer(message->header);
  } catch (const std::invalid_argument& error) {
    RCLCPP_WARN(get_logger(), "refused: %s", error.what());
  }

  void place(int side, const PoseStamped& message) {
    const auto& [p, q] = message.pose;
    boxes_[side].pose = {{p.x, p.y, p.z}, {q.x, q.y, q.z, q.w}};
  }

  // Publish point and normal while in contact, then all that there is to tell.
  void answer(const std_msgs::msg::Header& header) {
    const auto contact = box_contact::collide(boxes_[0], boxes_[1], query_);
    Contacts contacts;
    contacts.header = header;
    if (contact.colliding) {
      const auto told = box_contact::to_message(contact, boxes_[0], boxes_[1], "box_a_box_b",
                                                "box_a", "box_b");
      PointStamped point;
      point.header = header, point.point = told.point;
      point_->publish(point);
      Vector3Stamped normal;
      normal.header = header, normal.vector = told.normal;
      normal_->publish(normal);
      contacts.contacts.push_back(told);
    } else if (contact.separation <= query_.margin) {
      add_near(contacts);
    }
    contacts_->publish(contacts);
  }

  // List boxes whose distance is within the margin; their separation is less than the distance.
  void add_near(Contacts& contacts) const {
    const auto nearest = box_contact::distance(boxes_[0], boxes_[1]);
    if (nearest.distance > query_.margin) return;
    auto& near = contacts.near.emplace_back();
    near.pair = "box_a_box_b", near.box_a = "box_a", near.box_b = "box_b";
    near.distance = nearest.distance;
    const double *n = nearest.normal, *a = nearest.point_a, *b = nearest.point_b;
    near.normal.x = n[0], near.normal.y = n[1], near.normal.z = n[2];
    near.point_a.x = a[0], near.point_a.y = a[1], near.point_a.z = a[2];
    near.point_b.x = b[0], near.point_b.y = b[1], near.point_b.z = b[2];
  }

  box_contact::Box boxes_[2] = {{{{0, 0, 0}, {0, 0, 0, 1}}, {}}, {{{0, 0, 0}, {0, 0, 0, 1}}, {}}};
  box_contact::Query query_;
  std::array<PoseStamped::ConstSharedPtr, waiting_poses> waiting_[2];
  int next_[2] = {};  // where the next pose waits, instead of the oldest
  rclcpp::Publisher<PointStamped>::SharedPtr point_;
  rclcpp::Publisher<Vector3Stamped>::SharedPtr normal_;
  rclcpp::Publisher<Contacts>::SharedPtr contacts_;
  rclcpp::Subscription<PoseStamped>::SharedPtr subscriptions_[2];
};

RCLCPP_COMPONENTS_REGISTER_NODE(BoxContactNode)

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  const auto node = std::make_shared<BoxContactNode>(rclcpp::NodeOptions());
  if (node->declare_parameter("events_executor", true)) {
    rclcpp::experimental::executors::EventsExecutor executor;
    executor.add_node(node);
    executor.spin();
  } else {
    rclcpp::spin(node);
  }
  rclcpp::shutdown();
}
