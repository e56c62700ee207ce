# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All rclpy of the product: the contact node and the parts that it is wired from."""
