# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in the browser: what is drawn, what is read off, what can be asked for."""
