"""Certificates generated for a test, and the shipped settings that use them."""

from __future__ import annotations

import shutil
from pathlib import Path

import trustme
import zenoh

from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config

SHIPPED = Path(__file__).parents[2] / "configs" / "zenoh"
ROLES = ("service", "navigation", "mapping", "estimator", "operator", "guard", "base", "stranger")


def make(folder: Path) -> None:
    """An authority, a certificate a role, and one of a role's name by another authority."""
    tls = folder / "tls"
    tls.mkdir()
    authority = trustme.CA()
    authority.cert_pem.write_to_path(tls / "ca.pem")
    for role in ROLES:
        _issue(authority, role, tls / role)
    _issue(trustme.CA(), "operator", tls / "forged")
    for file in SHIPPED.glob("*.json5"):
        shutil.copy(file, folder)


def _issue(authority: trustme.CA, name: str, stem: Path) -> None:
    issued = authority.issue_cert("127.0.0.1", common_name=name)
    issued.private_key_pem.write_to_path(stem.with_suffix(".key"))
    chain = b"".join(pem.bytes() for pem in issued.cert_chain_pems)
    stem.with_suffix(".pem").write_bytes(chain)


def client_file(folder: Path, name: str) -> Path:
    """Settings of a client with the certificate of that name."""
    text = (folder / "mtls-client.json5").read_text()
    assert "tls/navigation.pem" in text
    file = folder / f"client-{name}.json5"
    file.write_text(text.replace("tls/navigation.", f"tls/{name}."))
    return file


def session(folder: Path, name: str, endpoint: str) -> zenoh.Session:
    file = client_file(folder, name)
    settings = ZenohSettings(mode="client", connect=(endpoint,), config=str(file))
    return zenoh.open(zenoh_config(settings))
