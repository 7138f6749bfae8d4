"""CRC-32C, which the pages of an E57 have; by a table, since no library of the project computes it."""


def _table() -> list[int]:
    rows = []
    for value in range(256):
        for _ in range(8):
            value = (value >> 1) ^ (0x82F63B78 if value & 1 else 0)
        rows.append(value)
    return rows


_ROWS = _table()


def crc32c(data: bytes) -> int:
    value = 0xFFFFFFFF
    for byte in data:
        value = (value >> 8) ^ _ROWS[(value ^ byte) & 0xFF]
    return value ^ 0xFFFFFFFF
