# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From contacts to forces: the patch law, and what every such law shares."""
