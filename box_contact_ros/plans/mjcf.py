# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MJCF and URDF, compiled by MuJoCo, in the pose that the file has.

`python -m box_contact_ros.plans.mjcf FILE` is the subprocess of `read_mjcf`, with limits of memory
and time. What joints join to each other is one body, and what they join to the world is fixed.
Geoms may touch as they may in MuJoCo: by contype and conaffinity, <pair>, <exclude> and
filterparent.
"""
from __future__ import annotations

import io
import json
import os
import resource
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..extras import require
from ..resources import open_regular, read_regular
from .bodies import UNMOVED, Solid, Weight, other_gravity, plan_of_bodies, total
from .plan import MOST_BYTES, Fault, Plan
from .sdf import parse_xml

WELDS = ('mjEQ_CONNECT', 'mjEQ_WELD')
"""Equalities that join two bodies."""
LEAST = 1e-9
"""Mass and inertia of a body whose meshes are left out: MuJoCo takes none without."""
MOST_KEYS, MOST_GEOMS = 10_000, 100_000
"""Of a model: keyframes that are not read, and shapes."""
MOST_DATA, MOST_SECONDS = 700 * 2**20, 8
"""Limits of the subprocess: memory [bytes], and time of the processor [s]."""
PATIENCE = 60.0  # for the subprocess, which may wait for a processor [s]


def read_mjcf(path: Path) -> Plan:
    """Return the plan of a model of MuJoCo, or of a robot. Raises ValueError for other files.

    Raises OSError for what the file names and is no regular file.
    """
    require('sim')
    check_named_files(path)
    with TemporaryDirectory() as folder:  # MuJoCo writes its log where it is
        try:
            done = subprocess.run(
                [sys.executable, '-m', 'box_contact_ros.plans.mjcf', path.absolute()], cwd=folder,
                stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE, env=os.environ | {
                    'OPENBLAS_NUM_THREADS': '1', 'PYTHONPATH': os.pathsep.join(sys.path)})
        except subprocess.TimeoutExpired:
            raise ValueError(f'MuJoCo reads it for more than {PATIENCE:g} s') from None
    if done.returncode == -signal.SIGXCPU:
        raise ValueError(f'MuJoCo takes more than {MOST_SECONDS} s to read it')
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            fields = dict(arrays)
            texts = json.loads(fields.pop('texts').tobytes())
    except (OSError, ValueError, KeyError):
        raise ValueError(f'MuJoCo fails at it, or needs more than {MOST_DATA >> 20} MiB') from None
    if 'refused' in texts:
        raise ValueError(texts['refused'])
    return Plan(**fields, names=texts['names'], faults=[
        Fault(kind, tuple(names), text, verdict=verdict, lacks=lacks)
        for kind, names, text, verdict, lacks in texts['faults']])


def main() -> None:
    """Write the plan of a file as arrays to stdout, or why there is none."""
    import mujoco  # noqa: F401, before its memory is limited

    resource.setrlimit(resource.RLIMIT_DATA, (MOST_DATA, MOST_DATA))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 1))
    fields: dict[str, Any] = {}
    try:
        plan = compiled_plan(Path(sys.argv[1]))
        fields = {name: getattr(plan, name) for name in (
            'sizes', 'poses', 'masses', 'ground', 'centres', 'body', 'apart')}
        texts: dict[str, Any] = {'names': plan.names, 'faults': [
            (fault.kind, fault.names, fault.text, fault.verdict, fault.lacks)
            for fault in plan.faults]}
    except MemoryError:
        texts = {'refused': f'MuJoCo needs more than {MOST_DATA >> 20} MiB to read it'}
    except Exception as error:  # MuJoCo's own are of any kind
        texts = {'refused': ' '.join(str(error).split())}
    np.savez(sys.stdout.buffer, texts=np.frombuffer(json.dumps(texts).encode(), np.uint8), **fields)


def check_named_files(path: Path) -> None:
    """Raise OSError if a file that MuJoCo would open for this one is a device, pipe or folder.

    MuJoCo looks for a file beside the first one or in the folders that <compiler> names.
    """
    paths, seen = [path], set()
    while paths:
        place = paths.pop()
        if place in seen or not place.exists():  # MuJoCo says so
            continue
        seen.add(place)
        parts = list(parse_xml(read_regular(place, MOST_BYTES)).iter())
        folders = {'', *(value for part in parts for key, value in part.items()
                         if key in ('meshdir', 'texturedir', 'assetdir'))}
        for part in parts:
            for name in {value for key, value in part.items() if key.startswith('file') and value}:
                name = name.removeprefix('package://').removeprefix('file://')
                for other in {base / folder / end for base in (path.parent, place.parent)
                              for folder in folders for end in (name, Path(name).name)}:
                    if part.tag in ('include', 'model'):
                        paths.append(other)
                    elif other.exists():
                        open_regular(other).close()


def compiled_plan(path: Path) -> Plan:
    """Return the plan of a model of MuJoCo, or of a robot. Raises ValueError for other files."""
    import mujoco

    mujoco.set_mju_user_warning(lambda text: None)  # else it writes a file in this folder
    with warnings.catch_warnings(action='ignore'):
        model, meshes = _compiled(path)
    meshes += [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, n) or f'flex {n}'
               for n in range(model.nflex)]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if model.ngeom > MOST_GEOMS:
        raise ValueError(f'it has {model.ngeom:,} shapes, more than {MOST_GEOMS:,}')
    tops = _tops(model)
    faults = [Fault('shape', tuple(meshes), f'{len(meshes)} mesh, height field, flex or SDF: no '
                                            'box, so left out', **({} if any(tops) else UNMOVED))
              ] if meshes else []
    solids = []
    for geom in range(model.ngeom):
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix('mjGEOM_').lower()
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, data.geom_xmat[geom])
        size = 2.0 * (model.geom_size[geom] if kind == 'box' else model.geom_aabb[geom, 3:])
        solids.append(Solid(
            model.geom(geom).name or f'geom {geom}', kind,
            (1.0, 1.0, 1.0) if kind == 'plane' else tuple(size),
            np.r_[data.geom_xpos[geom], turn[1:], turn[0]],  # MuJoCo puts w first
            tops[model.geom_bodyid[geom]]))
    weights: dict[int, list[Weight]] = {}
    for body in range(1, model.nbody):
        weights.setdefault(tops[body], []).append(
            Weight(float(model.body_mass[body]), data.xipos[body].copy()))
    pulls = np.zeros(model.nbody, bool)
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        pulls = (model.body_gravcomp < 1.0) & model.opt.gravity.any()
        faults += other_gravity(model.opt.gravity)
    heavy = {tops[body] for body in np.flatnonzero(pulls).tolist()}
    return plan_of_bodies(solids, {0}, {top: total(parts) for top, parts in weights.items() if top},
                          _filter(model), faults, is_whole=not meshes, afloat={*tops} - heavy)


def _compiled(path: Path) -> tuple[Any, list[str]]:
    """Return MuJoCo's model, and the names of the geoms that were left out.

    These are all meshes and height fields, if a file of theirs cannot be read.
    """
    import mujoco

    def spec() -> Any:
        model = mujoco.MjSpec.from_file(str(path))
        model.compiler.balanceinertia = True  # nothing turns here
        if model.nkey > MOST_KEYS:  # it would write them all
            raise RuntimeError(f'nkey is {model.nkey}, more than {MOST_KEYS}')
        return model

    try:
        return spec().compile(), []
    except ValueError as error:
        first = error
    except RuntimeError as error:  # such as too little memory
        raise ValueError(f'MuJoCo does not read it, or needs more than {MOST_DATA >> 20} MiB: '
                         f'{error}') from None
    try:
        model = spec()
        left_out = [geom for geom in model.geoms if geom.type in (
            mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)]
        names = [geom.name or f'mesh of {geom.parent.name}' for geom in left_out]
        for material in model.materials:
            material.textures = [''] * len(material.textures)
        for part in (*left_out, *model.meshes, *model.hfields, *model.skins, *model.textures):
            model.delete(part)
        model.compiler.boundmass = model.compiler.boundinertia = LEAST
        return model.compile(), names
    except ValueError:
        raise ValueError(f'MuJoCo does not read it: {first}') from None


def _tops(model: Any) -> list[int]:
    """Return of each body the one by which the whole that joints join is known; 0 is fixed."""
    import mujoco

    tops = [0]
    for body in range(1, model.nbody):
        first = model.body_jntadr[body]
        is_free = first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
        tops.append(body if is_free else tops[model.body_parentid[body]])
    joins = {getattr(mujoco.mjtEq, name) for name in WELDS}
    for n in range(model.neq):
        if model.eq_type[n] in joins and model.eq_active0[n]:
            ends = model.eq_obj1id[n], model.eq_obj2id[n]
            if model.eq_objtype[n] == mujoco.mjtObj.mjOBJ_SITE:
                ends = tuple(model.site_bodyid[end] for end in ends)
            low, high = sorted(tops[end] for end in ends)
            tops = [low if top == high else top for top in tops]
    return tops


def _filter(model: Any) -> Callable[[int, int], bool]:
    """Return what tells whether two geoms may touch."""
    import mujoco

    pairs = {frozenset(pair) for pair in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist())}
    excluded = {frozenset((int(bodies) >> 16, int(bodies) & 0xffff))
                for bodies in model.exclude_signature}
    weld = model.body_weldid.tolist()
    above = [weld[parent] for parent in model.body_parentid[model.body_weldid].tolist()]
    filters = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    bodies = model.geom_bodyid.tolist()
    kinds, others = model.geom_contype.tolist(), model.geom_conaffinity.tolist()

    def may_touch(a: int, b: int) -> bool:
        if frozenset((a, b)) in pairs:
            return True
        own, other = weld[bodies[a]], weld[bodies[b]]
        # The world collides with its children.
        is_parent = filters and own and other and (above[own] == other or above[other] == own)
        return (own != other and not is_parent
                and frozenset((bodies[a], bodies[b])) not in excluded
                and bool(kinds[a] & others[b] | kinds[b] & others[a]))
    return may_touch


if __name__ == '__main__':
    main()
