# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A viser server for our pages alone. No ROS."""
from __future__ import annotations

import contextlib
import gzip
import io
import logging
import math
import socket
from collections.abc import Iterator
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server
from websockets import Headers

MESSAGE_LIMIT, CONNECTION_LIMIT = 8 << 10, 32
"""Longest message [bytes] of a browser, which sends a few hundred; most pages open at a time."""
PHONE = """<style>@media (max-width: 600px) {
  .mantine-Paper-root:has(#verdict) { width: 100% !important; max-height: 46% !important; }
  .mantine-Paper-root:has(#verdict) div[style*="width: 20em"] { width: 100% !important; }
  div:not(.mantine-Paper-root *):has(> canvas) { height: 54vh !important; }
}</style>"""
"""On a narrow screen, viser's panel would hide the drawing: it goes below it."""
TITLE = b'<title>Contacts of boxes: box_contact_ros</title>'


class Server(viser.ViserServer):
    """A viser server that serves its own page alone.

    It opens no public tunnel, which any browser could ask for.
    """

    def __init__(self, host: str, port: int) -> None:
        """Serve at a port, or the next that is free. Raises OSError."""
        # viser would wait for ever for a server that cannot start.
        with socket.create_server((host, 0), family=socket.getaddrinfo(host, 0)[0][0]):
            pass
        # Browsers open connections on suspicion, and close them unused; that is no error.
        logging.getLogger('websockets').setLevel(logging.CRITICAL)
        with contextlib.redirect_stdout(io.StringIO()), closed_to_other_sites(host):
            super().__init__(host, port, 'box_contact_ros', verbose=False)  # viser greets
        self.gui.add_html(PHONE, order=math.inf)

    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing."""


@contextlib.contextmanager
def closed_to_other_sites(host: str) -> Iterator[None]:
    """Let a server that viser starts refuse other sites' pages, large messages and many pages.

    viser has no option for these, so its way to serve is wrapped while it starts. Raises
    RuntimeError if it serves in another way.
    """
    serve, wrapped = websockets.asyncio.server.serve, False

    def serve_own_page(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            if not names_own_page(request.headers, host):
                return connection.respond(HTTPStatus.FORBIDDEN,
                                          'Origin or Host is not of this page\n')
            if len(connection.server.connections) >= CONNECTION_LIMIT:
                return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE,
                                          f'{CONNECTION_LIMIT} pages are open: close one\n')
            return with_title(process_request(connection, request))

        nonlocal wrapped
        wrapped = True
        return serve(*arguments, **options | {'process_request': answer,
                                              'max_size': MESSAGE_LIMIT})

    websockets.asyncio.server.serve = serve_own_page
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve
    if not wrapped:
        raise RuntimeError('this viser does not serve by websockets.asyncio.server.serve, so '
                           'its page would be open to every site')


def with_title(response: Any) -> Any:
    """Return viser's response with the title of its page replaced: that of the browser's tab."""
    headers = response.headers if response else {}
    if headers.get('Content-Type', '').startswith('text/html'):
        is_packed = headers['Content-Encoding'] == 'gzip'
        text = gzip.decompress(response.body) if is_packed else response.body
        text = text.replace(b'<title>Viser</title>', TITLE, 1)
        response.body = gzip.compress(text, 1) if is_packed else text
        del headers['Content-Length']
        headers['Content-Length'] = str(len(response.body))
    return response


def names_own_page(headers: Headers, host: str) -> bool:
    """Return whether Host and Origin, where given, both name the page; host: what it serves at.

    The page of another site sends its own Origin. A site whose name leads here sends its name as
    Host, too. No site can take over an address, `localhost`, or this machine's name.
    """
    urls = [f'//{name}' for name in headers.get_all('Host')] + headers.get_all('Origin')
    if not urls:
        return True
    try:
        netloc, = {urlsplit(url).netloc for url in urls}
        name = urlsplit(f'//{netloc}').hostname or ''
        if name not in (host.lower(), 'localhost', socket.gethostname().lower()):
            ip_address(name)
    except ValueError:  # two names, or one of a stranger
        return False
    return True
