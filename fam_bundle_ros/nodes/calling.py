# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Calls a service of a bundle that runs elsewhere, as `ros2 service call` does."""

from collections.abc import Callable
from contextlib import closing, ExitStack

from std_srvs.srv import SetBool, Trigger

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals

#: Type of each service that can be called, by its name in ROS.
_KINDS = {'std_srvs/srv/Trigger': Trigger, 'std_srvs/srv/SetBool': SetBool}
#: Time-outs for the discovery of the service, and for its answer, s.
_PATIENCE, _ANSWER = 10.0, 30.0


def call(service: str, value: bool | None = None, namespace: str = interface.NAMESPACE,
         domain: int | None = None) -> tuple[bool, str]:
    """
    Call a service of type Trigger or SetBool; return whether it succeeded, and its message.

    Parameters
    ----------
    service : str
        Name below the namespace, such as ``enable``.
    value : bool, optional
        For a service of type SetBool.
    namespace : str
    domain : int, optional
        ROS domain; that of the environment by default.

    Raises
    ------
    InputError
        If no such service is found within 10 s (names those that are), if it does not answer
        within 30 s, or if ``value`` is missing or not expected.
    KeyboardInterrupt
        After Ctrl-C.
    """
    with ExitStack() as ending:
        context = ending.enter_context(ros_context(domain))
        node = BundleNode('caller', (), context=context, namespace=namespace)
        spinner = ending.enter_context(closing(Spinner(context, [node])))
        signals = ending.enter_context(StopSignals())
        name = node.resolve_service_name(service)

        def offered() -> dict[str, str]:
            return {each: kind for each, kinds in node.get_service_names_and_types()
                    for kind in kinds if kind in _KINDS}

        def wait(done: Callable[[], bool], seconds: float) -> bool:
            found = spinner.until(done, seconds, lambda: signals.received)
            if signals.received and not found:
                raise KeyboardInterrupt
            return found

        if not wait(lambda: name in offered(), _PATIENCE):
            below = node.get_namespace().rstrip('/') + '/'
            others = sorted(each.removeprefix(below) for each in offered()
                            if each.startswith(below))
            raise InputError(f'no service {name}; ' + (
                f"expected one of {', '.join(others)}" if others else
                'is the bundle running, in this ROS domain?'))
        kind = _KINDS[offered()[name]]
        if (kind is SetBool) == (value is None):
            raise InputError(f'{name} needs true or false' if value is None else
                             f'{name} takes no value')
        client = node.create_client(kind, name)
        request = kind.Request() if value is None else SetBool.Request(data=value)
        wait(client.service_is_ready, _PATIENCE)
        future = client.call_async(request)
        if not wait(future.done, _ANSWER):
            raise InputError(f'{name} did not answer within {_ANSWER:g} s')
        answer = future.result()
        return answer.success, answer.message
