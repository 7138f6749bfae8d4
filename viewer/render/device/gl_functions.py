"""OpenGL functions that moderngl does not wrap, called through ctypes in the current context.

moderngl keeps the loader of the context it made (glcontext's) or detected (its own, as in a window); addresses come from it, so
that they belong to the same driver on every platform.  Every function needs its context to be current on the calling thread.
"""

import ctypes
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import moderngl

_CALL = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)  # OpenGL's calling convention on Windows is stdcall


def gl_function(context: "moderngl.Context", name: str, result: Any, *arguments: Any) -> Any:
    """The OpenGL function ``name`` as a Python callable.  result, arguments: ctypes types, result None for void.

    Raises LookupError where the driver does not have it.
    """
    loader = context.mglo._context
    load = loader.load if hasattr(loader, "load") else loader.load_opengl_function  # glcontext's, moderngl's DefaultLoader
    address = load(name)
    if not address:
        raise LookupError(f"this OpenGL has no {name}")
    return _CALL(result, *arguments)(address)


def integers(context: "moderngl.Context", name: int, count: int) -> list[int]:
    """``count`` integers of glGetIntegerv(name); of an unknown name, zeros, and the OpenGL error is cleared."""
    found = (ctypes.c_int * max(count, 16))()  # as much as any query writes
    gl_function(context, "glGetIntegerv", None, ctypes.c_uint, ctypes.POINTER(ctypes.c_int))(name, found)
    return [0] * count if context.error != "GL_NO_ERROR" else list(found[:count])


def device_uuids(context: "moderngl.Context") -> list[bytes]:
    """The 16-byte UUIDs of the devices that draw (GL_EXT_memory_object); empty where OpenGL cannot tell."""
    if "GL_EXT_memory_object" not in context.extensions:
        return []
    num_device_uuids, device_uuid = 0x9596, 0x9597
    arguments = ctypes.c_uint, ctypes.c_uint, ctypes.POINTER(ctypes.c_ubyte)
    try:
        ask = gl_function(context, "glGetUnsignedBytei_vEXT", None, *arguments)
    except LookupError:
        return []
    found = []
    for index in range(integers(context, num_device_uuids, 1)[0]):
        uuid = (ctypes.c_ubyte * 16)()
        ask(device_uuid, index, uuid)
        if context.error == "GL_NO_ERROR":
            found.append(bytes(uuid))
    return found
