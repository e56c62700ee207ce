# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make recordings/crane_landing: `python test/helpers/make_recording.py`.

A 40 ft container is set down on another one in closed loop, one contact per tick at 200 Hz; from
half a second before the first touch to three and a half after it. No ROS graph: the messages are
those that `contact_node` makes, and the stamps are simulated time from START on. All contacts are a
point cloud, which every tool can read.
"""
from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from box_contact_ros.demo.mujoco_crane import Crane
from rclpy.serialization import serialize_message

from box_contact_ros import ContactSolver
from box_contact_ros.demo.landing import LandingCase, land, scenario_of
from box_contact_ros.node.messages import NANOSECONDS, TypedMessages, make_header
from box_contact_ros.node.ros_client import pose_message
from box_contact_ros.scene.scene_solver import Answer, two_boxes
from box_contact_ros.view.recording.bag_file import TOPICS as OF_TWO_BOXES
from box_contact_ros.view.recording.bag_file import Recorder

TOPICS = (*OF_TWO_BOXES[:4], 'contacts_cloud')
FOLDER = Path(__file__).resolve().parents[2] / 'recordings' / 'crane_landing'
CASE = LandingCase(rope_angle=1.25, rope_heading=35.0, tilt=1.5, tilt_heading=120.0, overhang=0.3,
                   overhang_heading=-60.0, yaw=0.6)
MODEL, RATE = 'mlp', 200.0
PAIR, = two_boxes((1, 1, 1), (1, 1, 1)).pairs
BEFORE, AFTER = 0.5, 3.5  # s, from the first touch
START = 1_767_225_600 * NANOSECONDS  # 2026-01-01; a stamp of zero means no time to some tools


def make(folder: Path) -> Recorder:
    """Land, and write the recording to a new folder."""
    scenario = scenario_of(CASE)
    solver = ContactSolver(scenario.size, scenario.stack_size, model=MODEL)
    record = land(scenario, solver, rate_hz=RATE)
    if not record.judge().at_rest:
        raise RuntimeError(f'this is no landing:\n{record.judge()}')
    touched = min(record.points)
    stack = Crane(scenario, RATE).stack_pose
    recorder = Recorder(folder, [f'/{topic}' for topic in TOPICS], {
        'size_a': scenario.size, 'size_b': scenario.stack_size, 'model': MODEL})
    typed = TypedMessages()
    ticks = range(touched - round(BEFORE * RATE), touched + round(AFTER * RATE))
    for tick, load in zip(ticks, record.poses[ticks.start:ticks.stop]):
        stamp = START + round((tick - ticks.start) / RATE * NANOSECONDS)
        header, contact = make_header(stamp, 'world'), solver(load, stack)
        typed.begin(stamp, 'world')
        answer = Answer([(PAIR, contact)] if contact.colliding else [], [], 1)
        messages = [pose_message(header, load), pose_message(header, stack),
                    typed.cloud(answer)]
        if contact.colliding:
            messages[2:2] = [typed.point(contact), typed.normal(contact)]
        topics = TOPICS if contact.colliding else (*TOPICS[:2], TOPICS[4])
        for topic, message in zip(topics, messages):
            recorder.write(f'/{topic}', stamp, serialize_message(message))
    recorder.close()
    return recorder


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=FOLDER)
    options = parser.parse_args()
    shutil.rmtree(options.out, ignore_errors=True)
    made = make(options.out)
    for topic, count in made.counts.items():
        print(f'{topic:<20} {count}')
    size = sum(path.stat().st_size for path in options.out.iterdir())
    print(f'{options.out}: {size / 1e3:.0f} kB')
