# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The streams of a scene: which stamped poses belong together, and messages as bytes."""
