# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models that are not compiled in: networks read from weights files, and the polygon soup."""
