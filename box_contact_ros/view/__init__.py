# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What shows boxes: running nodes, or the plan of a file."""
from ..node.parameters import SCENE_PARAMETERS, Setting, text, whole_number

VIEW_PARAMETERS = SCENE_PARAMETERS | {
    'host': Setting('127.0.0.1', 'address to serve at; everybody who reaches it sees the page',
                    text),
    'port': Setting(8080, 'port to serve at, or the next that is free', whole_number(1, 65535)),
}
