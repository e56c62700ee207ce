# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page in the browser: all boxes of a scene, their contacts and figures, live.

It starts a contact node and, again and again, a crane, in a ROS domain of their own. With --scene
it starts a contact node for that scene, and moves its boxes. With --attach it listens to a contact
node and a simulator that run already. With --replay it plays a recording. On the page the contact
node is switched from model to model while it runs, and the crane lands again with other settings.
It ends with Ctrl-C, and what it has started with it.
"""
from __future__ import annotations

import argparse
import dataclasses
import os
import queue
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..node import processes
from ..node.contact_program import PARAMETERS
from ..node.parameters import outside_ros_args
from ..node.processes import DOMAINS, Stop, asked_to_end, on_this_host, printed, program
from ..node.runtime import REFUSALS, joined, spin_once
from ..node.topics.scene_topics import MOST_PAIRS_WITH_TOPICS
from ..scene.files.scene_file import read_scene
from ..scene.scene_solver import Scene
from ..solver.arguments import model_name, program_parser, within
from . import scene_driver
from .listener import ViewNode
from .page.view_page import CraneRun, Page

if TYPE_CHECKING:
    from .recording.bag_player import BagPlayer

FRAME_PERIOD = 1 / 30
CRANE_RATE, SCENE_RATE = 200.0, 50.0  # ticks a second, where nothing else is asked for
PAUSE = 1.5  # time [s] between the end of a run and the next, to see how it ended
WAIT = 60.0  # how long the crane waits for the contact node, which starts at the same time [s]


class Programs:
    """Programs that the view has started; none of them may end by itself."""

    def __init__(self, **commands: Sequence[str]) -> None:
        self._outputs = {name: tempfile.TemporaryFile() for name in commands}
        self._running = {name: processes.start(command, self._outputs[name])
                         for name, command in commands.items()}

    def step(self) -> bool:
        """Return whether another run was started: never. RuntimeError if a program ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise RuntimeError(f'{name} ended, status {process.returncode}; it printed:\n'
                                   f'{printed(self._outputs[name])}')
        return False

    def close(self, *more: subprocess.Popen[bytes]) -> None:
        """End everything, and `more`, at once."""
        processes.end([*self._running.values(), *more])
        for output in self._outputs.values():
            output.close()


class Simulation(Programs):
    """A contact node, and a crane that is started again whenever it has ended."""

    def __init__(self, model: str, run: CraneRun) -> None:
        self.run = run
        self.last_run: tuple[bool, str] | None = None
        """Whether the last run that ended by itself passed, and the crane's report of it."""
        self._crane_output = tempfile.TemporaryFile()
        self._crane: subprocess.Popen[bytes] | None = None
        self._next_at = 0.0
        super().__init__(contact_node=program('contact_node', model=model))

    def step(self) -> bool:
        """Start a crane if it is time; return whether one was. RuntimeError if the node ended."""
        super().step()
        now = time.monotonic()
        if self._crane is not None and self._crane.poll() is not None:
            self.last_run = self._crane.returncode == 0, printed(self._crane_output)
            self._crane = None
            self._next_at = now + PAUSE
            self.run = dataclasses.replace(self.run, seed=self.run.seed + 1)
        if self._crane is not None or now < self._next_at:
            return False
        self._crane_output.seek(0)
        self._crane_output.truncate()
        self._crane = processes.start(
            program('crane', wait=WAIT, **dataclasses.asdict(self.run)), self._crane_output)
        return True

    def land(self, run: CraneRun) -> None:
        """End what is under way; `step` then starts this."""
        if self._crane is not None:
            processes.end([self._crane])
            self._crane = None
        self.run, self._next_at = run, 0.0

    def close(self, *more: subprocess.Popen[bytes]) -> None:
        """End everything at once."""
        super().close(*more, *([self._crane] if self._crane is not None else []))
        self._crane_output.close()


@contextmanager
def listening(target: str, scene: Scene | None, args: Sequence[str]) -> Iterator[ViewNode]:
    """Give a ViewNode that is served by a thread; `target` is the contact node's name."""
    with joined(partial(ViewNode, target=target, scene=scene), args) as (node, executor):
        stop = threading.Event()

        def serve() -> None:
            while not stop.is_set():
                spin_once(node, executor, 0.1)

        thread = threading.Thread(target=serve, name='ROS')
        thread.start()
        try:
            yield node
        finally:
            stop.set()
            thread.join()


def watch(node: ViewNode | BagPlayer, page: Page, started: Programs | BagPlayer | None,
          wishes: queue.SimpleQueue[Callable[[], None]], stop: Stop) -> None:
    """Draw, and do what the page's users wish for, until `stop` is set."""
    frame_end = 0.0
    while not stop.wait(max(0.0, frame_end - time.monotonic())):
        frame_end = time.monotonic() + FRAME_PERIOD
        while not wishes.empty():
            wishes.get()()
        log = node.log
        if started is not None and started.step() and isinstance(started, Simulation):
            page.show_run(started.run)
            if started.last_run is not None:
                page.show_last_run(*started.last_run)
            if log is not None:
                log.start_anew()
        snapshot = log.snapshot() if log else None
        page.draw(snapshot, node.lines, node.force)
        if page.due:
            figures = log.figures(node.now()) if log else None
            page.show(snapshot, figures, model=node.model, wish=node.wish, refusal=node.refusal,
                      connected=node.connected)


def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until SIGINT (0), SIGTERM or SIGHUP (128 + number); 1 if the node ends."""
    args = list(sys.argv[1:] if args is None else args)
    options = _options(outside_ros_args(args))
    # Nothing else on this network hears what is started here.
    if not options.attach and not options.replay:
        os.environ |= on_this_host(options.domain)
    elif options.domain is not None:
        os.environ['ROS_DOMAIN_ID'] = str(options.domain)
    with asked_to_end() as stop:
        try:
            if options.replay:
                replay(options, stop)
            else:
                serve(options, args, stop)
        except (*REFUSALS, RuntimeError, OSError) as error:
            print(f'error: {error}', file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            pass
    return 0 if stop.signals[0] == signal.SIGINT else stop.status


def replay(options: argparse.Namespace, stop: Stop) -> None:
    """Serve the page with a recording, again and again, until `stop` is set."""
    from .recording.bag_player import BagPlayer  # only here: rosbags is an extra

    with stop.interrupting():
        player = BagPlayer(options.replay)
    with closing(Page(options.host, options.port)) as page:
        announce(page, options, 'a recording')
        watch(player, page, player, queue.SimpleQueue(), stop)


def announce(page: Page, options: argparse.Namespace, what: str) -> None:
    """Print where the page is, and open a browser where there is a display."""
    print(f'view: {page.url} ({what}); Ctrl-C ends it', flush=True)
    if not options.no_browser and _has_display():
        webbrowser.open(page.url)


def serve(options: argparse.Namespace, args: Sequence[str], stop: Stop) -> None:
    """Serve the page until `stop` is set; RuntimeError if a program that was started ends."""
    wishes: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
    started: Programs | None = None
    run = (None if options.attach or options.scene else
           CraneRun(options.seed, options.rate, not options.open_loop))
    with stop.interrupting():
        scene = read_scene(options.scene) if options.scene else None
    with listening(options.node, scene, args) as node, ExitStack() as ending:
        page = ending.enter_context(closing(Page(
            options.host, options.port, run=run,
            on_model=lambda name: wishes.put(partial(node.set_model, name)),
            on_land=lambda wish: wishes.put(lambda: started.land(wish)))))
        # Programs end before the page: they must not outlive a page that hangs.
        if run is not None:
            started = ending.enter_context(closing(Simulation(options.model, run)))
        elif not options.attach:
            started = ending.enter_context(closing(Programs(
                contact_node=program(
                    'contact_node', model=options.model, scene=options.scene,
                    pair_topics=len(scene.pairs) <= MOST_PAIRS_WITH_TOPICS),
                scene_driver=['-m', scene_driver.__name__, '--scene', options.scene, '--rate',
                              str(options.rate)])))
        announce(page, options, 'the domain of this shell' if options.domain is None else
                 f'ROS_DOMAIN_ID={options.domain} for ros2 and RViz')
        watch(node, page, started, wishes, stop)


def _has_display() -> bool:
    """Without one, a browser in the terminal might be opened, and wait for its user."""
    return sys.platform == 'darwin' or any(
        os.environ.get(name) for name in ('DISPLAY', 'WAYLAND_DISPLAY'))


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser(
        'view', __doc__, epilog='What follows --ros-args is for the view itself; with --attach, '
                                '-r remaps topics.')
    parser.add_argument('--host', default='127.0.0.1',
                        help='address to serve at, or the name that browsers open it by; everybody '
                             'who reaches it can change the model (default: %(default)s)')
    parser.add_argument('--port', type=within(1, 65535), default=8080,
                        help='port to serve at, or the next that is free (default: %(default)s)')
    parser.add_argument('--no-browser', action='store_true', help='do not open a browser')
    parser.add_argument('--attach', action='store_true',
                        help='start nothing: listen to nodes that run already')
    parser.add_argument('--node', default='contact_node', metavar='NAME',
                        help='name of the contact node (default: %(default)s)')
    parser.add_argument('--scene', metavar='NAME',
                        help='draw this scene, and move its boxes: a file, or the bare name of one '
                             'in config/scenes/; with --attach instead of the one that the '
                             'contact node tells')
    parser.add_argument('--replay', type=Path, metavar='RUN',
                        help='start nothing: play a recording, a folder that `record` made')
    processes.add_domain(parser, '; with --attach, ROS_DOMAIN_ID')
    parser.set_defaults(domain=None)
    parser.add_argument('--model', type=model_name, default=PARAMETERS['model'].default,
                        metavar='NAME',
                        help='model that the contact node starts with (default: %(default)s)')
    parser.add_argument('--seed', type=within(0, 2**31), default=0, metavar='N',
                        help='seed of the first landing (default: %(default)s)')
    parser.add_argument('--rate', type=within(1.0, 1000.0), metavar='HZ',
                        help=f'ticks per second (default: crane {CRANE_RATE:g}, scene '
                             f'{SCENE_RATE:g})')
    parser.add_argument('--open-loop', action='store_true',
                        help='contacts are shown, but do not carry the load')
    options = parser.parse_args(list(args))
    for name in ('model', 'seed', 'rate', 'open_loop'):
        if options.attach and getattr(options, name) != parser.get_default(name):
            parser.error(f'--{name.replace("_", "-")} is for what the view starts itself, and '
                         '--attach starts nothing')
    if options.replay and (options.attach or options.scene):
        parser.error('--replay plays a recording alone')
    if options.scene and (options.seed or options.open_loop):
        parser.error('--seed and --open-loop are for the crane, and --scene starts none')
    options.rate = options.rate or (SCENE_RATE if options.scene else CRANE_RATE)
    if options.domain is None and not options.attach and not options.replay:
        options.domain = random.choice(DOMAINS)
    return options
