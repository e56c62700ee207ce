# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of the launch files: what was given, checked by the settings of node parameters.

Objects of ROS's `launch` are used here, and nothing of it is imported: the wheels do not have it.
"""
from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import yaml

from ..solver.checks import shown
from .contact_program import PARAMETERS
from .parameters import Setting, default_text, flag, one_of, text, unknown_name


def existing_file(name: str, value: Any) -> str:
    """Check the path of a file. launch_ros only warns of one that is not there."""
    if not os.path.isfile(text(name, value)):
        raise ValueError(f'{name}: there is no file {shown(value)}')
    return str(value)


EVERY_LAUNCH = {
    'use_sim_time': Setting(False, 'whether time comes from /clock', flag),
    'namespace': Setting('', 'namespace of all nodes and topics', text),
    'log_level': Setting('info', 'least severity that is logged: debug, info, warn, error, fatal',
                         one_of(('debug', 'info', 'warn', 'error', 'fatal'))),
}
"""Arguments that are for all nodes of a launch file."""
CONTACT_NODE = EVERY_LAUNCH | {
    'params_file': Setting('the shipped config/contact_node.yaml',
                           'file of parameters; arguments override it', existing_file),
    'name': Setting('contact_node', 'name of the node', text),
    'respawn': Setting(False, 'whether the node is started anew, 2 s after it has ended', flag),
    'use_lifecycle_manager': Setting(
        False, 'whether a lifecycle manager configures and activates the node: autostart is '
        'false; the node has no bond, so bond_timeout of the manager must be 0.0', flag),
} | PARAMETERS
"""Arguments of contact_node.launch.py: the parameters of the node, and more."""
OF_LAUNCH = ('launch-prefix', 'launch-prefix-filter')  # what `ros2 launch` itself adds


def descriptions(arguments: Mapping[str, Setting]) -> dict[str, str]:
    """Return the argument's names and what `--show-args` shows of them."""
    return {name: f'{setting.description}; if left out: {default_text(setting.default)}'
            for name, setting in arguments.items()}


def given_values(context: Any, arguments: Mapping[str, Setting]) -> dict[str, Any]:
    """Return the checked values of the arguments that were given to a launch file.

    An argument whose text is empty was not given. A launch file that includes this one may have
    arguments of other names, and they reach this one too. The context does not tell whose they are.
    So names are looked up in the include itself. Raise ValueError for a name that there is not, or
    a bad value.
    """
    for name in names_passed(context):
        if name not in arguments and name not in OF_LAUNCH:
            raise ValueError(unknown_name('launch argument', name, arguments))
    texts = {name: context.launch_configurations.get(name, '') for name in arguments}
    return {name: value_of(name, given, arguments[name]) for name, given in texts.items() if given}


def value_of(name: str, given: str, setting: Setting) -> Any:
    """Return the checked value of an argument's text, or raise ValueError."""
    if isinstance(setting.default, str):
        return setting.check(name, given)
    try:
        return setting.check(name, yaml.safe_load(given))
    except yaml.YAMLError:
        return setting.check(name, given)


def names_passed(context: Any) -> list[str]:
    """Return the names of the arguments that the current launch file's include passes on to it.

    `ros2 launch` is such an include, too. An include that an event or a function brings is not
    found: it may pass any name.
    """
    local = context.get_locals_as_dict()
    root = getattr(local.get('event'), 'launch_description', None)
    file = local.get('current_launch_file_path')
    return [name if isinstance(name, str) else ''.join(part.perform(context) for part in name)
            for include in _includes([root] if root else [], file)
            for name, _ in include.launch_arguments]


def _includes(entities: Iterable[Any], file: str) -> Iterator[Any]:
    """Yield the actions below some entities of a launch description that include a file."""
    for entity in entities:
        source = getattr(entity, 'launch_description_source', None)
        if source is not None and os.path.abspath(source.location) == file:
            yield entity
            continue
        yield from _includes(entity.describe_sub_entities(), file)
        for _, more in entity.describe_conditional_sub_entities():
            yield from _includes(more, file)
