# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Starts the workbench.

    from fam_bundle_ros.workbench.main import run
    run('data.csv', 'model.yaml')
"""

from contextlib import suppress
from pathlib import Path
import secrets
import socket

from fam_bundle_ros import palette
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.workbench.cases import Case
from fam_bundle_ros.workbench.guard import Guard, LOCAL
from fam_bundle_ros.workbench.incoming import Incoming
from fam_bundle_ros.workbench.intake import incoming_from_path, MAX_UPLOAD
from fam_bundle_ros.workbench.muscle import MuscleForm

_SHORTEST_TOKEN = 8


def run(data: str | Path | None = None, model: str | Path | None = None,
        host: str = '127.0.0.1', port: int = 8080, token: str | None = None,
        show: bool = True) -> None:
    """
    Serve the page until Ctrl-C.

    Parameters
    ----------
    data : path, optional
        Measurement to open at the start.
    model : path, optional
        The model to start from; without it the page asks for the muscle.
    host : str
        An address other than this machine's own needs a token.
    port : int
    token : str, optional
        Secret for the browser; it is asked for once and kept in a cookie.
    show : bool
        Open a browser.

    Raises
    ------
    InputError
        For bad files, a busy port, another address without a token, or where the extra `web` is
        not installed.
    """
    _check_address(host, port, token)
    first = first_case(data, model)
    try:
        from nicegui import app, ui

        from fam_bundle_ros.workbench.page import register
    except ModuleNotFoundError as error:
        raise InputError(f"the workbench needs {error.name}: pip install "
                         "'fam_bundle_ros[web,tools]'") from error

    register(first)
    hosts = LOCAL if host in LOCAL else ()
    app.add_middleware(Guard, hosts=hosts, token=token or '', max_body=MAX_UPLOAD + (1 << 20))
    address = f'http://{f"[{host}]" if ":" in host else host}:{port}/'
    if host not in LOCAL:
        print(f'workbench: open to other machines at {address} with the token')
    else:
        print(f'workbench: {address} (this machine only; Ctrl-C ends it)')
    # Ctrl-C is the normal end
    with suppress(KeyboardInterrupt):
        ui.run(host=host, port=port, title='fam_bundle workbench', reload=False, dark=None,
               show=f'/?token={token}' if show and token else show, tailwind=False,
               show_welcome_message=False, storage_secret=secrets.token_hex(16), favicon=_ICON,
               reconnect_timeout=30.0)


def first_case(data: str | Path | None, model: str | Path | None) -> Case | Incoming | None:
    """
    Return what to open first, None for the start page; InputError for files that cannot be used.

    Without a model, or where a column is in doubt, the page asks before anything is computed.
    """
    if data is None:
        if model is not None:
            raise InputError(f'{model}: a model needs data to be compared with; give DATA too')
        return None
    path = Path(data)
    if not path.exists():
        raise InputError(f'{path}: no such file; expected a measurement or a ROS 2 bag')
    incoming = incoming_from_path(path)
    if model is None:
        return incoming
    bundle = load_model(model)
    incoming.muscle = MuscleForm.of(bundle)
    seen = incoming.look()
    if seen.measurement is None:
        return incoming
    return Case(seen.name, f'file {path.name}', seen.measurement, bundle,
                (str(path), str(model)), incoming)


def _check_address(host: str, port: int, token: str | None) -> None:
    if token is not None and (len(token) < _SHORTEST_TOKEN or not token.isascii()
                              or not token.isalnum()):
        raise InputError(f'the token must be at least {_SHORTEST_TOKEN} letters and digits')
    if host not in LOCAL and token is None:
        raise InputError(f'{host} can be reached from other machines: set a token (--token), or '
                         'leave the address at 127.0.0.1')
    if not 1 <= port <= 65535:
        raise InputError(f'port {port}: expected 1 to 65535')
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise InputError(f'cannot serve at {host}, port {port} ({error.strerror}); try '
                             'another --port') from error


_ICON = ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
         f'<path d="M5 4v24h23" fill="none" stroke="{palette.ICON[0].light}" stroke-width="3"/>'
         f'<path d="M9 8h6v8h6v8h6" fill="none" stroke="{palette.ICON[1].light}" '
         'stroke-width="4"/></svg>')
