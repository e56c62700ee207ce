# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans of boxes: what a user's file says, and whether it is sound."""
