"""Who may see the page: this machine alone, or whoever has the token.

Every request passes here.  The ``Host`` header is checked against a foreign name that was made to point at this
machine, the ``Origin`` header against other pages in the same browser, the token against everybody else.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Final
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from config.checks import is_loopback

COOKIE: Final = "lacuna_token"
HEADERS: Final = {
    # plotly writes style attributes and draws its picture export through blob: and data: addresses.
    "content-security-policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-cache",
}


@dataclass(frozen=True, slots=True)
class Access:
    """The rule: with ``token`` None only loopback names are answered, otherwise only those who know the token."""

    token: str | None = None

    def refusal(self, headers: Headers, method: str, kind: str) -> tuple[int, str] | None:
        """Return the status and the reason why a request is refused, None where it may pass."""
        host = headers.get("host", "")
        if self.token is None and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            return 421, "This page is for this machine only; open it as http://127.0.0.1 with its port."
        if self.token is not None and not self._knows(headers):
            return 403, "A token is needed: open the address that 'lacuna dashboard' has printed."
        if (kind == "websocket" or method not in ("GET", "HEAD")) and headers.get("origin", "") != _origin(
            headers, host
        ):
            return 403, "Requests from other pages are refused."
        return None

    def fits(self, given: str) -> bool:
        """Tell whether ``given`` is the token, in constant time."""
        return self.token is not None and hmac.compare_digest(given.encode(), self.token.encode())

    def _knows(self, headers: Headers) -> bool:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and self.fits(cookie.value)


class Guard:
    """ASGI application around another one: refuses by ``Access``, adds the security headers."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or websocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        with_headers = _adding_headers(send)
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if scope["type"] == "http" and scope["path"] == "/" and self._access.fits(given):
            # The token leaves the address bar, so that it is not shown around or kept in the history.
            welcome = RedirectResponse("/", 303)
            welcome.set_cookie(COOKIE, given, httponly=True, samesite="strict")
            await welcome(scope, receive, with_headers)
            return
        refusal = self._access.refusal(Headers(scope=scope), scope.get("method", ""), scope["type"])
        if refusal is None:
            await self._app(scope, receive, with_headers)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refusal[1]})
        else:
            await PlainTextResponse(refusal[1] + "\n", refusal[0])(scope, receive, with_headers)


def _origin(headers: Headers, host: str) -> str:
    """Origin of our own page; the scheme is taken from the request, for a proxy may speak https for us."""
    scheme = urlsplit(headers.get("origin", "")).scheme
    return f"{scheme if scheme in ('http', 'https') else 'http'}://{host}"


def _adding_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return send_with_headers
