"""All rclpy of the product: the contact node and the parts that it is wired from."""
