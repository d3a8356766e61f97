"""What every answer says to the browser: nothing from elsewhere, nothing inline, in no frame of others."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_KEPT = "private, max-age=31536000, immutable"


class Headers:
    """Adds them to every answer that has none of its own.

    Args:
        app: the console.
        listeners: where pages may reach the listeners of runs, in the words of a Content-Security-Policy.
    """

    def __init__(self, app: ASGIApp, listeners: str) -> None:
        self._app = app
        self._always = {
            "Content-Security-Policy": (
                f"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src 'self'; "
                f"connect-src 'self' {listeners}; frame-src 'self'; form-action 'self'; base-uri 'none'; "
                "frame-ancestors 'none'"
            ),
            "X-Content-Type-Options": "nosniff", "Referrer-Policy": "same-origin", "X-Frame-Options": "DENY",
            "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Resource-Policy": "same-origin",
        }  # fmt: skip

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An ASGI call."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        # Pages ask for scripts by their contents: kept by the browser, the stop key works as soon as a page begins.
        is_marked = scope["path"].startswith("/static/") and bool(scope["query_string"])

        async def answered(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._always.items():
                    headers.setdefault(name, value)
                headers.setdefault("Cache-Control", _KEPT if is_marked and message["status"] == 200 else "no-store")
            await send(message)

        await self._app(scope, receive, answered)
