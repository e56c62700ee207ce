# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models that are read from weights files: mlp and the source paper's network."""
