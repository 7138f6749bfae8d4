"""mkdocs' hook for the site (.ci/mkdocs.yml): its pages are made of files that lie elsewhere in the repository.

READMEs keep their relative links: a link to another page leads to that page, one to a picture brings the picture along, one to
any other file leads to the repository, where its address is known (POINTGLASS_URL), else only its text is kept.  Two pages are
written here: the scripts of assets/examples, and the modules of viewer/ and model/ with the first sentence of each docstring.
Nothing of the product is imported.
"""

import ast
import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:!\[[^\]]*\]\([^)]*\)|[^\]])*)\]"
                  r"\((?!\w+:|#)(?P<path>[^)\s#]+)(?P<part>#[^)\s]*)?\)")
"""A relative link or picture in Markdown; the text may hold a picture."""
_ROLE = re.compile(r":(?:class|func|meth|attr|mod|data|exc):(<code>)")


def relinked(text: str, source: str, pages: dict[str, str], url: str, pictures: set[str]) -> str:
    """The Markdown of the file ``source`` with links of the site.  pages: page -> file.  pictures: receives files to bring."""
    page_of = {file: page for page, file in pages.items()} | {"assets/examples": "examples.md"}

    def changed(found: re.Match[str]) -> str:
        words, part = found["text"], found["part"] or ""
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), found["path"]))
        if found["picture"]:
            pictures.add(target)
            return f"![{words}](files/{target})"
        if target in page_of:
            return f"[{words}]({page_of[target]}{part})"
        return f"[{words}]({url}/blob/HEAD/{target}{part})" if url else words

    return LINK.sub(changed, text)


def examples() -> str:
    """The page of the scripts: what each shows, and its text."""
    made = ["# Examples", "Each script takes an output folder and runs in seconds on the demo scan or on data that it makes."]
    for script in sorted((ROOT / "assets" / "examples").glob("*.py")):
        text = script.read_text("utf-8")
        says = ast.get_docstring(ast.parse(text)) or ""
        says = re.sub(r"^(?=python )(.*)$", r"```sh\n\1\n```", says, flags=re.MULTILINE)
        code = text.split('"""', 2)[2].strip()
        made += [f"## {script.stem.replace('_', ' ').capitalize()}", says, f"```python\n{code}\n```"]
    return "\n\n".join(made) + "\n"


def first_sentence(text: str) -> str:
    return re.split(r"(?<=[.!?])\s", " ".join(text.split()), maxsplit=1)[0].replace("|", "\\|").replace("[", "\\[")


def modules() -> str:
    """The page of the modules: a section for each folder, a row for each module."""
    made = ["# Modules", "The first sentence of each module's docstring, by folder; where to add what is in Contributing."]
    folders = sorted({file.parent for part in ("viewer", "model") for file in (ROOT / part).rglob("__init__.py")})
    for folder in folders:
        says = ast.get_docstring(ast.parse((folder / "__init__.py").read_text("utf-8"))) or ""
        rows = [f"| `{file.name}` | {first_sentence(ast.get_docstring(ast.parse(file.read_text('utf-8'))) or '')} |"
                for file in sorted(folder.glob("*.py")) if file.name != "__init__.py"]  # fmt: skip
        made += [f"## {folder.relative_to(ROOT).as_posix()}", says, "\n".join(["| module | |", "|---|---|", *rows])]
    return "\n\n".join(filter(None, made)) + "\n"


def on_files(files, config):
    from mkdocs.structure.files import File

    pages, pictures = config.extra["pages"], set()
    url = (config.repo_url or "").rstrip("/")
    for page, source in pages.items():
        text = relinked((ROOT / source).read_text("utf-8"), source, pages, url, pictures)
        files.append(File.generated(config, page, content=text))
    files.append(File.generated(config, "examples.md", content=examples()))
    files.append(File.generated(config, "modules.md", content=modules()))
    for picture in sorted(pictures):
        files.append(File.generated(config, f"files/{picture}", abs_src_path=str(ROOT / picture)))
    return files


def on_page_content(html, page, config, files):
    return _ROLE.sub(r"\1", html)
