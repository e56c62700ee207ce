# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench: compares latency, losses and errors of running nodes."""
