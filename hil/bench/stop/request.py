"""One HTTP request of a stop button, read and answered: a small, plain POST and nothing else."""

from __future__ import annotations

import json
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

LONGEST_HEAD, LONGEST_BODY = 8192, 1024


class BadRequestError(Exception):
    """What came is no request that this listener takes.

    Attributes:
        status: of the answer.
    """

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True, slots=True)
class Request:
    """A request that is there whole."""

    method: str
    path: str
    origin: str
    fields: dict[str, str]


def request_in(received: bytes) -> Request | None:
    """The request in what was received so far; None while some of it is missing.

    Raises:
        BadRequestError: it will never be one.
    """
    head, end, body = received.partition(b"\r\n\r\n")
    if len(head) > LONGEST_HEAD:
        raise BadRequestError(413, f"a head of more than {LONGEST_HEAD} bytes")
    if not end:
        return None
    first, *lines = head.decode("latin-1").split("\r\n")
    words = first.split(" ")
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        raise BadRequestError(400, "no HTTP/1 request")
    headers = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    length = _length(headers)
    if len(body) < length:
        return None
    return Request(words[0], words[1].partition("?")[0], headers.get("origin", ""), _fields(body[:length]))


def response(status: int, content: Any, origin: str = "") -> bytes:
    """An answer as it is sent; `origin`: of a page that may read it."""
    body = b"" if status == 204 else json.dumps(content, ensure_ascii=False).encode()
    head = [
        f"HTTP/1.1 {status} {HTTPStatus(status).phrase}", "Content-Type: application/json; charset=utf-8",
        f"Content-Length: {len(body)}", "Cache-Control: no-store", "X-Content-Type-Options: nosniff", "Vary: Origin",
        "Connection: close",
    ]  # fmt: skip
    if origin:
        head += [
            f"Access-Control-Allow-Origin: {origin}", "Access-Control-Allow-Methods: POST",
            "Access-Control-Allow-Headers: Content-Type", "Access-Control-Allow-Private-Network: true",
        ]  # fmt: skip
    return "\r\n".join(head).encode("latin-1") + b"\r\n\r\n" + body


def _length(headers: dict[str, str]) -> int:
    if "transfer-encoding" in headers:
        raise BadRequestError(411, "Content-Length is required")
    length = headers.get("content-length", "0")
    if not length.isascii() or not length.isdecimal():
        raise BadRequestError(400, f"Content-Length {length:.20}: a number was expected")
    if len(length) > 9 or int(length) > LONGEST_BODY:
        raise BadRequestError(413, f"a body of more than {LONGEST_BODY} bytes")
    return int(length)


def _fields(body: bytes) -> dict[str, str]:
    try:
        form = parse_qs(body.decode("ascii"), keep_blank_values=True, max_num_fields=8)
    except ValueError as error:
        raise BadRequestError(400, f"no form: {error}") from None
    return {name: values[0] for name, values in form.items()}
