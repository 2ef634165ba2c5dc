# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Access control of the page: host names, token, origin, size of uploads, content security policy.

A plain ASGI layer in front of everything, web sockets and uploads included.
"""

from collections.abc import Awaitable, Callable, MutableMapping
import hmac
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

#: Names that mean this machine.
LOCAL = ('127.0.0.1', 'localhost', '::1')
COOKIE = 'fam_bundle_token'
#: Vue compiles templates in the page, hence unsafe-eval; other sources are forbidden.
_POLICY = ("default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
           "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
           "font-src 'self' data:; connect-src 'self' data: blob:; worker-src 'self' blob:; "
           "object-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'")
_HEADERS = [(b'content-security-policy', _POLICY.encode()),
            (b'x-content-type-options', b'nosniff'), (b'referrer-policy', b'no-referrer'),
            (b'x-frame-options', b'DENY')]
_ASK = b"""<!doctype html><html lang="en"><meta name="viewport" content="width=device-width">
<title>fam_bundle workbench</title>
<style>body{font:16px system-ui;margin:15vh auto;max-width:24rem;padding:0 1rem}
input,button{font:inherit;padding:.4rem .6rem}</style><h1>Token needed</h1>
<p>This workbench was started for other machines too. Enter the token that it was started with.
<form method="get" action="/"><label>Token <input name="token" type="password" autofocus></label>
<button>Open</button></form></html>"""


class Guard:
    """
    ASGI middleware.

    Parameters
    ----------
    hosts : sequence of str
        Host names that requests may be for; empty for any (then a token is needed).
    token : str
        Of every request; '' for none.
    max_body : int, bytes
    """

    def __init__(self, app: Any, hosts: tuple[str, ...] = LOCAL, token: str = '',
                 max_body: int = 100 << 20):
        self.app, self.hosts, self.token, self.max_body = app, hosts, token, max_body

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope['type'] not in ('http', 'websocket'):
            await self.app(scope, receive, send)
            return
        headers = {key.decode('latin-1').lower(): value.decode('latin-1')
                   for key, value in scope['headers']}
        host = headers.get('host', '')
        if self.hosts and _name(host) not in self.hosts:
            # another site may let its own name point to this machine (DNS rebinding)
            await _refuse(scope, send, 421, b'this name is not served here')
            return
        origin = headers.get('origin')
        if origin and urlsplit(origin).netloc != host:
            await _refuse(scope, send, 403, b'requests from other sites are refused')
            return
        if self.token and not self._knows(headers):
            await self._ask(scope, send)
            return
        length = headers.get('content-length', '0')
        if not length.isdigit() or int(length) > self.max_body:
            await _refuse(scope, send, 413, b'the file is too large')
            return
        await self.app(scope, _counted(receive, self.max_body), _protected(send))

    def _knows(self, headers: dict[str, str]) -> bool:
        cookie = SimpleCookie(headers.get('cookie', ''))
        given = cookie[COOKIE].value if COOKIE in cookie else ''
        return hmac.compare_digest(given.encode(), self.token.encode())

    async def _ask(self, scope: Scope, send: Send) -> None:
        """Set a cookie if the address has the right token; ask for the token otherwise."""
        query = parse_qs(scope.get('query_string', b'').decode('latin-1'))
        given = query.get('token', [''])[0]
        right = hmac.compare_digest(given.encode(), self.token.encode())
        if scope['type'] == 'http' and right:
            cookie = f'{COOKIE}={self.token}; Path=/; HttpOnly; SameSite=Strict'
            await send({'type': 'http.response.start', 'status': 303, 'headers': [
                (b'location', b'/'), (b'set-cookie', cookie.encode()), *_HEADERS]})
            await send({'type': 'http.response.body', 'body': b''})
            return
        await _refuse(scope, send, 401, _ASK)


def _name(host: str) -> str:
    """
    Return a Host header without its port.

    Examples
    --------
    >>> _name('localhost:8080'), _name('[::1]:8080'), _name('127.0.0.1')
    ('localhost', '::1', '127.0.0.1')
    """
    if host.startswith('['):
        return host[1:].partition(']')[0]
    return host.partition(':')[0].lower()


async def _refuse(scope: Scope, send: Send, status: int, body: bytes) -> None:
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.close', 'code': 1008})
        return
    kind = b'text/html; charset=utf-8' if body.startswith(b'<') else b'text/plain'
    await send({'type': 'http.response.start', 'status': status,
                'headers': [(b'content-type', kind), *_HEADERS]})
    await send({'type': 'http.response.body', 'body': body})


def _counted(receive: Receive, most: int) -> Receive:
    """Disconnect when a body is longer than ``most`` bytes, whatever its header says."""
    total = 0

    async def limited() -> MutableMapping[str, Any]:
        nonlocal total
        message = await receive()
        if message['type'] == 'http.request':
            total += len(message.get('body', b''))
            if total > most:
                return {'type': 'http.disconnect'}
        return message

    return limited


def _protected(send: Send) -> Send:
    """Add the security headers."""
    async def with_headers(message: MutableMapping[str, Any]) -> None:
        if message['type'] == 'http.response.start':
            message['headers'] = [*message.get('headers', []), *_HEADERS]
        await send(message)

    return with_headers
