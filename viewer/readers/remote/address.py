"""Addresses of scans: https://host/scan.copc.laz, s3://bucket/folder/scan.laz.

A path made from an address has lost one of its two slashes (``https:/host/scan.laz``); it is an address all the same, unless a
file lies there.  What a person sees of an address has no user name and no query: these hold passwords and signatures.
"""

import hashlib
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from ...common.errors import InputError
from ...common.file_names import safe_name

SCHEMES = ("https", "http", "s3")
_ADDRESS = re.compile(r"(https?|s3):/+(.+)", re.IGNORECASE | re.DOTALL)
_SIGNED = re.compile(r"(x-(amz|goog|ms|oss)-.*|signature|expires|key-pair-id|policy|awsaccesskeyid|googleaccessid|sig|se|st|sp|"
                     r"sv|sr|spr|skoid|sktid|skt|ske|sks|skv|token)$", re.IGNORECASE)  # fmt: skip
"""Parameters of signed links (Amazon, Google, Azure, Alibaba): they change with each link to the same file."""


@dataclass(frozen=True)
class Address:
    """scheme: one of SCHEMES.  host: with a port; of s3 the bucket.  place: the path on it, without the first slash.  query,
    user: the parameters, and user name and password.  All as they are written."""

    scheme: str
    host: str
    place: str
    query: str = ""
    user: str = ""

    @property
    def text(self) -> str:
        """For people, messages and files."""
        return f"{self.scheme}://{self.host}/{self.place}"

    @property
    def name(self) -> str:
        """The last part of the path, as the name of a file."""
        return safe_name(unquote(self.place.rsplit("/", 1)[-1]), "scan")

    @property
    def key(self) -> str:
        """The name of the folder in which its copy is kept: the same for each signed link to one file."""
        return hashlib.sha256(self.kept.encode()).hexdigest()[:24]

    @property
    def kept(self) -> str:
        """What a project keeps of it: as :attr:`text`, with those parameters that are no signature."""
        parameters = [(name, value) for name, value in parse_qsl(self.query, keep_blank_values=True) if not _SIGNED.match(name)]
        return f"{self.text}?{urlencode(parameters)}" if parameters else self.text


def is_address(path: Path | str) -> bool:
    """Whether a path is an address from which scans are read, and no file."""
    return _ADDRESS.match(str(path)) is not None and not Path(path).exists()


def whole_path(path: Path | str) -> str:
    """The absolute path of a file; an address as it is, with both slashes."""
    match = _ADDRESS.match(str(path)) if is_address(path) else None
    return f"{match[1].lower()}://{match[2]}" if match else os.path.abspath(path)


def address_text(path: Path | str) -> str:
    """A path for people, which of an address has no user name and no query."""
    try:
        address = address_in(path)
    except InputError:  # it names no file
        address = None
    return str(path) if address is None else address.text


def kept_path(path: Path | str) -> str:
    """The absolute path of a file; of an address what is kept of it, without a password or a signature."""
    try:
        address = address_in(path)
    except InputError:
        address = None
    return whole_path(path) if address is None else address.kept


def beside(address: Address, name: str) -> Address:
    """The address of the file ``name``, a path relative to the folder of ``address``."""
    folder = address.place.rpartition("/")[0]
    return replace(address, place=f"{folder}/{quote(name)}" if folder else quote(name))


def address_in(path: Path | str) -> Address | None:
    """The address that a path is, of a file or of a folder; None where it is none.  Raises InputError where it names none."""
    match = _ADDRESS.match(str(path))
    if match is None or Path(path).exists():
        return None
    scheme, rest = match[1].lower(), match[2]
    parts = urlsplit(f"{scheme}://{rest}")
    user, _, host = parts.netloc.rpartition("@")
    place = parts.path.strip("/")
    if not host or not place:
        raise InputError(f"{scheme}://{host}/{place}: names no file", remedy="give the whole address of a scan")
    if parts.fragment:
        place += f"%23{parts.fragment}"
    return Address(scheme, host, place, parts.query, user)
