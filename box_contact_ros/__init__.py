# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Box-box contact for simulators: whether two boxes touch, where, and which way they push.

Names that are exported here are the stable Python API. Those of scenes and forces are loaded when
they are first used, so `import box_contact_ros` stays cheap.
"""
from importlib import import_module as _import_module
from typing import TYPE_CHECKING, Any

from .solver.contact import Contact, Contacts
from .solver.contact_solver import ContactSolver
from .solver.motion import Approach, Approaches, Sweep
from .solver.nearest import Nearest, Nearests

if TYPE_CHECKING:
    from .forces.patch_forces import Assembly, Body, Loads, Motion, PatchForces
    from .models.make_model import make_model
    from .node.contact_node import ContactNode as ContactNode  # noqa: F401
    from .node.yard_client import Yard as Yard  # noqa: F401
    from .node.yard_client import YardClient as YardClient  # noqa: F401
    from .plans.inspect_plan import inspect_plan
    from .plans.inspection import Fall, Inspection, Row
    from .plans.plan import Fault, Plan
    from .plans.read_plan import read_plan
    from .scene.boxes import Box, Frame, SceneError
    from .scene.path import PathCheck
    from .scene.scene import Pair, Scene
    from .scene.scene_file import read_scene
    from .scene.scene_solver import Answer, SceneSolver
    from .solver.contacts_of import TooManyNear, contacts_of
    from .solver.faces import FacePatches, face_patches
    from .solver.model import Model
    from .stream.read_contacts import ReadContacts, read_contacts

__all__ = ['Answer', 'Approach', 'Approaches', 'Assembly', 'Body', 'Box', 'Contact',
           'ContactSolver', 'Contacts', 'FacePatches', 'Fall', 'Fault', 'Frame', 'Inspection',
           'Loads', 'Model', 'Motion', 'Nearest', 'Nearests', 'Pair', 'PatchForces', 'PathCheck',
           'Plan', 'ReadContacts', 'Row', 'Scene', 'SceneError', 'SceneSolver', 'Sweep',
           'TooManyNear', 'contacts_of', 'face_patches', 'inspect_plan', 'make_model',
           'read_contacts', 'read_plan', 'read_scene']
# `ContactNode` and `YardClient` need ROS, and `import *` does without.

_LOADED_WHEN_USED = {
    'forces.patch_forces': ('Assembly', 'Body', 'Loads', 'Motion', 'PatchForces'),
    'models.make_model': ('make_model',),
    'node.contact_node': ('ContactNode',),
    'node.yard_client': ('Yard', 'YardClient'),
    'plans.inspect_plan': ('inspect_plan',),
    'plans.inspection': ('Fall', 'Inspection', 'Row'),
    'plans.plan': ('Fault', 'Plan'),
    'plans.read_plan': ('read_plan',),
    'scene.path': ('PathCheck',),
    'scene.scene_file': ('read_scene',),
    'scene.boxes': ('Box', 'Frame', 'SceneError'),
    'scene.scene': ('Pair', 'Scene'),
    'scene.scene_solver': ('Answer', 'SceneSolver'),
    'solver.contacts_of': ('TooManyNear', 'contacts_of'),
    'solver.faces': ('FacePatches', 'face_patches'),
    'solver.model': ('Model',),
    'stream.read_contacts': ('ReadContacts', 'read_contacts'),
}


def __getattr__(name: str) -> Any:
    """Return an exported name whose module was not imported yet, or the version."""
    if name == '__version__':
        return _import_module('importlib.metadata').version(__name__)
    for module, names in _LOADED_WHEN_USED.items():
        if name in names:
            globals()[name] = value = getattr(_import_module(f'.{module}', __name__), name)
            return value
    here = ': ContactSolver(size_a, size_b)(pose_a, pose_b) does it' if name == 'collide' else ''
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}{here}')


def __dir__() -> list[str]:
    """Return the exported names too that were not used yet."""
    names = (name for names in _LOADED_WHEN_USED.values() for name in names)
    return sorted({*globals(), '__version__', *names})
