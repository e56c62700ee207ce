# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes without ROS: boxes, pairs, scene files, pairing by stamps, bytes of messages, forces."""
