# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rest report: drops, slopes, pushes and stacks, each with its result stated beforehand."""
