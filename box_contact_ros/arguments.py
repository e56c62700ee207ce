# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import contextlib
import functools
import io
import math
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from .models.make_model import check_model
from .solver.checks import printable

Number = TypeVar('Number', int, float)
Main = Callable[[Sequence[str] | None], int]
NOT_WRITTEN = 74
"""Exit status where stdout or a file cannot be written, as <sysexits.h> has it."""


def program_main(main: Main) -> Callable[..., int]:
    """Return the main function of a program that ends without a traceback if output fails.

    The exit status is 128 and the signal for a closed pipe or Ctrl-C, as shells report it, and
    NOT_WRITTEN for a full device. What the terminal cannot encode is escaped.
    """
    @functools.wraps(main)
    def run(args: Sequence[str] | None = None) -> int:
        streams = [stream for stream in (sys.stdout, sys.stderr) if stream]  # None: closed
        for stream in streams:
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors='backslashreplace')
        try:
            try:
                return main(args)
            finally:
                if sys.stdout:
                    sys.stdout.flush()
        except BrokenPipeError:
            status = 128 + signal.SIGPIPE
        except KeyboardInterrupt:
            status = 128 + signal.SIGINT
        except OSError as error:
            status = NOT_WRITTEN
            with contextlib.suppress(OSError):
                print(one_line(error), file=sys.stderr)
        for stream in streams:
            _give_up(stream)
        return status
    return run


def _give_up(stream: Any) -> None:
    """Drop what is left of a stream that cannot be written: Python would complain at its end."""
    try:
        stream.flush()
    except OSError:
        with contextlib.suppress(OSError), open(os.devnull, 'w') as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())


def one_line(error: BaseException) -> str:
    """Return what went wrong in one line, with the file."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror:
        text = error.strerror if error.filename is None else f'{error.filename}: {error.strerror}'
    return printable(' '.join(text.split()))


def program_parser(program: str, doc: str | None, **options: Any) -> argparse.ArgumentParser:
    """Return the parser of a program, whose help begins with `doc`."""
    return argparse.ArgumentParser(prog=_as_typed(program), description=doc, **options,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)


def _as_typed(program: str) -> str:
    """Return what starts a program: pip's name, or that of colcon, which ros2 run takes."""
    started = Path(sys.argv[0])
    if started.name == f'box_contact_{program}':
        return started.name
    is_colcons = (started.parent.name, started.name) == ('box_contact_ros', program)
    return f'ros2 run box_contact_ros {program}' if is_colcons else program


def model_name(text: str) -> str:
    """Return the name of a model, as a program's argument."""
    try:
        check_model('model', text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def within(low: Number, high: Number | None = None) -> Callable[[str], Number]:
    """Return an argument type: a number from `low` to `high`, whole where `low` is."""
    kind = type(low)

    def number(text: str) -> Number:
        value = kind(text)  # argparse reports what is no number
        if not low <= value <= (math.inf if high is None else high):
            limits = f'be at least {low:g}' if high is None else f'lie in {low:g} to {high:g}'
            raise argparse.ArgumentTypeError(f'must {limits}, got {text}')
        return value
    return number


def parse_command_line(program: str, doc: str | None, settings: Mapping[str, Any],
                       args: Sequence[str] | None) -> None:
    """Serve `--help`, and refuse arguments that ROS does not take (exit status 2).

    settings: the parameters of a node.
    args: what follows the program's name; None: those of this process.
    """
    width = max(map(len, settings))
    lines = [f'  {name:<{width}}  {setting.description} (default: {default_text(setting.default)})'
             for name, setting in settings.items()]
    parser = program_parser(
        program, doc, usage='%(prog)s [-h] [--ros-args -p NAME:=VALUE ... -r FROM:=TO ...]',
        epilog='parameters (--ros-args -p NAME:=VALUE):\n' + '\n'.join(lines))
    unknown = parser.parse_known_args(outside_ros_args(sys.argv[1:] if args is None else args))[1]
    if unknown:
        parser.error(f'unrecognized arguments: {" ".join(unknown)}')


def outside_ros_args(args: Sequence[str]) -> list[str]:
    """Return what is not between `--ros-args` and `--`; rclpy's function fails on a bad value."""
    outside, inside = [], False
    for arg in args:
        if arg == '--ros-args' or (inside and arg == '--'):
            inside = arg == '--ros-args'
        elif not inside:
            outside.append(arg)
    return outside


def default_text(default: Any) -> str:
    """Return a default as it is typed in a shell."""
    if isinstance(default, tuple):
        return '[' + ','.join(map(str, default)) + ']'
    return str(default).lower() if isinstance(default, bool) else str(default) or 'none'
