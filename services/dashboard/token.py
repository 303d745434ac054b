"""Token that every request for the page has to show: in a header, once in the address, then in a
cookie.
"""

from __future__ import annotations

import hashlib
import hmac
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

_NAME = "slopewise"


def has_valid_token(environ: dict[str, Any], token: str) -> bool:
    """Return True if a request shows the token."""
    kind, _, credential = environ.get("HTTP_AUTHORIZATION", "").partition(" ")
    shown = [credential] if kind.lower() == "bearer" else []
    shown += parse_qs(environ.get("QUERY_STRING", "")).get("token", [])
    try:
        cookies = SimpleCookie(environ.get("HTTP_COOKIE", ""))
    except CookieError:
        cookies = SimpleCookie()
    if _NAME in cookies and _equal(cookies[_NAME].value, _digest(token)):
        return True
    return any(_equal(value, token) for value in shown)


def cookie(token: str) -> str:
    """Cookie that replaces the token in the address of later requests."""
    return f"{_NAME}={_digest(token)}; HttpOnly; SameSite=Strict; Path=/"


def _digest(token: str) -> str:
    return hashlib.sha256(f"page {token}".encode()).hexdigest()


def _equal(a: str, b: str) -> bool:
    return hmac.compare_digest(a.encode(), b.encode())
