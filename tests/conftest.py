"""What tests of several files are given."""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser import CHROMIUM, SCREEN, chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs Chromium (Debian: apt-get install chromium)")
    with chromium() as browser:
        yield browser


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    """A window of 1280 by 900, in which no script may break down, whatever is clicked."""
    broken: list[str] = []
    with browser.new_page(viewport=SCREEN) as tab:
        tab.on("pageerror", lambda error: broken.append(str(error)))
        yield tab
        assert not broken


@pytest.fixture(scope="session")
def page_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Makes a small page of a kind, when it is first asked for."""
    from tests.pages import make  # which needs what makes every kind

    return cache(lambda kind: make(kind, tmp_path_factory.mktemp(kind)))
