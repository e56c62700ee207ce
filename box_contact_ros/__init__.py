"""Box-box contact for simulators: whether two boxes touch, where, and which way they push.

Names that are exported here are the stable Python API.
"""
from .scene.files.scene_file import SceneError, read_scene, write_scene
from .scene.force.held_wrench import HeldWrench
from .scene.force.patch_law import PatchLaw
from .scene.scene_solver import Box, Pair, Scene, SceneSolver
from .solver.contact import Contact, Contacts
from .solver.contact_solver import ContactSolver
from .solver.models import MODELS

__all__ = ['MODELS', 'Box', 'Contact', 'ContactSolver', 'Contacts', 'HeldWrench', 'Pair',
           'PatchLaw', 'Scene', 'SceneError', 'SceneSolver', 'read_scene', 'write_scene']
