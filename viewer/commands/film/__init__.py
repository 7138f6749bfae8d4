"""Camera paths, video and panoramas: everything ``pointglass video`` does, without a window.

    path (keyframes -> one camera a frame) -> frames (pictures, supersampled, or panorama) -> encode (MP4 | PNG sequence)

``command`` is the command line's part.
"""
