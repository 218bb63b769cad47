"""The page's server: static files, one websocket for what is new, one address for requests.  Nothing from elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Final

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from daemon.requests import LARGEST_BYTES, Refusal, parse, refused
from tools.dashboard.access import Access, Guard
from tools.dashboard.bridge import Bridge, Browser
from tools.dashboard.peer import Peer, failure

STATIC: Final = Path(__file__).parent / "static"
_MOST_BROWSERS: Final = 16


def application(peer: Peer, access: Access) -> ASGIApp:
    """Return the ASGI application of the page for the daemon at ``peer``."""
    bridge = Bridge(peer)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        listening = asyncio.create_task(bridge.run())
        try:
            yield
        finally:
            listening.cancel()
            await asyncio.wait([listening])

    async def live(websocket: WebSocket) -> None:
        await _live(websocket, bridge)

    async def ask(request: Request) -> Response:
        return await _ask(request, peer)

    routes = [
        Route("/", _page),
        Route("/plotly.min.js", _plotly),
        Route("/api/request", ask, methods=["POST"]),
        WebSocketRoute("/ws", live),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), access)


def serve(app: ASGIApp, listener: socket.socket) -> None:
    """Answer on ``listener`` until Ctrl-C or SIGTERM."""
    options = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=1024,
        ws_per_message_deflate=False,  # packing costs more than a loopback's or a cable's bytes
        timeout_graceful_shutdown=1,
    )
    uvicorn.Server(options).run(sockets=[listener])


async def _page(_: Request) -> Response:
    return FileResponse(STATIC / "index.html")


async def _plotly(_: Request) -> Response:
    # Found, not imported: importing plotly takes a second and only its bundled script is wanted.
    found = importlib.util.find_spec("plotly")
    script = Path(found.origin or "").parent / "package_data" / "plotly.min.js" if found else None
    if script is None or not script.is_file():
        return PlainTextResponse("plotly is not installed: pip install 'lacuna[laptop]'\n", 404)
    return FileResponse(script, headers={"cache-control": "max-age=86400"})


async def _live(websocket: WebSocket, bridge: Bridge) -> None:
    await websocket.accept()
    if len(bridge) >= _MOST_BROWSERS:
        await websocket.close(1013, "too many pages are open")
        return
    browser = bridge.join()
    both = [asyncio.create_task(each) for each in (_send(websocket, browser), _until_gone(websocket))]
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        bridge.leave(browser)
        for each in both:
            each.cancel()
        await asyncio.gather(*both, return_exceptions=True)


async def _until_gone(websocket: WebSocket) -> None:
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass  # the page says nothing here; its requests come as POST


async def _send(websocket: WebSocket, browser: Browser) -> None:
    while True:
        await browser.news.wait()
        browser.news.clear()
        while (frame := browser.outbox.take()) is not None:
            # Waits while the browser is slow; the outbox meanwhile keeps the newest only.
            await websocket.send_bytes(frame)


async def _ask(request: Request, peer: Peer) -> Response:
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        # A form of another page can send text, but not this type without asking first.
        return JSONResponse(failure("malformed", "Requests are JSON.", "Send Content-Type: application/json."), 415)
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > LARGEST_BYTES:
            break
    said = parse(body)
    if isinstance(said, Refusal):
        return Response(refused(said), 400, media_type="application/json")
    return JSONResponse(await peer.ask(body))
