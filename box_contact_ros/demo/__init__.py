# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane in MuJoCo, its node, and the demo."""

CRANE_WRENCH, CRANE_ROPES = 'crane/wrench', 'crane/ropes'
"""Topics of the force of the contacts on the crane's load, and of its ropes, as a marker of lines.
The view shows both, without MuJoCo."""
