# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server: viser's, behind a door that lets in this page's own browsers alone. No ROS.

Any website may send requests to 127.0.0.1 from its visitors' browsers. Such a request has the
website's Origin, or the website's name as Host where that name was made to lead here (DNS
rebinding).
"""
from __future__ import annotations

import asyncio
import contextlib
import io
import ipaddress
import logging
import socket
from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import viser
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

LEAVE_SECONDS = 0.2  # for clients to take leave at the end; of one that stands still it is taken
NO_FRAMES = {'Content-Security-Policy': "frame-ancestors 'none'"}
"""Clicks of a website's visitors could be led onto a page that the website shows in a frame."""


def refusal(headers: Headers, name: str) -> str:
    """Return why a request is not one of this page's, or ''; `name` is what the page is served at.

    An address and localhost cannot be rebound. A client without Origin is no browser.
    """
    hosts, origins = headers.get_all('Host'), headers.get_all('Origin')
    if len(hosts) != 1 or not _leads_here(hosts[0], name):
        return 'open the page by its address, or give the name to --host'
    if any(origin.partition('://')[2] != hosts[0] for origin in origins):
        return 'another website asks'
    return ''


def _leads_here(host: str, name: str) -> bool:
    """Return whether the Host of a request, with or without a port, leads here for certain."""
    try:
        found = urlsplit(f'//{host}').hostname or ''
        if found in ('localhost', name.lower()):
            return True
        ipaddress.ip_address(found)
    except ValueError:
        return False
    return True


class PageServer(viser.ViserServer):
    """A viser server that answers its own page alone, and has no public tunnel."""

    def __init__(self, host: str, port: int) -> None:
        """Serve at a port, or the next that is free. Raises OSError."""
        # viser would wait for ever for a server that cannot start.
        with socket.create_server((host, 0), family=socket.getaddrinfo(host, 0)[0][0]):
            pass
        # Browsers open connections on suspicion, and close them unused; that is no error.
        logging.getLogger('websockets').setLevel(logging.CRITICAL)
        self._name = host
        self._loop: asyncio.AbstractEventLoop | None = None
        original = websockets_server.serve
        websockets_server.serve = partial(self._serve, original)  # type: ignore[assignment, misc]
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # viser greets
                super().__init__(host, port, 'box_contact_ros', verbose=False)
        finally:
            websockets_server.serve = original  # type: ignore[misc]
        if self._loop is None:
            super().stop()
            raise RuntimeError(f'viser {viser.__version__} does not serve by websockets.serve')

    def request_share_url(self, verbose: bool = True) -> None:
        """Open no tunnel: any client may ask for one, with or without a button."""

    def disconnect_share_url(self) -> None:
        """Do nothing: viser would print a line each time that a client asks."""

    def stop(self) -> None:
        """End the server, also where clients stand still."""
        assert self._loop is not None
        self._loop.call_soon_threadsafe(self._loop.call_later, LEAVE_SECONDS, self._abort)
        with contextlib.redirect_stdout(io.StringIO()):
            super().stop()

    def _serve(self, serve: Callable[..., Any], *args: Any,
               process_request: Callable[..., Any], **options: Any) -> Any:
        """Return what websockets' `serve` gives, with a door before each request."""
        def process(connection: ServerConnection, request: Request) -> Response | None:
            reason = refusal(request.headers, self._name)
            response: Response | None = (connection.respond(403, f'refused: {reason}\n') if reason
                                         else process_request(connection, request))
            if response is not None:
                response.headers.update(NO_FRAMES)
            return response

        self._loop = asyncio.get_running_loop()
        self._served = serve(*args, process_request=process, **options)
        return self._served

    def _abort(self) -> None:
        for connection in list(self._served.server.handlers):
            connection.transport.abort()
