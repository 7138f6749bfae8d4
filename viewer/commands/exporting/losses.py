"""What a target format cannot hold, gathered while a file is written and told in one line."""


class Losses:
    """Sentences, each once, in the order in which they were found."""

    def __init__(self) -> None:
        self._found: dict[str, None] = {}

    def add(self, what: str) -> None:
        self._found.setdefault(what)

    def __bool__(self) -> bool:
        return bool(self._found)

    @property
    def text(self) -> str:
        return "; ".join(self._found)
