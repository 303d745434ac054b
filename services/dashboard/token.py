"""A word that everybody who looks at the page has to know: in a header, once in the address, then
in a cookie that only this page is sent.
"""

from __future__ import annotations

import hashlib
import hmac
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

_NAME = "slopewise"


def knows(environ: dict[str, Any], token: str) -> bool:
    """Whether a request shows the token."""
    kind, _, word = environ.get("HTTP_AUTHORIZATION", "").partition(" ")
    shown = [word] if kind.lower() == "bearer" else []
    shown += parse_qs(environ.get("QUERY_STRING", "")).get("token", [])
    try:
        kept = SimpleCookie(environ.get("HTTP_COOKIE", "")).get(_NAME)
    except CookieError:
        kept = None
    if kept is not None and _same(kept.value, _digest(token)):
        return True
    return any(_same(one, token) for one in shown)


def cookie(token: str) -> str:
    """The header that lets a browser go on without the token in its address."""
    return f"{_NAME}={_digest(token)}; HttpOnly; SameSite=Strict; Path=/"


def _digest(token: str) -> str:
    return hashlib.sha256(f"page {token}".encode()).hexdigest()


def _same(one: str, other: str) -> bool:
    return hmac.compare_digest(one.encode(), other.encode())
