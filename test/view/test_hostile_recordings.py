# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings that hang, or say what none says: each is refused in one line."""
from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags')
pytest.importorskip('viser')

from rclpy.serialization import serialize_message

from box_contact_ros.node.messages import make_header
from box_contact_ros.node.ros_client import pose_message
from box_contact_ros.resources import resource_path
from box_contact_ros.view.recording.bag_file import Recorder, RecordingError, read_replay
from box_contact_ros.view.recording.bag_player import STEP_SECONDS, BagPlayer
from box_contact_ros.view.view import main as view

SHIPPED = resource_path('recordings', 'crane_landing')
CUBE = [2.0, 2.0, 2.0]
START = 1_000_000_000_000
POSE = np.array([0.0, 0, 0, 0, 0, 0, 1])
TOPICS = ('/box_a/pose', '/box_b/pose', '/crane/markers', '/contacts_cloud')


def bag(folder: Path, *, poses=(POSE, POSE), garbage=False, **about) -> Path:
    """Return a recording of two poses, and what no message begins with on the other topics."""
    recorder = Recorder(folder, TOPICS, {'size_a': CUBE, 'size_b': CUBE, **about})
    for topic, pose in zip(TOPICS, poses):
        recorder.write(topic, START, serialize_message(pose_message(make_header(START, ''), pose)))
    for topic in TOPICS if garbage else ():
        for data in (b'', b'\0\1\0\0', b'\0\1\0\0' + b'\xff' * 200):
            recorder.write(topic, START, data)
    recorder.close()
    return folder


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def endless(path: Path) -> Path:
    path.symlink_to('/dev/zero')
    return path


@pytest.mark.parametrize('make', [fifo, endless])
@pytest.mark.parametrize('place', ['.', 'metadata.yaml', 'run.mcap'])
def test_what_is_no_regular_file_is_refused_at_once(program, tmp_path, make, place):
    """A FIFO would be waited for, and no signal would end that; /dev/zero has no end."""
    path = tmp_path / 'run'
    if place == '.':
        make(path)
    else:
        bag(path)
        (path / place).unlink()
        make(path / place)
    for name in ('view', 'bench'):
        running = program(name, '--replay', str(path))
        assert running.wait(60) == 1
        assert 'it is no regular file' in running.output
        assert 'Traceback' not in running.output


@pytest.mark.parametrize('about', [
    {'scene': 7}, {'scene': ['boxes']}, {'scene': None}, {'model': ['exact']},
    {'model': {'a': 1}}, {'topics': [1]}, {'topics': 'x'}, {'size_a': 'CUBE'}, {'size_a': None},
    {'size_a': [1, 2]}, {'size_b': {'x': 1}}, {'size_b': [1, 'x', 2]}, {'size_b': [1, -1, 1]}],
    ids=json.dumps)
def test_odd_types_are_refused_in_one_line(tmp_path, capsys, about):
    """Whoever wrote them: the line names the recording, and what it says."""
    path = bag(tmp_path / 'run', **about)
    name, = about
    with pytest.raises(ValueError, match=name) as error:
        read_replay(path)
    assert str(path) in str(error.value) and '\n' not in str(error.value)
    assert view(['--replay', str(path)]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(f'error: {path}') and printed.err.count('\n') == 1


def test_odd_topics_are_refused_in_one_line(tmp_path, capsys):
    """A topic of contacts that has poses."""
    path = tmp_path / 'run'
    recorder = Recorder(path, ['/contacts'], {'size_a': CUBE, 'size_b': CUBE},
                        {'/contacts': 'geometry_msgs/msg/PoseStamped'})
    recorder.write('/contacts', START, b'')
    recorder.close()
    with pytest.raises(RecordingError, match="contacts is 'geometry_msgs/msg/PoseStamped', which"):
        BagPlayer(path)


def test_messages_that_none_can_be_are_passed_over(tmp_path):
    """As a node passes them over."""
    player = BagPlayer(bag(tmp_path / 'run', garbage=True))
    player.step()
    assert player.log.snapshot().poses.tolist() == [POSE.tolist()] * 2


def test_poses_that_none_can_be_are_not_replayed(tmp_path):
    """The bench would send them, and its reference refuses them."""
    for bad in (np.full(7, np.inf), np.zeros(7), np.full(7, np.nan), 1e300 * POSE):
        with pytest.raises(RecordingError, match='no two poses of equal stamp: 1 stamps .* 0 '):
            read_replay(bag(tmp_path / f'run{np.sum(bad)}', poses=(POSE, bad)))


def test_a_step_is_short_however_much_is_due(tmp_path, monkeypatch):
    """A message takes 20 ms here, and a thousand have the same time."""
    path = tmp_path / 'run'
    recorder = Recorder(path, TOPICS[:2], {'size_a': CUBE, 'size_b': CUBE})
    for _ in range(500):
        for topic in TOPICS[:2]:
            recorder.write(topic, START, serialize_message(
                pose_message(make_header(START, ''), POSE)))
    recorder.close()
    player = BagPlayer(path)
    monkeypatch.setattr(player.log, 'poses', lambda *_: time.sleep(0.02))
    start = time.monotonic()
    player.step()
    assert time.monotonic() - start < STEP_SECONDS + 1.0
