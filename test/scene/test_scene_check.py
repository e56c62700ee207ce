# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`contact_node --check FILE`: what a scene file means, without ROS."""
from __future__ import annotations

import subprocess
import sys
import zlib

import pytest

from box_contact_ros.cli import run
from box_contact_ros.scene.files.scene_check import meaning
from box_contact_ros.scene.files.scene_file import parse_scene

WITHOUT_ROS = """
import sys
sys.modules['rclpy'] = None  # an import fails
from box_contact_ros.cli import run
status = run('contact_node', ['--check', sys.argv[1]])
assert not any(name.startswith(('rclpy.', 'geometry_msgs')) for name in sys.modules)
sys.exit(status)
"""
TEXT = """\
types: {crate: {size: [1, 2, 3]}}
boxes:
  a: {type: crate}
  idle: {type: crate}
  s: {stack: {size: [4, 4, 4], tiers: 2}}
pairs: [{a: a, b: 's*'}]
"""


def test_what_a_file_means():
    assert list(meaning(parse_scene(TEXT))) == [
        'box a: 1 x 2 x 3 m, moves: a/pose',
        'box idle: 1 x 2 x 3 m, moves, but is in no pair: not listened to',
        'box s_t1: 4 x 4 x 4 m, fixed at 0 0 2 0 0 0 1',
        'box s_t2: 4 x 4 x 4 m, fixed at 0 0 6 0 0 0 1',
        f'pair a_s_t1: id {zlib.crc32(b"a_s_t1")}, from a to s_t1',
        f'pair a_s_t2: id {zlib.crc32(b"a_s_t2")}, from a to s_t2',
        'size 1 x 2 x 3 m: 2', 'size 4 x 4 x 4 m: 2', 'frame: any, the same for all poses',
        'topics in: 1 (a/pose)',
        'topics out: contacts, and <pair>/contact/point and /normal of 2 pairs',
        '4 boxes, 2 of them moving; 2 pairs']


def test_poses_of_an_array_have_their_places():
    lines = list(meaning(parse_scene('poses: array\n' + TEXT)))
    assert 'box idle: 1 x 2 x 3 m, moves: poses[1]' in lines and 'topics in: 1 (poses)' in lines


def test_a_file_is_checked_without_ros(tmp_path):
    """One that is good and one that is not: line and field on stderr, exit status 1."""
    (tmp_path / 'bad.yaml').write_text(TEXT.replace('tiers: 2', 'tiers: x'))
    for path, status, words in (('config/scenes/yard_bay.yaml', 0, '51 boxes, 1 of them moving'),
                                ('yard_bay', 0, '51 boxes, 1 of them moving'),
                                ('no_bay', 1, "'no_bay' cannot be read: No such file"),
                                (tmp_path / 'bad.yaml', 1, "bad.yaml:5: boxes.s.stack.tiers: 'x'")):
        done = subprocess.run([sys.executable, '-c', WITHOUT_ROS, path], capture_output=True,
                              text=True, timeout=60)
        assert done.returncode == status and words in (done.stderr if status else done.stdout)


def test_check_needs_a_file(capsys):
    with pytest.raises(SystemExit):
        run('contact_node', ['--check'])
    assert 'expected one argument' in capsys.readouterr().err
