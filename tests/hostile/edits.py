"""Edits of bytes, text and JSON: flipped bits, hostile numbers, moved blocks, hostile words, hostile values.

Every edit takes a random.Random and gives the same result for the same state of it.  Results are at most LARGEST bytes long.
"""

import json
import random
import struct

LARGEST = 2 << 20
"""Bytes of a mutant, at most: memory is allowed in proportion to the file."""
_WHOLE = (
    0, 1, 2, 3, 7, 8, 15, 16, 31, 32, 63, 64, 100, 127, 128, 254, 255, 256, 1000, 1023, 1024, 4096, 32767, 32768, 65534,
    65535, 65536, 2**20, 2**24, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1, 2**32, 2**33, 2**48, 2**62, 2**63 - 1, 2**63,
    2**64 - 1,
)  # fmt: skip
_REAL = (
    0.0, -0.0, 1.0, -1.0, 1e-9, 1e-45, 1e-320, 0.1, 1e6, 1e9, 2.0**31, 1e15, 2.0**53, 2.0**63, 1e19, 3e38, 1e39, 1e155, 1e300,
    1.7e308, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
WORDS = (
    b"0", b"1", b"-1", b"2", b"255", b"256", b"65536", b"2147483648", b"4294967295", b"4294967296", b"9223372036854775807",
    b"18446744073709551616", b"99999999999999999999999999", b"1" + b"0" * 400, b"9" * 5000, b"1e5", b"1e308", b"1e309",
    b"-1e400", b"1e-400", b"1.5D+02", b"nan", b"NaN", b"-nan(ind)", b"inf", b"-Infinity", b"1.#QNAN", b"0x10", b"1_000",
    b"+1", b"1,5", b"1.2.3", b"", b" ", b"\0", b"-", b".", b"e", b"\xff", b"\xc3", b"\xc3\xa9", b"\xe2\x80\xae",
    b"\xed\xa0\x80", b"\x1b[31m", b"\x1b]0;x\x07", b"\r", b"\n", b"\t", b"\"", b"'", b"<", b"&amp;", b"../../x",
    b"/etc/passwd", b"a" * 300, b"[" * 500, b"x", b"y", b"z", b"rgb", b"Intensity", b"intensity", b"list", b"double",
    b"uchar", b"F", b"U", b"I", b"%s%n", b"{0}", b"True", b"\xd9\xa1\xd9\xa2", b"\xc2\xb2",
)  # fmt: skip
_RAW = ("1e999", "-1e999", "NaN", "-Infinity", "1" + "0" * 400, "9" * 5000, "-0", "1e-999", "0.1e1")
"""Numbers that json.dumps would not write."""
_VALUES = (
    None, True, False, 0, 1, -1, 2, 255, 256, 65536, 2**31, 2**32, 2**53, 2**63, 2**64, -(2**63), 10**18, 10**30, 0.5, -0.5,
    1e-9, 1e-320, 1e9, 1e16, 1e155, 1e300, -1e308, "", "a", "0", "1e5", "nan", "..", "../../x", "/etc/passwd", "/", "a/b",
    "a\\b", "a\0b", "\x1b[31mred", "\u202eabc", "\ud800", "é" * 60, "x" * 5000, "CON", "-rf", [], {}, [[]], [0], [0, 0, 0],
    [1, 2, 3], [None], ["a"], {"a": 1}, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], [0] * 1000,
    [1e300, 1e300, 1e300], "EPSG:4326", "EPSG:99999999", "+proj=utm +zone=99", "GEOGCS[", "int128", "double", "BROTLI",
    "laszip", "binary", "zstandard",
)  # fmt: skip


def edited_bytes(data: bytes, rng: random.Random) -> bytes:
    """One edit that knows nothing of the format."""
    if not data:
        return rng.randbytes(rng.randint(1, 16))
    out, size = bytearray(data), len(data)
    # half of the edits near the beginning, where headers are
    place = rng.randrange(size) if rng.random() < 0.5 else rng.randrange(min(size, 512))
    match rng.randrange(10):
        case 0:
            out[place] ^= 1 << rng.randrange(8)
        case 1:
            out[place] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, 0x20, 0x30, rng.randrange(256)))
        case 2 | 3:
            put_number(out, place, rng.choice("BHIQhiqfd"), rng)
        case 4:
            del out[place : place + rng.choice((1, 2, 4, 8, 32, rng.randint(1, size)))]
        case 5:
            other = rng.randrange(size)
            out[place:place] = data[other : other + rng.choice((1, 4, 8, 64, 256))]
        case 6:
            other = rng.randrange(size)
            run = data[other : other + rng.choice((1, 2, 4, 8, 16, 64))]
            out[place : place + len(run)] = run
        case 7:
            del out[rng.choice((place, size - 1, size - rng.randint(1, min(size, 64)), int(rng.random() * size))) :]
        case 8:
            out += rng.choice((b"\0", b"\xff", rng.randbytes(1))) * rng.choice((1, 3, 8, 100, 2000))
        case 9:
            run = rng.randint(1, 64)
            out[place : place + run] = rng.choice((bytes(run), b"\xff" * run, rng.randbytes(run)))
    return bytes(out[:LARGEST])


def put_number(out: bytearray, place: int, kind: str, rng: random.Random, order: str = "<") -> None:
    """Writes a hostile number of a struct type at ``place``, where it fits; sometimes one close to what is there."""
    size = struct.calcsize(kind)
    if place < 0 or place + size > len(out):
        return
    if kind in "fd":
        value = rng.choice(_REAL) * rng.choice((1, -1))
        try:
            struct.pack_into(order + kind, out, place, value)
        except OverflowError:
            struct.pack_into(order + kind, out, place, float("inf"))
        return
    before = int.from_bytes(out[place : place + size], "little" if order == "<" else "big")
    value = rng.choice(
        (rng.choice(_WHOLE), rng.choice(_WHOLE), before + rng.choice((-1, 1, -2, 2, 8, -8, 256)), before * 2, before // 2)
    )
    out[place : place + size] = (value % (1 << 8 * size)).to_bytes(size, "little" if order == "<" else "big")


def edited_text(data: bytes, rng: random.Random, span: tuple[int, int] | None = None) -> bytes:
    """One edit of words or lines.  span: of the text that is edited; None: all."""
    first, last = span or (0, len(data))
    text = data[first:last]
    lines = text.split(b"\n")
    number = rng.randrange(len(lines)) if rng.random() < 0.5 else rng.randrange(min(len(lines), 12))
    match rng.randrange(12):
        case 0 | 1 | 2 | 3 | 4:
            words = lines[number].split(b" ") if b"," not in lines[number] or rng.random() < 0.5 else lines[number].split(b",")
            glue = b" " if len(words) == lines[number].count(b" ") + 1 else b","
            words[rng.randrange(len(words))] = rng.choice(WORDS)
            lines[number] = glue.join(words)
        case 5:
            del lines[number]
        case 6:
            lines.insert(rng.randrange(len(lines) + 1), lines[number])
        case 7:
            other = rng.randrange(len(lines))
            lines[number], lines[other] = lines[other], lines[number]
        case 8:
            lines[number] += rng.choice((b" ", b",", b";", b"\t", b"")) + rng.choice(WORDS)
        case 9:
            lines[number] = rng.choice((b"# ", b"//", b";", b"", b"comment ")) + rng.choice(WORDS)
        case 10:
            old, new = rng.choice(
                (
                    (b" ", b"\t"),
                    (b".", b","),
                    (b"\n", b"\r\n"),
                    (b"\n", b"\r"),
                    (b" ", b"  "),
                    (b" ", b";"),
                    (b",", b";"),
                    (b"0", b"\xd9\xa0"),
                    (b"-", b"\xe2\x88\x92"),
                    (b" ", b"\xc2\xa0"),
                    (b" ", b""),
                )
            )
            return (data[:first] + text.replace(old, new) + data[last:])[:LARGEST]
        case 11:
            try:
                whole = text.decode("utf-8")
            except UnicodeDecodeError:
                return edited_bytes(data, rng)
            coding = rng.choice(("utf-8-sig", "utf-16", "utf-16-le", "utf-32", "cp037"))
            return (data[:first] + whole.encode(coding, "replace") + data[last:])[:LARGEST]
    return (data[:first] + b"\n".join(lines) + data[last:])[:LARGEST]


def edited_json(data: bytes, rng: random.Random) -> bytes:
    """One edit of a value, a key or the nesting of a JSON text; of its bytes where it is not readable."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return edited_text(data, rng) if rng.random() < 0.5 else edited_bytes(data, rng)
    if rng.random() < 0.08:
        return rng.choice((edited_text, edited_bytes))(data, rng)
    raw: dict[str, str] = {}
    tree = _changed(tree, rng, raw)
    try:
        text = json.dumps(tree, indent=rng.choice((None, 1)))
    except (ValueError, RecursionError):
        return b"[" * 100_000
    for mark, number in raw.items():
        text = text.replace(json.dumps(mark), number)
    return text.encode("utf-8", "surrogatepass")[:LARGEST]


def _places(tree, depth: int = 0) -> list[tuple]:
    """(container, key) of every value inside."""
    found = []
    if depth < 12:
        for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
            found.append((tree, key))
            found += _places(value, depth + 1)
    return found


def _changed(tree, rng: random.Random, raw: dict[str, str]):
    places = _places(tree)
    value = hostile_value(rng, raw)
    if not places or rng.random() < 0.02:
        return value
    # a level first, then a place of it: otherwise long lists of numbers get nearly all edits
    holder, key = rng.choice(places)
    if rng.random() < 0.5:
        tops = [(h, k) for h, k in places if isinstance(h, dict)]
        holder, key = rng.choice(tops) if tops else (holder, key)
    match rng.randrange(10):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, dict):
            holder[rng.choice(("", "\0", "x", "../x", "\x1b[31m", "__class__", "type", "a" * 300, str(key).upper()))] = (
                holder.pop(key)
            )
        case 1 if isinstance(holder, list):
            holder.insert(key, value)
        case 2:
            other, name = rng.choice(places)
            holder[key] = json.loads(json.dumps(other[name]))
        case 3:
            holder[key] = [holder[key]]
        case 4 if isinstance(holder[key], (int, float)) and not isinstance(holder[key], bool):
            try:
                holder[key] = rng.choice(
                    (
                        -holder[key],
                        holder[key] * 2,
                        holder[key] * 1e6,
                        holder[key] / 1e6,
                        holder[key] + 1,
                        holder[key] - 1,
                        float(holder[key]),
                        int(holder[key]),
                        str(holder[key]),
                    )
                )
            except (OverflowError, ValueError):
                holder[key] = value
        case 4 if isinstance(holder[key], list) and holder[key]:
            holder[key] = holder[key] * rng.choice((2, 10)) if rng.random() < 0.5 else holder[key][:-1]
        case _:
            holder[key] = value
    return tree


def hostile_value(rng: random.Random, raw: dict[str, str]):
    """A JSON value; ``raw`` gets what must replace a mark in the text."""
    pick = rng.random()
    if pick < 0.12:
        mark = f"@@{len(raw)}@@"
        raw[mark] = rng.choice(_RAW)
        return mark
    if pick < 0.15:
        mark = f"@@{len(raw)}@@"
        deep = rng.choice((100, 900, 3000, 100_000))
        raw[mark] = "[" * deep + "]" * deep if rng.random() < 0.5 else '{"a":' * deep + "1" + "}" * deep
        return mark
    return json.loads(json.dumps(rng.choice(_VALUES)))
