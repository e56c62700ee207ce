"""Box-box contact for simulators: whether two boxes touch, where, and which way they push.

Names that are exported here are the stable Python API. Those of scenes and forces are loaded when
they are first used, so `import box_contact_ros` stays cheap.
"""
from importlib import import_module as _import_module
from typing import TYPE_CHECKING, Any

from .solver.contact import Contact, Contacts
from .solver.contact_solver import ContactSolver
from .solver.models import MODELS

if TYPE_CHECKING:
    from .scene.files.scene_file import SceneError, read_scene
    from .scene.force.held_wrench import HeldWrench
    from .scene.force.patch_law import PatchLaw
    from .scene.scene_solver import Scene, SceneSolver

__all__ = ['MODELS', 'Contact', 'ContactSolver', 'Contacts', 'HeldWrench', 'PatchLaw', 'Scene',
           'SceneError', 'SceneSolver', 'read_scene']

_LOADED_WHEN_USED = {'HeldWrench': 'scene.force.held_wrench', 'PatchLaw': 'scene.force.patch_law',
                     'Scene': 'scene.scene_solver', 'SceneError': 'scene.files.scene_file',
                     'SceneSolver': 'scene.scene_solver', 'read_scene': 'scene.files.scene_file'}


def __getattr__(name: str) -> Any:
    """Return an exported name whose module was not imported yet."""
    if name not in _LOADED_WHEN_USED:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(_import_module(f'.{_LOADED_WHEN_USED[name]}', __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the exported names too that were not used yet."""
    return sorted({*globals(), *__all__})
