# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans of boxes: what a user's file says, and whether it is sound.

A file's way: read_plan opens it; table has its cells, roles and forms say what they mean, packing
makes a plan of them, and baplie one of a ship. inspect_plan judges it: meetings and bearings, the
loads by statics, the verdict, steps and ways. An inspection has the rows, plot the picture, and
inspect_files is the program.
"""
