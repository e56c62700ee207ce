# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Anybody on the network: knows a node's name, and has no other rights than DDS gives to all."""
from __future__ import annotations

import time

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from raw_client import RawClient
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.qos import QoSProfile
from ros_client import PATIENCE

ANSWER_SECONDS = 1.0
"""Every request is answered within this time, whatever came before it."""


class Stranger(RawClient):
    """Calls services of a node, the contact node by default, and reads /rosout."""

    def __init__(self, target='contact_node'):
        super().__init__()
        self.target = target
        self.heard_logs: list[str] = []
        self.slowest = 0.0  # longest time to an answer [s], of requests that were made once
        self._services = {}
        self.node.create_subscription(Log, '/rosout', lambda log: self.heard_logs.append(log.msg),
                                      QoSProfile(depth=1000))

    def call(self, kind, name, **fields):
        """Return the reply of a service of the node."""
        service = self._services.get(name)
        if service is None:
            service = self._services[name] = self.client_of(kind, f'/{self.target}/{name}')
        # It may be ready before the way back is: a reply is lost then, and the request made again.
        for attempt in range(3):
            started = time.monotonic()
            future = service.call_async(kind.Request(**fields))
            if self.spin(future.done, PATIENCE / 3):
                if not attempt:
                    self.slowest = max(self.slowest, time.monotonic() - started)
                break
        assert future.done(), 'no reply'
        return future.result()

    def set(self, **values):
        """Set parameters together, strings or flags; return the result."""
        return self.call(SetParametersAtomically, 'set_parameters_atomically', parameters=[
            Parameter(name=name, value=ParameterValue(
                type=ParameterType.PARAMETER_BOOL if isinstance(value, bool)
                else ParameterType.PARAMETER_STRING,
                **{'bool_value' if isinstance(value, bool) else 'string_value': value}))
            for name, value in values.items()]).result

    def ask_for(self, transition):
        """Return whether a transition was made."""
        return self.call(ChangeState, 'change_state', transition=Transition(id=transition)).success

    def state(self):
        return self.call(GetState, 'get_state').current_state.label
