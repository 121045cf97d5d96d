"""What a page is made of, and what none may have: markup that a file brings, or anything from elsewhere."""

import re
from html.parser import HTMLParser
from pathlib import Path

SCRIPT = "<script>console.error('injected')<"  # no slash: it is part of an HDF5 path
OURS = (
    "H4sI",
    "// Draws the figures",
    '{"data": ',
    "// The film of a scene",
    "// What every page can do",
    "// Pictures to take away",
    '{"arrays": ',
)


class Tags(HTMLParser):
    """Every tag of a page, a file or its text, with its attributes, all of its words, and its scripts."""

    def __init__(self, page: Path | str) -> None:
        super().__init__()
        self.source = page.read_text(encoding="utf-8") if isinstance(page, Path) else page
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.scripts: list[str] = []
        self.feed(self.source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self.cdata_elem == "script":
            self.scripts[-1] += data
        else:
            self.text += data

    @property
    def words(self) -> str:
        """Its text in one line."""
        return " ".join(self.text.split())

    def foreign(self) -> list[str]:
        """Scripts that are none of ours: something a file said has become one."""
        return [script for script in self.scripts if not script.strip().startswith(OURS)]

    def attributes(self, tag: str, name: str) -> list[str | None]:
        return [attributes.get(name) for other, attributes in self.tags if other == tag]


def whole_in_itself(page: Path) -> Tags:
    """Tags of a page that asks nobody for anything, takes no markup from files and names what it shows."""
    tags = Tags(page)
    assert not {tag for tag, _ in tags.tags} & {"b", "iframe", "object", "embed"}
    assert not tags.foreign()
    loaded = [
        a[name] for _, a in tags.tags for name in ("src", "srcset", "data", "xlink:href") if a.get(name)
    ]
    assert all(url.startswith(("data:", "#")) for url in loaded if url)
    assert all(url and url.startswith("data:") for url in tags.attributes("link", "href"))
    assert not re.search(r"@import|url\((?!#)", tags.source)
    assert all(tags.attributes("img", "alt"))
    assert all(tags.attributes("th", "scope"))
    ids = [attributes["id"] for _, attributes in tags.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    local = [link[1:] for link in tags.attributes("a", "href") if link and link.startswith("#")]
    assert set(local) <= set(ids)
    return tags
