"""Solution files as bytes: a text and float64 arrays in a zip archive that NumPy reads too.

What an archive declares is checked before any of it is decompressed: its size, its members, their
sizes and their compression.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Mapping

import numpy as np

from dmoc.motion.trajectory import Array
from dmoc.results.schema import LARGEST_TEXT, Refused, said

TEXT = "header.json"
LARGEST = 2**30  # bytes of an archive, and of all that is in it
MOST_MEMBERS = 10_000
LARGEST_ENTRY = 1_000  # bytes of a member in the archive's directory
MOST_DEFLATED = 1_100  # deflate makes nothing more than 1032 times smaller
END = 22  # bytes of the record at the end of an archive without a comment
NUMPY = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '<f8', 'fortran_order': False, 'shape': \(([0-9]{1,15},(?: "
    rb"[0-9]{1,15})?)\), \} *\n",
    re.DOTALL,
)
LONGEST_START = 256  # bytes of an array's own header


def pack(text: str, arrays: Mapping[str, Array]) -> bytes:
    """Return an archive; the same content gives the same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(_member(TEXT), text)
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(
                content, np.ascontiguousarray(array, dtype="<f8"), version=(1, 0)
            )
            archive.writestr(_member(f"{name}.npy"), content.getvalue())
    return stream.getvalue()


def _member(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info


class Archive:
    """The members of an archive, read one by one; raises Refused where they are not what they
    are declared to be."""

    def __init__(self, content: bytes) -> None:
        _check_end(content)
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(content))
        except Exception:  # zipfile documents one error, and damaged bytes lead it to many others
            raise Refused("it is no zip archive") from None
        members = self._archive.infolist()
        self._left = {m.filename: m for m in members}
        if len(self._left) < len(members):
            raise Refused("it has a member twice")
        if sum(m.file_size for m in members) > LARGEST:
            raise Refused(f"it declares more than {LARGEST} bytes")
        for m in members:
            if (
                m.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
                or m.flag_bits & 0x1
            ):
                raise Refused(
                    f"its member {said(m.filename)} is packed in another way than by deflate"
                )
            if m.file_size > MOST_DEFLATED * (m.compress_size + 1):
                raise Refused(f"its member {said(m.filename)} declares a size that it cannot have")

    def text(self) -> str:
        """Return the text."""
        try:
            return self._read(TEXT, LARGEST_TEXT).decode()
        except UnicodeDecodeError:
            raise Refused(f"its member {TEXT!r} is no text") from None

    def array(self, name: str, shape: tuple[int, ...]) -> Array:
        """Return an array, which must have the shape (...) that is given."""
        content = self._read(f"{name}.npy", 8 * math.prod(shape) + LONGEST_START)
        start = NUMPY.match(content)
        if start is None:
            raise Refused(f"{said(name)} is no array of numbers in double precision")
        data = memoryview(content)[start.end() :]
        if tuple(int(n) for n in start[1].split(b",") if n) != shape or len(data) != 8 * math.prod(
            shape
        ):
            raise Refused(f"{said(name)} has another shape than declared")
        return np.frombuffer(data, dtype="<f8").reshape(shape).astype(float)

    def close(self) -> None:
        """Refuse members that nobody has asked for."""
        if self._left:
            raise Refused(f"its member {said(next(iter(self._left)))} is unknown")

    def _read(self, name: str, most: int) -> bytes:
        member = self._left.pop(name, None)
        if member is None:
            raise Refused(f"it has no member {said(name)}")
        if member.file_size > most:
            raise Refused(f"its member {said(name)} is too large")
        try:
            with self._archive.open(member) as stream:
                # To the end, where the checksum is compared.
                content = stream.read(member.file_size + 1)
        except Exception:  # as above
            raise Refused(f"its member {said(name)} is damaged") from None
        if len(content) != member.file_size:
            raise Refused(f"its member {said(name)} has another length than declared")
        return content


def _check_end(content: bytes) -> None:
    """The record at the end says how large the directory is; zipfile reads all of it."""
    end = content[-END:]
    count, size, offset = (
        int.from_bytes(end[a:b], "little") for a, b in ((10, 12), (12, 16), (16, 20))
    )
    if len(end) < END or end[:4] != b"PK\x05\x06":
        raise Refused("it is no zip archive, or not all of one")
    if count > MOST_MEMBERS or size > LARGEST_ENTRY * count:
        raise Refused("its directory is too large")
    if offset + size + END != len(content):
        raise Refused("it is more or less than one zip archive")
