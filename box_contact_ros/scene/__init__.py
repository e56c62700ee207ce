# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes without ROS: boxes, bodies and pairs, their file, and what one tick of them computes."""
