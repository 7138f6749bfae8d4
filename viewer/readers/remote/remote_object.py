"""A file at an address, read by ranges of bytes, by obstore (the Rust object_store): HTTP and S3 with the same calls.

Requests that fail for a reason that may pass (a cut connection, a server that is busy or falls silent, a wrong length) are
repeated with growing pauses, which is said; what will not pass (403, 404) is one line.  Credentials of S3 come from the usual
environment (AWS_ACCESS_KEY_ID, ...); without any, requests are not signed, as public buckets want it.
"""

import logging
import os
import re
import time
from base64 import b64encode
from collections.abc import Iterator
from datetime import timedelta
from typing import Any
from urllib.parse import unquote

from ...common.errors import InputError
from .address import Address, beside

_ATTEMPTS = 5
_BROKEN = "the connection breaks off again and again"
SILENT = 20.0
"""Seconds without a byte after which a request is given up, and made again."""
_FIRST_PAUSE = 0.3
"""Seconds before a request is repeated; twice as long each time, so that about five seconds of a lost network are bridged."""
_KNOWN_CREDENTIALS = ("AWS_ACCESS_KEY_ID", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
                      "AWS_CONTAINER_CREDENTIALS_FULL_URI")  # fmt: skip
_REASONS = {
    r"connection ?refused": "nothing answers there",
    "dns error": "there is no server of this name, or no network",
    "invalid peer certificate|InvalidCertificate": "its certificate is not valid",
    "InvalidContentType|InvalidMessage": "the server does not speak https there; perhaps http:// is meant",
    r"status code: (\d{3}(?: [A-Z][A-Za-z-]*)*)": r"the server answers \1",
    r"kind: Timeout|timed ?out": "no answer for {SILENT} s",
    "body error|IncompleteMessage|connection ?reset": "cut in the middle",
    r"Requested (\S+), got (\S+)": r"of bytes \1 it gave \2: lengths that contradict each other",
    "Content-Length Header missing": "the server does not say how long the file is",
    "tcp connect error|network ?unreachable": "the server cannot be reached",
}
"""What obstore says, as a pattern, and in words for a person; the first that fits."""
_NO_RANGES = re.compile(r"status code: 416|416 Range|range.*support", re.IGNORECASE | re.DOTALL)
_CONNECT, _WHOLE = timedelta(seconds=10), timedelta(seconds=120)
"""A request has a few MiB at most: two minutes are 30 kB/s."""
_log = logging.getLogger(__name__)


class ChangedFileError(Exception):
    """The file at the address is another one than at the beginning."""


class UnreachableError(InputError):
    """The server does not answer, or not now: an earlier copy may serve."""


class MissingError(InputError):
    """There is no file at the address."""


class RemoteFolder:
    """The files beside the one at an address, by one store, so that connections are used again."""

    def __init__(self, address: Address):
        self._address, (self._store, place) = address, _store_of(address)
        self._before = place.removesuffix(place.rpartition("/")[2])

    def open(self, name: str, first: int, lacking: str) -> "RemoteObject":
        """The file ``name``, a path relative to the folder.  first, lacking: as for RemoteObject."""
        address = beside(self._address, name)
        return RemoteObject(address, first, (self._store, self._before + name), lacking)


class RemoteObject:
    """size: bytes.  tag: what names this state of the file: its ETag, else its time.  modified: seconds since 1970.
    ranges: whether the server gives parts of it; without, only :meth:`pieces` works.  head: its first bytes.
    waiting: why a request is made again at present, and which attempt it is; "" where none is."""

    def __init__(self, address: Address, first: int, opened: tuple[Any, str] | None = None, lacking: str = "check the address"):
        """Asks for the first bytes, at most ``first``.  opened: store and place in it of a RemoteFolder.  lacking: what to do
        where there is no such file.  Raises InputError, one line, where the file cannot be had."""
        self.address, self.ranges, self._lacking, self.waiting = address, True, lacking, ""
        self._begins = True
        self._store, self._place = opened or _store_of(address)
        try:
            answer, self.head = self._begun(first)
        except _NoRanges:
            answer = self._get(None)
            self.head, self.ranges = b"", False
        self.waiting, self._begins = "", False
        self._refuse_page(self.head)
        self.size = int(answer.meta["size"])
        self.modified = answer.meta["last_modified"].timestamp()
        self.tag = answer.meta["e_tag"] or f"{self.modified:.0f}"
        if self.size == 0:
            raise self._error("the file is empty (0 bytes)", "copy or export it again")

    def _begun(self, first: int) -> tuple[Any, bytes]:
        """The answer to the request for the first bytes, at most ``first``, and these."""
        why = ""
        for attempt in range(_ATTEMPTS):
            answer = self._asked(0, first)
            try:
                return answer, bytes(answer.bytes())
            except Exception as error:  # cut in the middle, on which obstore gives up
                why = str(error)
            self._pause(attempt, why)
        raise self._error(f"{_BROKEN} ({_short(why)})", "try again later")

    def _refuse_page(self, begin: bytes) -> None:
        """Raises InputError where a file that begins so is a web page: of a login, or one that shows the file."""
        if begin[:64].lstrip().lower().startswith((b"<!doctype html", b"<html")):
            raise self._error("a web page, no scan", "give the address of the file itself; behind a login, a signed link")

    def read(self, first: int, last: int) -> bytes:
        """The bytes ``first`` to ``last``, that one left out.  Raises ChangedFileError; InputError as the constructor."""
        if first == 0 and last <= len(self.head):
            return self.head[:last]
        why = ""
        for attempt in range(_ATTEMPTS):
            try:
                answer = self._asked(first, last)
            except _NoRanges:
                raise self._error("the server gives no parts of the file any more", "try again later") from None
            tag = answer.meta["e_tag"] or f"{answer.meta['last_modified'].timestamp():.0f}"
            if tag != self.tag or int(answer.meta["size"]) != self.size:
                raise ChangedFileError
            try:
                data = bytes(answer.bytes())
            except Exception as error:  # cut in the middle, on which obstore gives up
                why = str(error)
            else:
                if len(data) == last - first:
                    self.waiting = ""
                    return data
                why = f"{len(data)} of {last - first} bytes came"
            self._pause(attempt, why)
        raise self._error(f"{_BROKEN} ({_short(why)})", "try again later")

    def pieces(self, length: int) -> Iterator[bytes]:
        """The whole file from its beginning, in pieces of about ``length`` bytes, in one request."""
        answer, first = self._get(None), True
        try:
            for piece in answer.stream(min_chunk_size=length):
                if first:
                    self._refuse_page(bytes(piece[:64]))
                first = False
                yield bytes(piece)
        except InputError:
            raise
        except Exception as error:
            raise self._error(f"the connection broke off ({_short(str(error))}), and the server gives no parts of files",
                              "try again") from None

    def _asked(self, first: int, last: int) -> Any:
        return self._get((first, last))

    def _get(self, part: tuple[int, int] | None) -> Any:
        import obstore
        from obstore import exceptions

        options: Any = {} if part is None else {"range": part}
        why = ""
        for attempt in range(_ATTEMPTS):
            try:
                return obstore.get(self._store, self._place, options=options)
            except FileNotFoundError:
                raise MissingError(f"{self.address.text}: no such file there (404)", remedy=self._lacking) from None
            except (exceptions.PermissionDeniedError, exceptions.UnauthenticatedError, PermissionError):
                raise self._error("the server does not give it out (401 or 403)", self._allowed()) from None
            except exceptions.NotSupportedError:
                raise _NoRanges from None
            except Exception as error:
                text = str(error)
                if part and _NO_RANGES.search(_without_addresses(text)):
                    raise _NoRanges from None
                why = text
            self._pause(attempt, why)
        raise UnreachableError(f"{self.address.text}: cannot be read ({_short(why)})",
                               remedy="check the address and the network, and try again")

    def _pause(self, attempt: int, why: str) -> None:
        """Waits before the next attempt.  It is said: with the progress (``waiting``), before there is any in a line."""
        if attempt + 1 == _ATTEMPTS:
            return
        self.waiting = f"{_short(why)}, trying again, {attempt + 2} of {_ATTEMPTS}"
        if self._begins and "no answer" in self.waiting:  # others take no longer than the pause
            _log.warning("%s: %s", self.address.text, self.waiting)
        time.sleep(_FIRST_PAUSE * 2**attempt)

    def _allowed(self) -> str:
        if self.address.scheme == "s3":
            return "set AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_REGION of one who may read it (~/.aws is not read)"
        return "a signed link may have expired: ask for a new one" if self.address.query else "ask its owner for a link"

    def _error(self, why: str, remedy: str) -> InputError:
        return InputError(f"{self.address.text}: {why}", remedy=remedy)


class _NoRanges(Exception):
    """The server gives whole files only."""


def _store_of(address: Address) -> tuple[Any, str]:
    """The store and the place in it."""
    from obstore.store import HTTPStore, S3Store

    client: Any = {"connect_timeout": _CONNECT, "timeout": _WHOLE, "read_timeout": timedelta(seconds=SILENT)}
    retries: Any = {"max_retries": 2, "retry_timeout": timedelta(seconds=20)}
    place = unquote(address.place)
    if address.scheme == "s3":
        signed = any(os.environ.get(name) for name in _KNOWN_CREDENTIALS)
        endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or ""
        if endpoint.startswith("http://"):
            client["allow_http"] = True
        more: dict[str, Any] = {"endpoint": endpoint} if endpoint else {}
        store = S3Store(address.host, skip_signature=not signed, client_options=client, retry_config=retries, **more)
        return store, place
    if address.user:
        client["default_headers"] = {"Authorization": "Basic " + b64encode(unquote(address.user).encode()).decode()}
    if address.scheme == "http":
        client["allow_http"] = True
    folder, _, name = place.rpartition("/")
    base = f"{address.scheme}://{address.host}/{address.place.rpartition('/')[0]}" if folder else f"{address.scheme}://{address.host}"
    return HTTPStore.from_url(f"{base}?{address.query}" if address.query else base, client_options=client,
                              retry_config=retries), name  # fmt: skip


def _short(text: str) -> str:
    """Why a request failed, for a person: from _REASONS; otherwise the first line of the library's message, without addresses,
    which may hold signatures."""
    for pattern, words in _REASONS.items():
        if found := re.search(pattern, text, re.IGNORECASE):
            return found.expand(words).replace("{SILENT}", f"{SILENT:g}")
    return _without_addresses(next(iter(text.strip().splitlines()), "no reason given"))[:160]


def _without_addresses(text: str) -> str:
    return " ".join("..." if "://" in word else word for word in text.split())
