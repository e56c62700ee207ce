# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane in MuJoCo, its node, and the demo."""

CRANE_WRENCH = 'crane/wrench'
"""Topic of the force of the contacts on the crane's load. The view shows it, without MuJoCo."""
