# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of the contact node: those of a scene, /tf, and their QoS events."""
