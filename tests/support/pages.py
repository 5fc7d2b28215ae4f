"""An HTML report that stands alone: no scripts, nothing loaded from elsewhere, figures embedded as SVG."""

import re
from urllib.parse import unquote
from xml.dom import minidom


def assert_stands_alone(page, *, links=()):
    """Hold that a page stands alone but for these links to follow; return its pictures."""
    assert not re.search(r"<(script|iframe|object|link)\b", page)
    sources = re.findall(r'(?:src|href|srcset)="((?!#)[^"]*)"', page)
    elsewhere = [source for source in sources if not source.startswith("data:image/svg+xml,")]
    assert elsewhere == list(links)
    pictures = [unquote(source.partition(",")[2]) for source in sources if source not in links]
    for picture in pictures:
        minidom.parseString(picture)
        assert all(target.startswith(("#", "data:")) for target in re.findall(r'href="([^"]*)"', picture))
    return pictures
