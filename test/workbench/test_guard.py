# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The guard lets this machine in, others only with the token, and nobody with too much."""

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from fam_bundle_ros.workbench.guard import COOKIE, Guard, LOCAL

TOKEN = 'abcdefgh1234'


async def hello(request: Request):
    """Answer with the size of the body."""
    return PlainTextResponse(str(len(await request.body())))


async def socket(websocket):
    """Say hello on a web socket."""
    await websocket.accept()
    await websocket.send_text('hello')
    await websocket.close()


def client(host='127.0.0.1:8080', **options):
    """Return a client of a guarded application under a host name."""
    app = Starlette(routes=[Route('/', hello, methods=['GET', 'POST']),
                            WebSocketRoute('/ws', socket)])
    return TestClient(Guard(app, **options), base_url=f'http://{host}')


@pytest.mark.parametrize('host', ['127.0.0.1:8080', 'localhost:1', '[::1]:8080'])
def test_this_machine_is_let_in(host):
    """Every name of this machine works, with any port."""
    assert client(host).get('/').status_code == 200


def test_another_name_for_this_machine_fails():
    """A page elsewhere that has its own name point here gets nothing (DNS rebinding)."""
    assert client('evil.example').get('/').status_code == 421
    assert client('127.0.0.1.evil.example').get('/').status_code == 421


def test_another_origin_fails():
    """A script of another site can neither fetch nor open a socket."""
    other = {'origin': 'http://evil.example'}
    assert client().get('/', headers=other).status_code == 403
    with pytest.raises(WebSocketDisconnect), client().websocket_connect('/ws', headers=other):
        pass


def test_a_socket_of_the_page_itself_is_let_in():
    """The page's own web socket works."""
    with client().websocket_connect(
            'ws://127.0.0.1:8080/ws',
            headers={'origin': 'http://127.0.0.1:8080', 'host': '127.0.0.1:8080'}) as opened:
        assert opened.receive_text() == 'hello'


def test_without_the_token_nothing_is_served():
    """No page, no socket; the answer is the form that asks for it."""
    asked = client('10.0.0.5', hosts=(), token=TOKEN).get('/')
    assert asked.status_code == 401
    assert 'Token needed' in asked.text
    wrong = client('10.0.0.5', hosts=(), token=TOKEN).get('/?token=guess1234')
    assert wrong.status_code == 401
    with pytest.raises(WebSocketDisconnect), \
            client('10.0.0.5', hosts=(), token=TOKEN).websocket_connect('/ws'):
        pass


def test_the_token_becomes_a_cookie_and_leaves_the_address():
    """The right token opens the page; scripts cannot read the cookie."""
    made = client('10.0.0.5', hosts=(), token=TOKEN)
    answer = made.get(f'/?token={TOKEN}', follow_redirects=False)
    assert (answer.status_code, answer.headers['location']) == (303, '/')
    assert 'HttpOnly' in answer.headers['set-cookie']
    assert 'SameSite=Strict' in answer.headers['set-cookie']
    assert made.cookies[COOKIE] == TOKEN
    assert made.get('/').status_code == 200


def test_a_body_above_the_limit_fails():
    """An upload that is too large is refused by its header."""
    made = client(max_body=1000)
    assert made.post('/', content=b'x' * 1000).text == '1000'
    assert made.post('/', content=b'x' * 1001).status_code == 413


def test_a_body_that_hides_its_size_fails():
    """Chunks without a length are counted and cut off."""
    def chunks():
        for _ in range(50):
            yield b'x' * 100

    with pytest.raises(Exception):  # noqa: B017  the application sees the client go
        client(max_body=1000).post('/', content=chunks()).raise_for_status()


def test_the_browser_is_told_to_load_nothing_from_elsewhere():
    """The content policy of every answer names this server alone."""
    policy = client().get('/').headers['content-security-policy']
    assert "default-src 'self'" in policy
    assert 'http' not in policy


def test_local_names_are_local():
    """No name in the list can mean another machine."""
    assert set(LOCAL) == {'127.0.0.1', 'localhost', '::1'}
