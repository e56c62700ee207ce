# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files that parameters name, and what a refusal tells of them.

Anybody on the network may set the parameters of a node that runs. So the answer is the same for all
files that do not serve: it tells neither what a file holds nor whether there is one. The log on the
node's machine has the reason.
"""
from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..resources import OpenFiles
from ..scene.files.limits import FOREIGN, OWN, SceneLimits
from ..scene.files.scene_file import is_inline, read_scene
from ..scene.scene_solver import Scene, two_boxes
from ..solver.checks import shown
from .parameters import Setting, flag, reason_of, text

if TYPE_CHECKING:
    from rclpy.node import Node

FILES = ('scene', 'weights')
"""Parameters that name a file."""
LARGEST_TEXT = 2**18  # characters of a scene as text: some 1,000 boxes and pairs


def scene_source(name: str, value: Any) -> str:
    """Check the path of a scene file, or a scene as text, by its length."""
    if len(text(name, value)) > LARGEST_TEXT:
        raise ValueError(f'{name}: a text of {len(value)} characters; at most {LARGEST_TEXT}, '
                         'and a file may be larger')
    return str(value)


SCENE = Setting('', 'scene file, its text, or the bare name of one in config/scenes/; '
                    'replaces size_a and size_b; setting it again reads it again', scene_source)
FIXED_PARAMETERS = {
    'files_from': Setting('.', "directories, with ':' between them, below which `scene` and "
                               '`weights` may name files while the node runs, next to the '
                               "package's own", text, fixed=True),
    'locked': Setting(False, 'whether all parameters and states stay as they are after the start',
                      flag, fixed=True),
}
"""Parameters of every node that reads files which strangers may name."""


class NamedFiles:
    """Opens what may be opened, for a node whose parameters name files."""

    def __init__(self, node: Node, settings: Mapping[str, Any]) -> None:
        """Take directories and files as they are at the start: what the start names is open."""
        self._node, self._scene = node, settings['scene']
        self._open = OpenFiles(settings['files_from'].split(os.pathsep),
                               _files(settings).values())

    @contextmanager
    def resolved(self, settings: Mapping[str, Any], *, starts: bool) -> Iterator[dict[str, Any]]:
        """Give settings with the files' true paths; what the block raises names no file's content.

        starts: whether the node starts: then errors are for who starts it, and stay as they are.
        """
        files = _files(settings)
        try:
            yield {**settings, **{name: self._open.find(file) for name, file in files.items()}}
        except ImportError:  # an extra is not installed
            raise
        except Exception as error:
            if starts or not files:
                raise
            from rclpy.logging import get_logger  # the table of parameters needs no ROS

            from .runtime import LOG_SECONDS

            # A logger of no node: /rosout does not publish it.
            get_logger(f'{self._node.get_logger().name}.local').error(
                reason_of(error), throttle_duration_sec=LOG_SECONDS)
            named = ' and '.join(f'{name} {shown(file)}' for name, file in files.items())
            raise ValueError(f'{named} refused: the log on the machine of the node says why') \
                from None

    def limits(self, settings: Mapping[str, Any]) -> SceneLimits:
        """Return what the scene of settings may ask for: the one that the start named, more."""
        return OWN if settings['scene'] == self._scene else FOREIGN


def named_scene(settings: Mapping[str, Any], **reading: Any) -> Scene:
    """Return the scene of parameters: that of a file or text, or of two sizes and masses.

    reading: options of `read_scene`.
    """
    if settings['scene']:
        return read_scene(settings['scene'], **reading)
    return two_boxes(settings['size_a'], settings['size_b'], **{
        name: settings[name] for name in ('mass_a', 'mass_b') if name in settings})


def _files(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the files that parameters name, as far as they do."""
    return {name: settings[name] for name in FILES if settings.get(name)
            and not (name == 'scene' and is_inline(settings[name]))}
