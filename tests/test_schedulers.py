"""Whatever may listen where a cluster's scheduler is looked for: it answers or is refused, within seconds."""

import shutil
import socket
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.executor import executor
from tests.processes import cluster


def refused(said: str):
    return pytest.raises(UserError, match=f"^--scheduler: {said}")


@pytest.mark.parametrize("says", [b"", b"HTTP/1.0 400 Bad Request\r\n\r\n<html>no</html>"])
def test_what_listens_but_is_no_scheduler_is_a_mistake_soon(says: bytes) -> None:
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as others:
        address, over = "tcp://{}:{}".format(*server.getsockname()), threading.Event()
        others.submit(answer, server, says, over)
        began = time.monotonic()
        try:
            with refused(f"{address}: no scheduler answers "), executor(1, address):
                pass
        finally:
            over.set()
    assert time.monotonic() - began < 10


def answer(server: socket.socket, says: bytes, over: threading.Event) -> None:
    """Say the same to all who come, and nothing more."""
    server.settimeout(0.1)
    with ExitStack() as came:
        while not over.is_set():
            with suppress(TimeoutError):
                came.enter_context(server.accept()[0]).sendall(says)


@pytest.mark.slow
def test_a_scheduler_of_another_version_is_one_line(tmp_path: Path, monkeypatch) -> None:
    distributed = pytest.importorskip("distributed")
    with cluster(tmp_path, 1) as (address, _):
        theirs = distributed.__version__
        monkeypatch.setattr(distributed, "__version__", "1999.1.0")
        said = f"{address} has dask.distributed {theirs}, this is 1999.1.0; valid: the same version$"
        with refused(said), executor(1, address):
            pass


@pytest.mark.slow
def test_a_scheduler_that_wants_certificates_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    if (openssl := shutil.which("openssl")) is None:
        pytest.skip("nothing makes certificates here")
    wanted = [openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", "key", "-out", "cert"]
    subprocess.run([*wanted, "-subj", "/CN=here"], cwd=tmp_path, check=True, capture_output=True)
    secured = ("--protocol", "tls", "--tls-ca-file", "cert", "--tls-cert", "cert", "--tls-key", "key")
    with cluster(tmp_path, 0, scheduler=secured) as (address, _):
        for asked in (address, address.replace("tls", "tcp")):
            began = time.monotonic()
            with refused(f"{asked}: no scheduler answers "), executor(1, asked):
                pass
            assert time.monotonic() - began < 10
