"""What tests of several files are given."""

import os
import pickle
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import pytest
from playwright.sync_api import Browser, Page

from actin_xcheck.cli import app
from actin_xcheck.core.files import replace_file
from tests.browser import AXE, CHROMIUM, SCREEN, chromium, fetch_axe

if TYPE_CHECKING:
    from tests.small import Carried


def pytest_configure() -> None:
    """Take signals as in a terminal: tests started by nohup or in the background would ignore some."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs Chromium (Debian: apt-get install chromium)")
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    try:
        return fetch_axe(tmp_path_factory.mktemp("axe"))
    except (OSError, subprocess.SubprocessError) as error:
        pytest.skip(f"needs {AXE} from npm ({error})")


@pytest.fixture
def tab(browser: Browser) -> Iterator[Page]:
    """A window of 1280 by 900, in which no script may break down, whatever is clicked."""
    broken: list[str] = []
    with browser.new_page(viewport=SCREEN) as tab:
        tab.on("pageerror", lambda error: broken.append(str(error)))
        yield tab
        assert not broken


@pytest.fixture(scope="session")
def carried(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], "Carried"]:
    """Carries the smallest plan of a study out when it is first asked for, once for all of a run."""
    from tests.small import carried_out

    together = tmp_path_factory.getbasetemp()
    together = together.parent if "PYTEST_XDIST_WORKER" in os.environ else together

    def carry(name: str) -> "Carried":
        folder, kept = together / f"small-{name}", together / f"small-{name}.pickle"
        while not kept.exists():
            try:
                folder.mkdir()
            except FileExistsError:  # another process is at it
                time.sleep(0.1)
                continue
            try:
                replace_file(kept, pickle.dumps(carried_out(name, folder)))
            except BaseException:
                shutil.rmtree(folder)
                raise
        carried: Carried = pickle.loads(kept.read_bytes())
        return carried

    return cache(carry)


@pytest.fixture(scope="session")
def page_of(
    tmp_path_factory: pytest.TempPathFactory, carried: Callable[[str], "Carried"]
) -> Callable[[str], Path]:
    """Makes a small page of a kind, when it is first asked for."""
    from tests.pages import KINDS, make  # which needs what makes every kind

    def made(kind: str) -> Path:
        if kind in KINDS:
            return make(kind, tmp_path_factory.mktemp(kind))
        return carried(kind).folder / "index.html"

    return cache(made)


@pytest.fixture
def read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of meshes are read in this process, not in one of their own, which loads its readers anew."""

    def here(seconds: float, work: Callable[..., Any], *given: object) -> Any:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(meshio.Mesh, "__init__", meshio.Mesh.__init__)  # which the reader replaces
            return work(*given)

    monkeypatch.setattr("actin_xcheck.scene.mesh_file.aside", here)
    monkeypatch.setattr("actin_xcheck.studies.judge.theirs.aside", here)


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Does a command in this process, as `tests.test_cli.cli` in one of its own."""

    def call(line: str, *arguments: object) -> subprocess.CompletedProcess:
        monkeypatch.chdir(tmp_path)
        words = ["actin_xcheck", *shlex.split(line), *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as end:
            app.main()
        said = capsys.readouterr()
        return subprocess.CompletedProcess(words, end.value.code or 0, said.out, said.err)

    return call
