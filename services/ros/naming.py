"""Keys, liveliness tokens and attachments of rmw_zenoh, as its design document gives them.

A topic's key is ``<domain>/<topic>/<type>/<hash>``. Every node, publisher and subscription declares
a token below ``@ros2_lv``, from which others build the graph that ``ros2 topic list`` shows. Every
message carries 33 bytes: sequence number, source time [ns], 16, and the sender's id, little-endian.

zenoh-bridge-ros2dds, which connects robots with DDS, has keys without domain, type and hash, and
separate tokens: ``@/<session>/@ros2_lv/<entity>/<topic>/<type>/<qos>``, with § for each slash.
"""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass

from slopewise.models.errors import ParameterError

PUBLISHER, SUBSCRIPTION, NODE = "MP", "MS", "NN"
NO_HASH = "TypeHashNotSupported"
"""Hash in keys of ROS 2 Humble."""

NULL_HASH = f"RIHS01_{64 * '0'}"  # Hash in keys of client libraries that know no hashes
_GID = 16  # Length of a publisher's id in an attachment [B], as rmw_zenoh writes it
_ATTACHMENT = struct.Struct(f"<qqB{_GID}s")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_DDS_TYPE = re.compile(r"(?P<package>\w+)::(?P<kind>msg)::dds_::(?P<name>\w+)_")
_TYPE = re.compile(r"(?P<package>\w+)/(?P<kind>msg)/(?P<name>\w+)")


def full_name(namespace: str, topic: str) -> str:
    """Topic with its namespace, e.g. ``/robot/plan``; one that begins with / is absolute."""
    name = topic if topic.startswith("/") else f"{namespace.rstrip('/')}/{topic}"
    parts = name.removeprefix("/").split("/")
    if not all(_NAME.fullmatch(part) for part in parts):
        raise ParameterError("topic", f"a name of ROS 2 such as /robot/plan, got {name!r}")
    return f"/{'/'.join(parts)}"


def dds_type(kind: str) -> str:
    """Form of a type in keys: ``nav_msgs::msg::dds_::Path_`` of ``nav_msgs/msg/Path``."""
    parts = _TYPE.fullmatch(kind)
    if parts is None:
        raise ParameterError("type", f"package/msg/Name, got {kind!r}")
    return f"{parts['package']}::{parts['kind']}::dds_::{parts['name']}_"


def topic_key(domain: int, topic: str, kind: str, type_hash: str) -> str:
    """Key of a topic's messages; ``*`` as hash matches all of them."""
    return f"{domain}/{topic.removeprefix('/')}/{dds_type(kind)}/{type_hash}"


def type_of(dds: str) -> str:
    """Type that keys call ``nav_msgs::msg::dds_::Path_``; other texts are returned unchanged."""
    parts = _DDS_TYPE.fullmatch(dds)
    return dds if parts is None else f"{parts['package']}/{parts['kind']}/{parts['name']}"


def bridged_key(topic: str) -> str:
    """Key of a topic, given with its namespace, behind a zenoh-bridge-ros2dds."""
    return topic.removeprefix("/")


@dataclass(frozen=True, slots=True)
class Identity:
    """Node of ROS 2 on a session; ``session``: zenoh's id of it, in hexadecimal digits."""

    domain: int
    session: str
    namespace: str
    node: str

    def node_token(self) -> str:
        """Token of the node; it is entity 0 of its session."""
        return self._token(0, NODE)

    def token(self, number: int, entity: str, topic: str, kind: str, type_hash: str) -> str:
        """Token of a publisher or a subscription."""
        # Reliable, volatile, the last ten: the defaults of ROS 2, which tokens omit.
        qos = "::,10:,:,:,,"
        topic = topic.replace("/", "%")
        return f"{self._token(number, entity)}/{topic}/{dds_type(kind)}/{type_hash}/{qos}"

    def bridged_token(self, entity: str, topic: str, kind: str, type_hash: str) -> str:
        """Token that a zenoh-bridge-ros2dds subscribes to; arguments as of :meth:`token`."""
        # Keyed no, reliable, volatile, the last ten; numbers of DDS, not of rmw.
        qos = f":1:0:0,10:typehash={type_hash};"
        name, kind = (part.replace("/", "§") for part in (bridged_key(topic), kind))
        return f"@/{self.session}/@ros2_lv/{entity}/{name}/{kind}/{qos}"

    def _token(self, number: int, entity: str) -> str:
        # The enclave is that of no security; names lose their slashes.
        namespace = self.namespace.rstrip("/").replace("/", "%") or "%"
        return (
            f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{entity}/%/{namespace}/{self.node}"
        )


def gid_of(token: str) -> bytes:
    """Id of a publisher: 16 bytes, other ones in every run."""
    return hashlib.blake2b(token.encode(), digest_size=_GID).digest()


@dataclass(frozen=True, slots=True)
class Attachment:
    """Attachment of a message; ``at``: time of sending [ns since 1970]."""

    sequence: int
    at: int
    gid: bytes

    def encode(self) -> bytes:
        """Attachment as 33 bytes."""
        return _ATTACHMENT.pack(self.sequence, self.at, _GID, self.gid)


def read_attachment(data: bytes) -> Attachment:
    if len(data) != _ATTACHMENT.size:
        raise ParameterError("attachment", f"{_ATTACHMENT.size} bytes, got {len(data)}")
    sequence, at, size, gid = _ATTACHMENT.unpack(data)
    if size != _GID:
        raise ParameterError("attachment", f"an id of {_GID} bytes, got {size}")
    return Attachment(sequence, at, gid)
