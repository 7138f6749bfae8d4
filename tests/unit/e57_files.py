"""Random E57 files that use what the format has: field types and limits, poses, groups, photographs, extensions."""

import numpy as np

from pointglass.viewer.readers.e57.e57_nodes import library

e57 = library()

SENSOR = {"sensorVendor": "maker", "sensorModel": "Scanner Ü", "sensorSerialNumber": "00123", "description": "a room"}
NORMALS = ("nor", "http://www.libe57.org/E57_NOR_surface_normals.txt")


class Writer:
    """Makes nodes of one file."""

    def __init__(self, path):
        self.image = e57.ImageFile(str(path), "w")
        self.image.extensionsAdd("", e57.E57_V1_0_URI)
        self.image.extensionsAdd(*NORMALS)

    def node(self, value):
        """A dict becomes a Structure, a list a Vector, numbers and texts leaves."""
        if isinstance(value, dict):
            made = e57.StructureNode(self.image)
            for name, child in value.items():
                made.set(name, self.node(child))
            return made
        if isinstance(value, list):
            made = e57.VectorNode(self.image, True)
            for child in value:
                made.append(self.node(child))
            return made
        if isinstance(value, bool | int | np.integer):
            return e57.IntegerNode(self.image, int(value))
        if isinstance(value, float):
            return e57.FloatNode(self.image, value, e57.E57_DOUBLE)
        return e57.StringNode(self.image, value) if isinstance(value, str) else value

    def vector(self, parent, name, fields):
        """A CompressedVector with ``fields``: name -> (leaf node, values as stored)."""
        prototype = e57.StructureNode(self.image)
        for key, (leaf, _) in fields.items():
            prototype.set(key, leaf)
        points = e57.CompressedVectorNode(self.image, prototype, e57.VectorNode(self.image, True))
        parent.set(name, points)
        return points

    def fill(self, points, fields):
        buffers, count = e57.VectorSourceDestBuffer(), len(next(iter(fields.values()))[1])
        for key, (_, values) in fields.items():
            buffers.append(e57.SourceDestBuffer(self.image, key, values, count, False, False))
        writer = points.writer(buffers)
        writer.write(count)
        writer.close()


def random_fields(image, rng, count):
    """name -> (leaf node, values as stored): all kinds of leaves."""
    fields = {}

    def whole(name, low, high):
        values = rng.integers(low, high, count, endpoint=True).astype(np.longlong)
        fields[name] = e57.IntegerNode(image, low, low, high), values

    def scaled(name, low, high, scale, offset):
        values = rng.integers(low, high, count, endpoint=True).astype(np.longlong)
        fields[name] = e57.ScaledIntegerNode(image, 0, low, high, scale, offset), values

    def real(name, single, low=None, high=None):
        kind = e57.E57_SINGLE if single else e57.E57_DOUBLE
        values = rng.uniform(-20 if low is None else low, 20 if high is None else high, count)
        values = values.astype(np.float32 if single else np.float64)
        fields[name] = e57.FloatNode(image, 0.0, kind) if low is None else e57.FloatNode(image, low, kind, low, high), values

    if rng.random() < 0.7:
        for axis in "XYZ":
            form = rng.integers(3)
            if form == 0:
                scaled(f"cartesian{axis}", -(2**31), 2**31 - 1, 1e-6, float(rng.integers(-5, 5)))
            else:
                real(f"cartesian{axis}", form == 1)
        if rng.random() < 0.5:
            whole("cartesianInvalidState", 0, 2)
    else:
        real("sphericalRange", True, 0.0, 50.0)
        real("sphericalAzimuth", False, -3.14, 3.14)
        real("sphericalElevation", False, -1.5, 1.5)
        if rng.random() < 0.5:
            whole("sphericalInvalidState", 0, 2)
    if rng.random() < 0.7:
        most = int(rng.choice([255, 1023, 65535]))
        for colour in ("Red", "Green", "Blue"):
            whole(f"color{colour}", 0, most)
        if rng.random() < 0.3:
            whole("isColorInvalid", 0, 1)
    form = rng.integers(4)
    if form == 1:
        real("intensity", True, 0.0, 1.0)
    elif form == 2:
        whole("intensity", -2048, 2047)
    elif form == 3:
        scaled("intensity", 0, 4095, 1 / 4095, 0.0)
    for add in (lambda: whole("rowIndex", 0, 4000), lambda: whole("columnIndex", 7, 7), lambda: whole("returnIndex", 0, 3),
                lambda: real("timeStamp", False), lambda: real("nor:normalX", True, -1.0, 1.0),
                lambda: whole("wide", -(2**63), 2**63 - 1), lambda: scaled("far", -(2**60), 2**60, 1e-9, 1e5)):  # fmt: skip
        if rng.random() < 0.5:
            add()
    return fields


def random_e57(path, seed, *, scans=None, photographs=True):
    """Writes a random file of several scans."""
    rng = np.random.default_rng(seed)
    writer = Writer(path)
    image, root = writer.image, writer.image.root()
    for name, value in {"formatName": "ASTM E57 3D Imaging Data File", "guid": f"{{file-{seed}}}", "versionMajor": 1,
                        "versionMinor": 0, "e57LibraryVersion": "other",
                        "coordinateMetadata": 'LOCAL_CS["site",UNIT["metre",1]]',
                        "creationDateTime": {"dateTimeValue": 1.2e9, "isAtomicClockReferenced": 0}}.items():  # fmt: skip
        root.set(name, writer.node(value))
    data, images = e57.VectorNode(image, True), e57.VectorNode(image, True)
    root.set("data3D", data)
    root.set("images2D", images)
    for number in range(int(rng.integers(1, 4)) if scans is None else scans):
        count = int(rng.integers(20, 2000))
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        scan = writer.node(
            {"guid": f"{{scan-{number}}}", "name": f"setup {number} ä", **SENSOR,
             "acquisitionStart": {"dateTimeValue": 1.2e9 + number, "isAtomicClockReferenced": 1},
             "temperature": 21.5, "originalGuids": ["{a}", "{b}"],
             "indexBounds": {"rowMinimum": 0, "rowMaximum": 4000, "columnMinimum": 0, "columnMaximum": 7},
             "intensityLimits": {"intensityMinimum": 0.0, "intensityMaximum": 1.0}}
        )  # fmt: skip
        if rng.random() < 0.8:
            place = rng.uniform(-9, 9, 3).tolist()
            scan.set("pose", writer.node({"rotation": dict(zip("wxyz", turn.tolist(), strict=True)),
                                          "translation": dict(zip("xyz", place, strict=True))}))  # fmt: skip
        fields = random_fields(image, rng, count)
        points = writer.vector(scan, "points", fields)
        grouped = groups = None
        if rng.random() < 0.5:
            groups = {"idElementValue": (e57.IntegerNode(image, 0, 0, 50), np.arange(10).astype(np.longlong)),
                      "startPointIndex": (e57.IntegerNode(image, 0, 0, 10**6), (np.arange(10) * 2).astype(np.longlong)),
                      "pointCount": (e57.IntegerNode(image, 0, 0, 10**6), np.full(10, 2).astype(np.longlong))}  # fmt: skip
            line = writer.node({"idElementName": "columnIndex"})
            grouped = writer.vector(line, "groups", groups)
            scan.set("pointGroupingSchemes", writer.node({"groupingByLine": line}))
        data.append(scan)
        writer.fill(points, fields)
        if groups is not None:
            writer.fill(grouped, groups)
        if photographs and rng.random() < 0.7:
            jpeg = np.frombuffer(rng.bytes(int(rng.integers(10, 9000))), np.uint8)
            blob = e57.BlobNode(image, len(jpeg))
            picture = {"imageWidth": 4, "imageHeight": 3, "focalLength": 0.01, "pixelWidth": 1e-5, "pixelHeight": 1e-5,
                       "principalPointX": 2.0, "principalPointY": 1.5, "jpegImage": blob}  # fmt: skip
            images.append(writer.node({"guid": f"{{photo-{number}}}", "name": "photo", "pinholeRepresentation": picture,
                                       "associatedData3DGuid": f"{{scan-{number}}}"}))  # fmt: skip
            blob.write(jpeg, 0, len(jpeg))
    image.close()


def contents(path):
    """All that a file holds: (paths -> values and types of its nodes, with the records of its CompressedVectors as stored)."""
    image = e57.ImageFile(str(path), "r")
    found = {}
    _collect(image, image.root(), "", found)
    found["extensions"] = [(image.extensionsPrefix(i), image.extensionsUri(i)) for i in range(image.extensionsCount())]
    image.close()
    return found


def _collect(image, node, path, found):
    kind = type(node).__name__
    if isinstance(node, e57.StructureNode | e57.VectorNode):
        found[path] = kind
        for index in range(node.childCount()):
            child = node[index]
            _collect(image, child, f"{path}/{child.elementName()}", found)
    elif isinstance(node, e57.CompressedVectorNode):
        prototype = e57.StructureNode(node.prototype())
        _collect(image, prototype, f"{path}/prototype", found)
        found[path] = kind, int(node.childCount())
        buffers, arrays = e57.VectorSourceDestBuffer(), {}
        for index in range(prototype.childCount() if node.childCount() else 0):
            leaf = prototype[index]
            dtype = np.longlong
            if isinstance(leaf, e57.FloatNode):
                dtype = np.float32 if leaf.precision() == e57.E57_SINGLE else np.float64
            name, count = leaf.elementName(), node.childCount()
            arrays[name] = np.zeros(count, dtype)
            buffers.append(e57.SourceDestBuffer(image, name, arrays[name], count, False, False))
        if arrays:
            reader = node.reader(buffers)
            reader.read()
            reader.close()
        found |= {f"{path}/{name}": values.tobytes() for name, values in arrays.items()}
    elif isinstance(node, e57.BlobNode):
        data = np.zeros(node.byteCount(), np.uint8)
        node.read(data, 0, len(data))
        found[path] = kind, data.tobytes()
    else:
        facts = ("value", "rawValue", "minimum", "maximum", "scale", "offset", "precision")
        found[path] = kind, *(getattr(node, fact)() for fact in facts if hasattr(node, fact))
