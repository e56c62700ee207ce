"""launch/ and config/ name what exists: programs, parameters, boxes.

PyPI has neither `launch` nor `launch_ros` (its `launch` is another project). So launch files are
loaded with stand-ins that only note what they are called with. Where ROS's own packages are, these
load the files, too. Where they are not, that test is skipped, and says so.
"""
from __future__ import annotations

import importlib
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from box_contact_ros.cli import PROGRAMS
from box_contact_ros.node.contact_node import PARAMETERS
from box_contact_ros.scene.files.scene_file import read_scene
from box_contact_ros.scene.scene_solver import Pair, Scene

ROOT = Path(__file__).resolve().parents[2]

# --- launch ---------------------------------------------------------------------------------------

STAND_INS = {
    'launch': ('LaunchDescription',),
    'launch.actions': ('DeclareLaunchArgument', 'Shutdown'),
    'launch.conditions': ('IfCondition',),
    'launch.substitutions': ('LaunchConfiguration',),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
    'launch_ros.parameter_descriptions': ('ParameterValue',),
}


def noting(kind: str) -> Any:
    """Return a stand-in for a class: an object of it is what it was called with."""
    return lambda *args, **options: SimpleNamespace(kind=kind, args=args, **options)


def launched(file: str, monkeypatch: pytest.MonkeyPatch,
             ) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments by name and nodes by executable of a launch file, from stand-ins."""
    for name, classes in STAND_INS.items():
        module = ModuleType(name)
        vars(module).update({kind: noting(kind) for kind in classes})
        monkeypatch.setitem(sys.modules, name, module)
    description = runpy.run_path(str(ROOT / 'launch' / file))[
        'generate_launch_description']()
    entities = description.args[0]
    assert {entity.kind for entity in entities} == {'DeclareLaunchArgument', 'Node'}
    return ({entity.args[0]: entity for entity in entities if entity.kind != 'Node'},
            {entity.executable: entity for entity in entities if entity.kind == 'Node'})


@pytest.fixture
def crane_launch(monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments by name, nodes by executable."""
    return launched('crane.launch.py', monkeypatch)


def test_the_contact_node_s_arguments_are_its_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of them, with the defaults and in the types of the table, and name and namespace."""
    arguments, nodes = launched('contact_node.launch.py', monkeypatch)
    node, = nodes.values()
    given, = node.parameters
    assert set(given) == set(PARAMETERS)
    assert set(arguments) == set(PARAMETERS) | {'name', 'namespace', 'log_level'}
    for name, value in given.items():
        setting = PARAMETERS[name]
        assert value.args[0].args == (name,)
        assert arguments[name].description == setting.description
        default = arguments[name].default_value
        if value.value_type is not str:
            default = yaml.safe_load(default)
        assert isinstance(default, getattr(value.value_type, '__origin__', value.value_type))
        assert setting.check(name, default) == setting.default
    assert node.name.args == ('name',) and node.namespace.args == ('namespace',)


@pytest.mark.parametrize('file', sorted(path.name for path in (ROOT / 'launch').glob('*.py')))
def test_ros_own_launch_takes_the_files(file: str) -> None:
    """Its arguments are found, and each node's parameters evaluate to what the node accepts."""
    pytest.importorskip('launch_ros', reason='no ROS `launch` here (wheels have none): tested with '
                                             'stand-ins only')
    import launch
    from launch_ros.actions import Node
    from launch_ros.utilities import evaluate_parameters

    checked = set()
    description = runpy.run_path(str(ROOT / 'launch' / file))['generate_launch_description']()
    context = launch.LaunchContext()
    for argument in description.get_launch_arguments():
        argument.visit(context)
    for entity in description.entities:
        if isinstance(entity, Node):
            for values in evaluate_parameters(context, entity._Node__parameters):
                for name, value in values.items():
                    table_of(entity.node_executable)[name].check(name, value)
                    checked.add(name)
    assert 'model' in checked


def table_of(program: str) -> dict[str, Any]:
    """Return the parameters of a program."""
    if program == 'crane':
        return importlib.import_module('box_contact_ros.apps.crane.crane_parameters').PARAMETERS
    return importlib.import_module(PROGRAMS[program].module).PARAMETERS


def test_launch_arguments(crane_launch: Any) -> None:
    """They are these, and each says what it is for."""
    arguments, _ = crane_launch
    assert set(arguments) == {'model', 'rate', 'seed', 'closed_loop', 'soup', 'view'}
    assert all(argument.description for argument in arguments.values())


def test_launched_programs_exist(crane_launch: Any) -> None:
    """Two always, two on request; the crane's end is everybody's."""
    _, nodes = crane_launch
    assert set(nodes) == {'contact_node', 'crane', 'soup_node', 'view'} <= set(PROGRAMS)
    assert {node.package for node in nodes.values()} == {'box_contact_ros'}
    conditions = {name: node.condition.args[0].args[0] for name, node in nodes.items()
                  if hasattr(node, 'condition')}
    assert conditions == {'soup_node': 'soup', 'view': 'view'}
    assert nodes['crane'].on_exit.kind == 'Shutdown'
    assert nodes['view'].arguments == ['--attach']  # else it starts a scene of its own


def test_launched_parameters_are_declared_with_the_same_defaults(crane_launch: Any) -> None:
    """An argument left alone changes nothing, and one that is given is taken, in its type."""
    arguments, nodes = crane_launch
    given: set[str] = set()
    for program in ('contact_node', 'crane'):
        table = table_of(program)
        for name, value in nodes[program].parameters[0].items():
            setting = table[name]
            if name == 'wait':
                assert setting.check(name, value) == value
                continue
            given.add(name)
            assert value.args[0].args == (name,)
            default = arguments[name].default_value
            if value.value_type is not str:
                default = yaml.safe_load(default)
            assert default == setting.default
            assert isinstance(default, value.value_type)
    assert given == set(arguments) - {'soup', 'view'}


# --- parameters -----------------------------------------------------------------------------------


def test_parameter_file_is_complete() -> None:
    """Every parameter of the node is in it, with its default, and no other."""
    file = yaml.safe_load((ROOT / 'config' / 'contact_node.yaml').read_text('utf-8'))
    values = file['/**']['ros__parameters']
    assert {name: setting.check(name, values[name]) for name, setting in PARAMETERS.items()} == {
        name: setting.default for name, setting in PARAMETERS.items()}
    assert set(values) == set(PARAMETERS)


def test_node_starts_with_the_parameter_file(program: Any, tmp_path: Path) -> None:
    """Also under another name; and the file's values are the ones that count."""
    text = (ROOT / 'config' / 'contact_node.yaml').read_text('utf-8')
    file = tmp_path / 'contact_node.yaml'
    file.write_text(text.replace('model: mlp', 'model: exact'), 'utf-8')
    node = program('contact_node', '--ros-args', '--params-file', str(file), '-r', '__ns:=/yard')
    assert "model 'exact'" in node.wait_for_output('ready', 120)


# --- scenes ---------------------------------------------------------------------------------------


each_scene = pytest.mark.parametrize(
    'path', sorted((ROOT / 'config' / 'scenes').glob('*.yaml')), ids=lambda path: path.stem)


def scene(name: str) -> Scene:
    return read_scene(str(ROOT / 'config' / 'scenes' / f'{name}.yaml'))


@each_scene
def test_scene_loads(path: Path) -> None:
    """The loader takes it; a pair is called after its boxes; ids follow from names."""
    for pair in read_scene(str(path)).pairs:
        assert pair == Pair.between(pair.a, pair.b)


@each_scene
def test_fixed_boxes_stand_beside_each_other(path: Path) -> None:
    """Upright, on the ground or on each other: none in another, none that floats."""
    fixed = [box for box in read_scene(str(path)).boxes.values() if box.pose]
    low = np.array([np.subtract(box.pose[:3], np.divide(box.size, 2)) for box in fixed])
    high = np.array([np.add(box.pose[:3], np.divide(box.size, 2)) for box in fixed])
    for number, box in enumerate(fixed):
        assert box.pose[3:] == (0, 0, 0, 1)
        inside = ((low < high[number] - 1e-6) & (high > low[number] + 1e-6)).all(axis=1)
        assert inside.sum() == 1, box.name  # itself
        assert low[number, 2] == pytest.approx(0) or np.isclose(high[:, 2], low[number, 2]).any()


def test_two_boxes_are_the_node_s_default() -> None:
    """The file shows how the default would be written: its boxes, and where their poses come."""
    boxes = scene('two_boxes').boxes
    assert {name: (box.size, box.pose_topic) for name, box in boxes.items()} == {
        f'box_{letter}': (PARAMETERS[f'size_{letter}'].default, f'box_{letter}/pose')
        for letter in 'ab'}
    assert scene('two_boxes').frame_id == table_of('crane')['frame_id'].default


def test_a_shipped_scene_is_short() -> None:
    """The bay of 51 boxes has at most 12 lines; what it means: test_short_forms.py."""
    text = (ROOT / 'config' / 'scenes' / 'yard_bay.yaml').read_text('utf-8')
    assert len(text.splitlines()) <= 12 and len(scene('yard_bay').boxes) == 51
