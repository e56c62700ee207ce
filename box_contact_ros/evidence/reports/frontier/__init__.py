# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speed against error: the program `frontier`, its speed gates."""
