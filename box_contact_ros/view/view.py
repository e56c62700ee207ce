# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A live page in the browser: boxes, contacts, depth and force over time.

Without --scene it starts a contact node and a crane, in a ROS domain of their own, and lands the
load again and again. With --scene it starts nothing: it draws the boxes of that scene file as the
running nodes publish them. Ctrl-C ends it, and what it has started with it.
"""
from __future__ import annotations

import argparse
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from functools import partial
from typing import TYPE_CHECKING, Any

from ..extras import require
from ..node import processes
from ..node.parameters import outside_ros_args
from ..node.processes import Stop, asked_to_end, on_this_host, printed, program
from ..node.runtime import REFUSALS, running_node, spin_for
from ..scene.scene_file import read_scene
from ..scene.scene_solver import CONTAINER, two_boxes
from ..solver.arguments import model_name, program_parser, within
from .listener import ViewNode

if TYPE_CHECKING:
    from .page import Page

FRAME_PERIOD = 1 / 30
FIGURES_PERIOD = 0.1  # time [s] between new figures: faster, nobody can read them
PAUSE = 1.5  # time [s] between the end of a landing and the next, to see how it ended
WAIT = 60.0  # how long the crane waits for the contact node, which starts at the same time [s]


class Landings:
    """A contact node, and a crane that lands its load again whenever it has ended."""

    def __init__(self, **parameters: object) -> None:
        self.awaited = 'the contact node and the crane are starting'
        self._output = tempfile.TemporaryFile()  # of the node and one landing
        self._node = processes.start(program('node.contact_node', **parameters), self._output)
        self._crane: subprocess.Popen[bytes] | None = None
        self._next_at = 0.0

    def step(self) -> None:
        """Start a crane if it is time. Raises RuntimeError if the contact node has ended."""
        if self._node.poll() is not None:
            raise RuntimeError(f'contact_node ended, status {self._node.returncode}; it printed:\n'
                               f'{printed(self._output)}')
        now = time.monotonic()
        if self._crane is not None and self._crane.poll() is not None:
            if self._crane.returncode:
                print(f'view: the landing failed; what contact node and crane printed:\n'
                      f'{printed(self._output)}', file=sys.stderr, flush=True)
            self._output.seek(0)  # for those who write to it, too
            self._output.truncate()
            self.awaited = (f'the landing {"failed" if self._crane.returncode else "passed"}; '
                            'the next begins in a few seconds')
            self._crane, self._next_at = None, now + PAUSE
        if self._crane is None and now >= self._next_at:
            self._crane = processes.start(program('demo.crane_node', wait=WAIT), self._output)

    def close(self) -> None:
        """End both at once."""
        processes.end([self._node, *([self._crane] if self._crane else [])])
        self._output.close()


def watch(node: ViewNode, executor: Any, page: Page, landings: Landings | None, stop: Stop) -> None:
    """Bring the page up to what the node hears, until `stop` is set."""
    figures_at = 0.0
    while not stop.is_set():
        spin_for(node, executor, FRAME_PERIOD)
        if landings is not None:
            landings.step()
        tick = None if node.quiet else node.tick()
        if tick is not None:
            page.draw(tick)
        if time.monotonic() >= figures_at:
            figures_at = time.monotonic() + FIGURES_PERIOD
            page.show(tick, node.force(tick.stamp) if tick else math.nan, model=node.model,
                      awaited=landings.awaited if landings else 'waiting for poses of the scene')


def serve(options: argparse.Namespace, args: Sequence[str], stop: Stop) -> None:
    """Serve the page until `stop` is set. Raises RuntimeError if the contact node ends."""
    from .page import Page  # only here: viser is an extra

    scene = read_scene(options.scene) if options.scene else two_boxes(CONTAINER, CONTAINER)
    with ExitStack() as ending:
        node, executor = ending.enter_context(running_node(partial(ViewNode, scene=scene), args))
        page = ending.enter_context(closing(Page(options.host, options.port)))
        # Programs end before the page: they must not outlive a page that hangs.
        landings = None if options.scene else ending.enter_context(closing(Landings(
            **({'model': options.model} if options.model else {}))))
        where = (f'scene {options.scene}' if options.scene else
                 f'ROS_DOMAIN_ID={options.domain} for ros2 and RViz')
        print(f'view: {page.url} ({where}); Ctrl-C ends it', flush=True)
        watch(node, executor, page, landings, stop)


def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until SIGINT (0), SIGTERM or SIGHUP (128 + number); 1 if the node ends."""
    args = list(sys.argv[1:] if args is None else args)
    options = _options(outside_ros_args(args))
    require(*(('view',) if options.scene else ('sim', 'view')))
    if not options.scene:  # nothing else on this network hears what is started here
        os.environ |= on_this_host(options.domain)
    with asked_to_end() as stop:
        try:
            serve(options, args, stop)
        except (*REFUSALS, RuntimeError, OSError) as error:
            print(f'error: {error}', file=sys.stderr)
            return 1
    return 0 if stop.signals[0] == signal.SIGINT else stop.status


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser('view', __doc__, epilog='What follows --ros-args is for the view '
                                                    'itself: with --scene, -r remaps topics.')
    parser.add_argument('--host', default='127.0.0.1',
                        help='address to serve at; everybody who reaches it sees the page '
                             '(default: %(default)s)')
    parser.add_argument('--port', type=within(1, 65535), default=8080,
                        help='port to serve at, or the next that is free (default: %(default)s)')
    parser.add_argument('--scene', metavar='FILE',
                        help='scene file; start nothing, and draw this scene')
    parser.add_argument('--model', type=model_name, metavar='NAME',
                        help="model of the contact node that is started (default: the node's own)")
    processes.add_domain(parser, '; with --scene, ROS_DOMAIN_ID')
    options = parser.parse_args(list(args))
    if options.scene and options.model:
        parser.error('--model is for what the view starts itself, and with --scene it starts '
                     'nothing')
    return options


if __name__ == '__main__':
    sys.exit(main())
