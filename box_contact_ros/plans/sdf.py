# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SDF, worlds and models, as Gazebo reads it.

Links that joints join are one body. Links of one model collide only if it asks for it by
<self_collide>. What is included from other files is named and not read.
"""
from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.sax import SAXException, SAXParseException
from xml.sax.handler import ContentHandler

import numpy as np

from ..core import MASS_MAX
from ..extras import require
from .bodies import HERE, Solid, Weight, other_gravity, plan_of_bodies, total, within
from .plan import Fault, Plan

ALL_BITS, DENSITY, MASS = 0xffff, 1000.0, 1.0
"""Defaults of SDF: of <collide_bitmask>, <density> [kg/m³] and <mass> [kg]."""
WORLD = 'world'
LIGHTS = ('model://sun', 'model://Sun')
"""Models of Gazebo that nothing can touch."""
COMMENT = b'<!--'
CLOSING = {COMMENT: b'-->', b'<![CDATA[': b']]>', b'<?': b'?>'}
"""What ends what is no element."""
OPENING = re.compile(b'|'.join(map(re.escape, CLOSING)))


class Unreadable(ValueError):
    """A value of an element that is not as SDF has it; `kind` is that of the fault."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class _Tree(ContentHandler):
    """Builds elements with the prefixes that the file has, declared or not."""

    def __init__(self) -> None:
        super().__init__()
        self.builder = TreeBuilder()

    def startElement(self, name: str, attrs: Any) -> None:  # noqa: N802
        """Take a tag with its attributes."""
        self.builder.start(name, dict(attrs))

    def endElement(self, name: str) -> None:  # noqa: N802
        """Take an end."""
        self.builder.end(name)

    def characters(self, content: str) -> None:
        """Take text."""
        self.builder.data(content)


def parse_xml(data: bytes) -> Element:
    """Return the root of an XML file, without entities. Raises ValueError for what is no XML."""
    require('plans')
    from defusedxml import sax

    tree = _Tree()
    try:
        sax.parseString(data.lstrip(), tree)
        return tree.builder.close()
    except SAXParseException as error:
        # Gazebo's reader takes comments with `--` within, which XML does not.
        plain = without_comments(data)
        if len(plain) < len(data):
            return parse_xml(plain)
        raise ValueError(f'line {error.getLineNumber()}: it is not XML: {error.getMessage()}'
                         ) from None
    except (SAXException, LookupError, AssertionError) as error:
        raise ValueError(f'it is not XML: {error}') from None


def without_comments(data: bytes) -> bytes:
    """Return XML with the line ends of its comments alone; with a document type it is as it was.

    What looks like a comment in CDATA or in an instruction is none.
    """
    if b'<!DOCTYPE' in data:
        return data
    parts, end = [], 0
    while (found := OPENING.search(data, end)) and (
            close := data.find(CLOSING[found[0]], found.end())) >= 0:
        start, last = found.start(), close + len(CLOSING[found[0]])
        parts.append(data[end:start])
        parts.append(b'\n' * data.count(b'\n', start, last) if found[0] == COMMENT
                     else data[start:last])
        end = last
    return b''.join((*parts, data[end:]))


@dataclass
class _World:
    """What is read of a world."""

    solids: list[Solid] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    bits: list[int] = field(default_factory=list)  # of each solid
    models: list[str] = field(default_factory=list)  # the outermost one of each solid
    collides: set[str] = field(default_factory=set)  # models whose own links may touch
    fixed: set[str] = field(default_factory=set)  # links
    weights: dict[str, Weight] = field(default_factory=dict)  # of links
    afloat: set[str] = field(default_factory=set)  # links that feel no gravity
    joined: dict[str, str] = field(default_factory=dict)  # links, to one of the same body
    state: dict[str, np.ndarray] = field(default_factory=dict)  # poses of models and links
    names: set[str] = field(default_factory=set)  # of models and collisions
    missing: int = 0  # parts that are in other files

    def body(self, link: str) -> str:
        """Return the link by whose name the body of a link is known."""
        while link in self.joined:
            link = self.joined[link]
        return link

    def join(self, a: str, b: str) -> None:
        """Make the bodies of two links one."""
        a, b = self.body(a), self.body(b)
        if a != b:
            self.joined[max(a, b)] = min(a, b)

    def fault(self, kind: str, name: str, text: str, lacks: str | None = None) -> None:
        """Name what is wrong with a part."""
        self.faults.append(Fault(kind, (name,), text, lacks=lacks))


def read_sdf(root: Element) -> Plan:
    """Return the plan of an SDF file's first world, or of its models. Raises ValueError."""
    places = root.findall('world') or [root]
    world = _World()
    for other in places[1:]:
        world.fault('shape', other.get('name', WORLD), 'is another world: left out', 'part')
    for other in root if places[0] is not root else ():
        if other.tag in ('model', 'include'):
            world.fault('shape', other.get('name', other.tag), 'is beside the world: left out',
                        'part')
    for state in places[0].findall('state'):
        _read_state(state, world)
    for part in ('population', 'road'):
        for other in places[0].findall(part):
            world.fault('shape', other.get('name', part), f'is a <{part}>: not read', 'part')
            world.missing += 1
    models = places[0].findall('model')
    if not models and places[0].find('include') is None and not places[0].tag == WORLD:
        raise ValueError('it has neither a <world> nor a <model>')
    _read_includes(places[0], '', world)
    for model in models:
        _read_model(model, '', HERE, False, world)
    for joint in places[0].findall('joint'):
        _read_joint(joint, '', world)
    gravity = [_float(number) for number in (places[0].findtext('gravity') or '').split()]
    if len(gravity) == 3:
        if not any(gravity):
            world.afloat.update(world.weights)
        world.faults += other_gravity(np.array(gravity))
    return _plan(world)


def _plan(world: _World) -> Plan:
    bodies = {link: world.body(link) for link in (
        {*world.weights, *(str(solid.body) for solid in world.solids)})}
    fixed = {world.body(link) for link in world.fixed}
    parts: dict[str, list[Weight]] = {}
    for link, weight in world.weights.items():
        parts.setdefault(bodies[link], []).append(weight)
    solids = [solid._replace(body=bodies[str(solid.body)]) for solid in world.solids]

    def may_touch(a: int, b: int) -> bool:
        model = world.models[a]
        return bool(world.bits[a] & world.bits[b]) and (
            model != world.models[b] or model in world.collides)

    heavy = {world.body(link) for link in {*world.weights} - world.afloat}
    return plan_of_bodies(solids, set(fixed), {body: total(weights) for body, weights in
                                               parts.items() if body not in fixed},
                          may_touch, world.faults, is_whole=not world.missing,
                          afloat={world.body(link) for link in world.afloat} - heavy)


def _read_state(state: Element, world: _World) -> None:
    """Take the poses of models and links of a saved state; both are in the world's frame."""
    for model in state.findall('model'):
        name = model.get('name', '')
        scale = model.findtext('scale', '1').split()
        if any(_float(factor) != 1.0 for factor in scale):
            world.fault('dimension', name, f'<state> scales it by {" ".join(scale)}: left out')
            world.state[name] = np.full(7, np.nan)
            continue
        for part in (model, *model.findall('link')):
            path = name if part is model else f'{name}::{part.get("name")}'
            if part.find('pose') is not None:
                try:
                    world.state[path] = pose_of(part, {WORLD})[0]
                except Unreadable as error:
                    world.fault(error.kind, path, f'in <state>, {error}')
    for part in state.findall('insertions/model'):
        world.fault('shape', part.get('name', ''), '<state> inserts it: not read', 'part')
        world.missing += 1


def _read_includes(place: Element, scope: str, world: _World) -> None:
    for part in place.findall('include'):
        if (part.findtext('uri') or '').strip() in LIGHTS:
            continue
        world.fault('shape', scope + (part.findtext('name') or part.findtext('uri') or 'include'),
                    'is included from another file: not read', 'part')
        world.missing += 1


def _read_model(model: Element, scope: str, frame: np.ndarray, is_static: bool, world: _World,
                ) -> None:
    """Take the links of a model and of those within it; frame: that of what it is in."""
    name = scope + model.get('name', '')
    is_static = is_static or _flag(model, 'static')
    if name in world.names:
        world.fault('twice', name, 'two models have this name: the second is left out', 'place')
        return
    world.names.add(name)
    try:
        if model.get('placement_frame'):
            raise Unreadable('pose', f'the placement_frame {model.get("placement_frame")} is not '
                                     'read')
        pose = within(frame, pose_of(model, {WORLD} if not scope else {'__model__'})[0])
    except Unreadable as error:
        world.fault(error.kind, name, f'{error}: left out')
        return
    pose = world.state.get(name, pose)
    if np.isnan(pose).all():
        return
    if _flag(model, 'self_collide'):
        world.collides.add(name.split('::')[0])
    _read_includes(model, f'{name}::', world)
    for link in model.findall('link'):
        _read_link(link, f'{name}::', pose, is_static, world)
    for part in model.findall('model'):
        _read_model(part, f'{name}::', pose, is_static, world)
    for joint in model.findall('joint'):
        _read_joint(joint, f'{name}::', world)


def _read_link(link: Element, scope: str, frame: np.ndarray, is_static: bool, world: _World,
               ) -> None:
    name = scope + link.get('name', '')
    try:
        own = pose_of(link, {'__model__'})[0]
    except Unreadable as error:
        world.fault(error.kind, name, f'{error}: left out')
        return
    pose = world.state.get(name, within(frame, own))
    if is_static:
        world.fixed.add(name)
    volume = 0.0
    for part in link.findall('collision'):
        path = f'{name}::{part.get("name", "")}'
        try:
            kind, size = shape_of(part)
            turn, base = pose_of(part, {'__model__', link.get('name', '')})
            place = within(frame if base == '__model__' else pose, turn)
            if kind == 'plane':
                place = within(place, _upright(part))
        except Unreadable as error:
            world.fault(error.kind, path, f'{error}: left out')
            continue
        if path in world.names:
            world.fault('twice', path, 'two collisions have this name')
        world.names.add(path)
        if kind == 'box' and size:
            volume += abs(math.prod(size))
        world.solids.append(Solid(path, kind, size, place, name))
        world.bits.append(_bits(part, path, world))
        world.models.append(name.split('::')[0])
    if (link.findtext('gravity') or '').strip().lower() in ('false', '0'):
        world.afloat.add(name)
    try:
        world.weights[name] = _weight(link, pose, volume)
    except Unreadable as error:
        world.fault(error.kind, name, f'{error}: its mass is taken as 0')
        world.weights[name] = Weight(0.0, pose[:3])


def _read_joint(joint: Element, scope: str, world: _World) -> None:
    """Join the links of a joint; a link that is not read holds the other one."""
    links = []
    for side in ('parent', 'child'):
        text = (joint.findtext(side) or '').strip()
        links.append(WORLD if text == WORLD else scope + text)
    known = [link for link in links if link in world.weights]
    if len(known) == 2:
        world.join(*known)
    elif known:
        world.fixed.add(known[0])
        if WORLD not in links:
            world.fault('shape', known[0], f'is joined to {", ".join({*links} - {*known})}, which '
                                           'is not read: taken as fixed', 'judgement')


def pose_of(part: Element, bases: set[str]) -> tuple[np.ndarray, str]:
    """Return a part's <pose> as x y z qx qy qz qw, and the frame that it names, if one of bases.

    Raises Unreadable for what is no pose, and for one that is relative to another frame.
    """
    pose = part.find('pose')
    if pose is None:
        return HERE, ''
    base = pose.get('relative_to') or pose.get('frame') or ''
    if base and base not in bases:
        raise Unreadable('pose', f'its pose is relative to {base}, which is not read')
    text = (pose.text or '').split()
    form = pose.get('rotation_format', 'euler_rpy')
    count = {'euler_rpy': 6, 'quat_xyzw': 7}.get(form)
    if count is None:
        raise Unreadable('pose', f'its pose has the rotation_format {form}, which is not known')
    numbers = [_float(number) for number in text] or list(HERE[:count - 1]) + [float(count == 7)]
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise Unreadable('pose', f'its pose is {" ".join(text)!r}, not {count} numbers')
    if count == 7:
        return np.array(numbers), base
    turn = np.array(numbers[3:])
    if pose.get('degrees', 'false').strip() in ('true', '1'):
        turn = np.radians(turn)
    (sr, sp, sy), (cr, cp, cy) = np.sin(turn / 2.0), np.cos(turn / 2.0)
    return np.array([*numbers[:3], sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                     cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy]), base


def shape_of(part: Element) -> tuple[str, tuple[float, ...] | None]:
    """Return the kind of a collision's shape, and the extents of its bounding box, if known."""
    shape = next(iter(part.find('geometry') or ()), None)
    if shape is None:
        return 'empty', None
    if shape.tag == 'box':
        return 'box', _numbers(shape, 'size', 3)
    if shape.tag == 'plane':
        return 'plane', (1.0, 1.0, 1.0)
    if shape.tag == 'ellipsoid':
        return shape.tag, tuple(2.0 * radius for radius in _numbers(shape, 'radii', 3))
    if shape.tag in ('sphere', 'cylinder', 'capsule', 'cone'):
        radius, = _numbers(shape, 'radius', 1)
        length = 0.0 if shape.tag == 'sphere' else _numbers(shape, 'length', 1)[0]
        height = length + (2.0 * radius if shape.tag in ('sphere', 'capsule') else 0.0)
        return shape.tag, (2.0 * radius, 2.0 * radius, height)
    return shape.tag, None


def _numbers(part: Element, key: str, count: int) -> tuple[float, ...]:
    text = (part.findtext(key) or '').split()
    numbers = tuple(map(_float, text))
    if len(numbers) != count or any(map(math.isnan, numbers)):
        raise Unreadable('dimension', f'its <{key}> is {" ".join(text)!r}, not {count} numbers')
    return numbers


def _float(text: str) -> float:
    """Return the number of a text; NaN: it has none."""
    try:
        return math.nan if '_' in text else float(text)
    except ValueError:
        return math.nan


def _flag(part: Element, key: str) -> bool:
    return (part.findtext(key) or '').strip().lower() in ('true', '1')


def _upright(part: Element) -> np.ndarray:
    """Return the pose of a frame whose z axis is the normal of a plane."""
    plane = part.find('geometry/plane')
    if plane is None or plane.find('normal') is None:
        return HERE
    normal = np.array(_numbers(plane, 'normal', 3))
    length = np.linalg.norm(normal)
    if not 0.0 < length < np.inf:
        raise Unreadable('shape', 'its <normal> has no length')
    x, y, z = normal / length
    half = math.sqrt((1.0 + z) / 2.0) if z > -1.0 else 0.0
    turn = [-y / (2.0 * half), x / (2.0 * half), 0.0, half] if half > 1e-8 else [1.0, 0, 0, 0]
    return np.array([0.0, 0.0, 0.0, *turn])


def _bits(part: Element, name: str, world: _World) -> int:
    text = (part.findtext('surface/contact/collide_bitmask') or '').strip()
    try:
        return int(text, 0) if text else ALL_BITS
    except ValueError:
        world.fault('shape', name, f'its collide_bitmask {text!r} is not known: taken as all',
                    'judgement')
        return ALL_BITS


def _weight(link: Element, frame: np.ndarray, volume: float) -> Weight:
    """Return mass and centre of a link; volume: of its boxes [m³]."""
    inertial = link.find('inertial')
    if inertial is None:
        return Weight(MASS, frame[:3])
    place = within(frame, pose_of(inertial, {link.get('name', '')})[0])
    if (inertial.get('auto') or '').strip() in ('true', '1'):
        density = _float(inertial.findtext('density') or str(DENSITY))
        return Weight(min(density * volume, MASS_MAX) if density > 0.0 else 0.0, place[:3])
    mass = _float(inertial.findtext('mass') or str(MASS))
    if not 0.0 <= mass <= MASS_MAX:
        raise Unreadable('mass', f'its mass is {inertial.findtext("mass")}')
    return Weight(mass, place[:3])
