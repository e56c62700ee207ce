# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What shows running nodes: the page in the browser, and markers for RViz."""
