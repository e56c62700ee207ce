# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recipe of the source paper: its data sets, its networks, their errors."""
