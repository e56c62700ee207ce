# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is it right: hard poses, an independent judge, fuzzing."""
