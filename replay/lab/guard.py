"""Guard: checks every request to a page that this project serves: by whom, from where, and in what form.

A browser lets any page send requests to a server of this machine. The defences, and against what:

* Host, against DNS rebinding: a name that an attacker's DNS points at 127.0.0.1 sends an Origin equal to Host, so only
  names of this machine are answered (CVE-2024-28224 is a server without this check).
* Origin, against pages of other servers: on this machine they are the same *site*, so the browser sends our cookie with
  their requests; a form of a public page is sent without preflight. Origin must be ours; ``null`` is refused.
* Token, against other users and programs of this machine: new at every start, in the printed address; then a cookie,
  HttpOnly, SameSite=Strict, with the port in its name, as cookies ignore ports.
* JSON and a header of our own on every request that changes something: neither a form nor a beacon can send them.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from collections.abc import Iterable
from dataclasses import dataclass, field
from urllib.parse import parse_qs, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost", "::1")
OWN_HEADER = "x-straw"
#: The one route that takes a file; like JSON, its type cannot be sent by a form or a beacon.
FILM = "/api/film"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "media-src 'self' data: blob:; font-src data:; connect-src 'self' {sockets}; frame-src 'self' {frames}; "
    "frame-ancestors {framed}; base-uri 'none'; form-action 'none'"
)


@dataclass(frozen=True)
class Door:
    """Where a server listens, its token, and the names it answers to; ``embedded``: a page of the same host, on another
    port, may show this one and open its socket, if it has the token."""

    host: str
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    embedded: bool = False

    @property
    def remote(self) -> bool:
        """Whether others than this machine can reach it."""
        return self.host not in LOOPBACK

    @property
    def cookie(self) -> str:
        """The cookie's name."""
        return f"straw-{self.port}"

    @property
    def url(self) -> str:
        """The address that grants access."""
        name = socket.gethostname() if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/?token={self.token}"

    def knows(self, name: str) -> bool:
        """Whether a host name is one of this machine's; an address made of digits cannot be rebound."""
        if name in LOOPBACK:
            return True
        if not self.remote:
            return False
        own = socket.gethostname().lower()
        return name.lower() in (own, f"{own}.local", self.host) or _is_address(name)


class Guard:
    """ASGI middleware: only permitted requests reach the application."""

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self.app, self.door = app, door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, or exchange the token in an address for a cookie."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = self.refusal(scope, headers)
        if refusal is not None:
            await self._refuse(refusal, scope, receive, send)
            return
        query = parse_qs(scope["query_string"].decode("latin-1"))
        if scope["type"] == "http" and "token" in query:
            await self._let_in(query, scope)(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *self._added(headers)]
            await send(message)

        await self.app(scope, receive, guarded if scope["type"] == "http" else send)

    def refusal(self, scope: Scope, headers: Headers) -> tuple[int, str] | None:
        """Why a request is not answered, as status and one line; None when it may pass."""
        host = urlsplit(f"//{headers.get('host', '')}")
        socket_asked = scope["type"] == "websocket"
        try:
            if not host.hostname or not self.door.knows(host.hostname) or (host.port or 80) != self.door.port:
                return 421, f"this server does not go by the name {headers.get('host', '')!r}"
        except ValueError:
            return 421, "the Host header is damaged"
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        by_token = bool(given) and secrets.compare_digest(given.encode(), self.door.token.encode())
        origin = headers.get("origin")
        if origin is not None and not self._own(origin, host.netloc, host.hostname, by_token):
            return 403, "a page from elsewhere asked"
        if socket_asked and origin is None and not by_token:
            return 403, "a socket needs an Origin"
        if headers.get("sec-fetch-site") in ("cross-site", "same-site") and not self.door.embedded:
            navigated = headers.get("sec-fetch-mode") == "navigate" and scope.get("method") == "GET" and origin is None
            if not navigated:
                return 403, "a page from elsewhere asked"
        if not by_token and not self._has_cookie(headers):
            return 403, "open the address that was printed in the terminal: it lets this browser in"
        if not socket_asked and scope["method"] not in ("GET", "HEAD"):
            kind = "application/octet-stream" if scope["path"] == FILM else "application/json"
            if headers.get("content-type", "").split(";")[0].strip() != kind:
                return 415, f"whatever changes something has to be sent as {kind}"
            if OWN_HEADER not in headers:
                return 403, f"the header {OWN_HEADER} is missing"
        return None

    def _own(self, origin: str, netloc: str, name: str, by_token: bool) -> bool:
        if origin == f"http://{netloc}":
            return True
        try:
            return self.door.embedded and by_token and urlsplit(origin).hostname == name
        except ValueError:
            return False

    def _has_cookie(self, headers: Headers) -> bool:
        wanted = f"{self.door.cookie}="
        found = (part.strip() for line in headers.getlist("cookie") for part in line.split(";"))
        return any(
            secrets.compare_digest(part.removeprefix(wanted).encode(), self.door.token.encode())
            for part in found
            if part.startswith(wanted)
        )

    def _let_in(self, query: dict[str, list[str]], scope: Scope) -> Response:
        rest = urlencode({key: value for key, value in query.items() if key != "token"}, doseq=True)
        answer = RedirectResponse(scope["path"] + (f"?{rest}" if rest else ""), 303)
        answer.set_cookie(self.door.cookie, self.door.token, httponly=True, samesite="strict", path="/")
        answer.headers["referrer-policy"] = "no-referrer"
        answer.headers["cache-control"] = "no-store"
        return answer

    def _added(self, headers: Headers) -> Iterable[tuple[bytes, bytes]]:
        name = urlsplit(f"//{headers['host']}").hostname or ""
        name = f"[{name}]" if ":" in name else name
        policy = POLICY.format(
            sockets=f"ws://{name}:*",
            frames=f"http://{name}:*",
            framed=f"http://{name}:*" if self.door.embedded else "'self'",
        )
        for key, value in (
            ("content-security-policy", policy),
            ("x-content-type-options", "nosniff"),
            ("referrer-policy", "no-referrer"),
            ("cross-origin-resource-policy", "same-site" if self.door.embedded else "same-origin"),
            ("cache-control", "no-store"),
        ):
            yield key.encode(), value.encode()

    async def _refuse(self, refusal: tuple[int, str], scope: Scope, receive: Receive, send: Send) -> None:
        status, why = refusal
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 4000 + status, "reason": why})  # before accept: HTTP 403
            return
        await JSONResponse({"error": why}, status)(scope, receive, send)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
