# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ten models of MuJoCo, one a robot in URDF, each with something that a plan must keep."""
from __future__ import annotations

CUBE = '.5 .5 .5'
FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'


def model(*content: str, floor: str = FLOOR, more: str = '') -> str:
    """Return a model with a floor."""
    return f'<mujoco><worldbody>{floor}{"".join(content)}</worldbody>{more}</mujoco>'


def body(name: str, place: str, *, size: str = CUBE, kind: str = 'box', at: str = '',
         more: str = '', inner: str = '') -> str:
    """Return a free body with one geom, and what else is in it."""
    return (f'<body name="{name}" pos="{place}" {at}><freejoint/><geom name="{name}" '
            f'type="{kind}" size="{size}" {more}/>{inner}</body>')


APART = '<contact><exclude body1="a" body2="b"/></contact>'
LID = ('<body pos=".2 0 .7"><joint type="hinge" axis="0 1 0"/><geom name="lid" type="box" '
       'size=".5 .5 .1" mass="60"/></body>')
LINK = ('<link name="{0}"><inertial><mass value="4"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
        'iyz="0" izz="1"/></inertial><collision name="{0}"><geometry><box size="1 2 {1}"/>'
        '</geometry></collision></link>')
MODELS = {
    'stack': model(body('a', '0 0 .5', more='mass="3"'), body('b', '.2 0 1.5')),
    'overhang': model(body('a', '0 0 .5'), body('b', '.6 0 1.5')),
    'overlap': model(body('a', '0 0 .5'), body('b', '.2 0 1.4')),
    'exclude': model(body('a', '0 0 .5'), body('b', '0 0 1.4'), more=APART),
    'bits': model(body('a', '0 0 .5', more='contype="2" conaffinity="1"'),
                  body('b', '.3 0 .5', more='contype="2" conaffinity="1"')),
    'lid': model(body('a', '0 0 .5', inner=LID), body('b', '.7 0 1.8', size='.3 .3 .5')),
    'turned': model(body('a', '0 0 .5', at='euler="0 0 30"'),
                    body('b', '.1 .2 1.3', size='.2 .3 .8', at='euler="90 0 20"')),
    'slope': model(body('a', '0 0 .5'), more='<option gravity="3 0 -9.81"/>'),
    'ball': model(body('a', '0 0 .5'), body('b', '4 0 .5', kind='sphere', size='.5'),
                  body('c', '4 0 1.5')),
    'robot': '<robot name="r">' + LINK.format('base', 1) + LINK.format('arm', '.5') + (
        '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin '
        'xyz="0 0 .8"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        '</joint></robot>')}
