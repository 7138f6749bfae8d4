"""Compiled: decompresses LZF (Marc Lehmann's liblzf), the compression of PCD's binary_compressed form.

Samples of compressed PCD files are decoded here, because importing Open3D, which reads such files completely, takes longer than
a preview may.
"""

import numpy as np

from ...model.common.jit import compiled


@compiled(nogil=True)
def decompress(data, out):
    """Decompresses ``data`` (n,) uint8 into ``out`` (m,) uint8.  Returns the bytes written, -1 where the data is damaged."""
    i, o, n, m = 0, 0, data.shape[0], out.shape[0]
    while i < n:
        control = np.int64(data[i])
        i += 1
        if control < 32:  # a run of literal bytes
            length = control + 1
            if i + length > n or o + length > m:
                return -1
            for k in range(length):
                out[o + k] = data[i + k]
            i += length
        else:  # a copy of bytes already written
            length = control >> 5
            if length == 7:
                if i >= n:
                    return -1
                length += np.int64(data[i])
                i += 1
            if i >= n:
                return -1
            source = o - ((control & 31) << 8) - np.int64(data[i]) - 1
            i += 1
            length += 2
            if source < 0 or o + length > m:
                return -1
            for k in range(length):
                out[o + k] = out[source + k]
        o += length
    return o
