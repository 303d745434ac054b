"""Names of models and surfaces as C and C++ may have them."""

from __future__ import annotations

import re
import unicodedata

# Keywords of C++20, and names that a program or its headers have already.
_RESERVED = (
    "alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t "
    "char16_t char32_t class compl concept const consteval constexpr constinit const_cast "
    "continue co_await co_return co_yield decltype default delete do double dynamic_cast else "
    "enum explicit export extern false float for friend goto if inline int long main mutable "
    "namespace new noexcept not not_eq nullptr operator or or_eq private protected public "
    "register reinterpret_cast requires return short signed sizeof slopewise static "
    "static_assert static_cast std struct switch template this thread_local throw true try "
    "typedef typeid typename union unsigned using virtual void volatile wchar_t while xor "
    "xor_eq"
)
_TAKEN = frozenset(_RESERVED.split())


def letters_of(name: str) -> str:
    """Letters, digits and single underscores of a name, without accents; no `_` first."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^0-9A-Za-z]+", "_", plain).lstrip("_")


def identifier(name: str) -> str:
    """A name as that of a variable or a file of code."""
    letters = letters_of(name)
    if not letters or letters[0].isdigit() or letters in _TAKEN:
        return f"model_{letters}".rstrip("_")
    return letters
